/** \file
 * Speed, yaw rate and steering from the car's own electronics, over UDP. */
#pragma once

#include <string>

#include "sensors/live_source.h"

namespace raceloc {

/** Listens on a UDP port of this computer. Each datagram is one line of text, numbers between blanks:
 * \code STAMP SPEED YAW_RATE [STEERING] \endcode
 * seconds since the epoch (UTC), m/s forward, rad/s counter-clockwise, rad of the road wheels, left positive. Whoever
 * reads the car's bus sends them. Datagrams that are something else are passed over.
 * \throws std::system_error if the port cannot be opened */
[[nodiscard]] Feed vehicleDatagrams(const std::string& label, int port);

}  // namespace raceloc
