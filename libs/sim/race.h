/** \file
 * A race as the messages that a recorder in the car gets, one by one. */
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/trajectory.h"
#include "sim/arrival_queue.h"
#include "sim/delivery.h"
#include "sim/sensor_models.h"

namespace raceloc {

struct RaceOptions {
  double laps = 1;
  std::optional<double> start_mps;  ///< none: at the speed that the profile has at the start line
  double stand_s = 0;               ///< the car stands on the grid this long; then start_mps must be 0
  int traffic = 0;                  ///< other cars
  std::uint64_t seed = 1;
  std::string labels = "*";  ///< devices that are simulated: shell patterns
};

/** A message of a device, or the truth. */
using RaceMessage = std::variant<Sample, StampedPose>;

/** Circuit, car and seed to messages in order of arrival. Memory does not grow with the length of the race. The
 * same arguments give the same messages, bit for bit, on any number of threads. */
class Race {
 public:
  /** The circuit must outlive it. \throws InputError if no device of the car matches `labels`;
   * std::invalid_argument for a car that stands at speed. */
  Race(const Circuit& circuit, const CarFile& car, const RaceOptions& options);

  struct Arrival {
    double time_s;  ///< since the start
    RaceMessage message;
  };
  /** Empty when the race is over. The truth (T_map_body, 100 Hz, no latency) comes among the devices' messages;
   * its stamps have no clock offset. \throws InputError if the car leaves the road or gets stuck, with the place: the
   * track asks more of the driver than the car file allows. */
  [[nodiscard]] std::optional<Arrival> next();

  [[nodiscard]] double progress() const;  ///< of the way, 0..1
  [[nodiscard]] const SpeedProfile& profile() const { return x_profile; }

 private:
  /** When a device measures next, and when that measurement is whole. */
  struct Schedule {
    double rate_hz, phase_s, duration_s, latency_s;
    std::uint64_t number = 0;
    [[nodiscard]] double begin_s() const { return phase_s + static_cast<double>(number) / rate_hz; }
    [[nodiscard]] double ready_s() const { return begin_s() + duration_s; }
  };
  struct Device {
    std::variant<LidarModel, GpsModel, ImuModel, VehicleModel, std::monostate> model;  // monostate: the truth
    Schedule schedule;
  };
  template <class Model, class Options>
  void addDevices(const CarFile::Devices<Options>& devices, const RaceOptions& options,
                  double duration_share);
  void driveUntil(double time_s);
  void measure(Device& device);

  const Circuit& x_circuit;
  std::string x_car_path;
  double x_distance_m, x_stand_s;
  RacingLine x_line;
  SpeedProfile x_profile;
  World x_world;
  Traffic x_traffic;
  RaceCar x_car;
  TrueMotion x_motion;
  std::vector<Device> x_devices;
  ArrivalQueue<RaceMessage> x_arrivals;
  double x_now_s = 0;
  double x_progress_m = 0, x_progress_s = 0;  ///< where and when the car last got on
  std::optional<double> x_finish_s;
};

}  // namespace raceloc
