/** \file
 * MRPT's sensor drivers, as an ini file in rawlog-grabber's manner asks for them. */
#pragma once

#include <streambuf>
#include <string>
#include <vector>

#include "sensors/live_source.h"

namespace raceloc {

struct OpenSensors {
  std::vector<Feed> feeds;              ///< one a section, labelled with its sensorLabel
  std::vector<std::string> gps_labels;  ///< of the receivers among them
};

/** Opens a sensor for each section with `driver = CLASS` (CGPSInterface, CVelodyneScanner, CIMUXSens_MT4, ...); the
 * other keys of a section are the driver's own, as MRPT documents them. [global] is rawlog-grabber's and passed over.
 *  - `sensorLabel` is obligatory, one a sensor, and becomes the label of all that samples are made of; what else
 *    a driver delivers keeps the label that the driver gave it;
 *  - `process_rate` [Hz]: how often the driver is asked; 200 without it, but a CVelodyneScanner takes one packet a call
 *    and is asked without a pause;
 *  - `data_port`, `position_port` of a CVelodyneScanner: UDP ports, 2368 and 8308 without them. At each data packet the
 *    driver waits a millisecond for a position packet: it takes about 900 packets a second, which is enough for a VLP-16
 *    (754), and not for an HDL-32 (1808).
 * MRPT has no driver for a car's own electronics: `driver = VehicleDatagrams` is ours, see vehicle_datagrams.h, with the
 * keys `sensorLabel` and `port`.
 * GPS messages that MRPT can write but not read back (notes on GenericFrame and INSCOVS) are left out: they would make
 * the rest of a recording unreadable.
 * \throws InputError naming file and section for a driver that MRPT does not have, one that refuses its keys, or a
 * device that cannot be opened. */
[[nodiscard]] OpenSensors openSensors(const std::string& ini_path);

/** While it lives, MRPT's drivers print no traces to stderr; what they complain of is in SensorHealth. */
class QuietDrivers {
 public:
  QuietDrivers();
  ~QuietDrivers();
  QuietDrivers(const QuietDrivers&) = delete;
  QuietDrivers& operator=(const QuietDrivers&) = delete;

 private:
  std::streambuf* x_before;
};

}  // namespace raceloc
