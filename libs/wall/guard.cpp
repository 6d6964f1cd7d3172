#include "wall/guard.h"
