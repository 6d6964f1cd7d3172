#pragma once

#include "core/samples.h"

namespace raceloc {

/** A message and the time at which the recorder of the log gets it: the order of the log. */
struct Delivery {
  double arrival_s;  ///< on the recorder's clock; the sample's stamp is on the device's
  Sample sample;
};

}  // namespace raceloc
