#include "fusion/integrity.h"

namespace raceloc {

const char* nameOf(LocalizationState state) {
  switch (state) {
    case LocalizationState::ok:
      return "ok";
    case LocalizationState::degraded:
      return "degraded";
    case LocalizationState::dead_reckoning:
      return "dead_reckoning";
    case LocalizationState::lost:
      return "lost";
  }
  return "lost";
}

}  // namespace raceloc
