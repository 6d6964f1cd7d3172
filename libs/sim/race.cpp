#include "sim/race.h"

#include <algorithm>
#include <cstdio>
#include <limits>
#include <stdexcept>
#include <type_traits>

#include "core/errors.h"
#include "core/labels.h"
#include "sim/scenery.h"

namespace raceloc {

namespace {

constexpr double kTruth_hz = 100;
/** Differences of poses reach this far beyond a measurement. */
constexpr double kMargin_s = 2 * TrueMotion::kReach_s;

/** As long as the slowest sweep, and some. */
double memoryFor(const CarFile& file) {
  double longest_s = 0;
  for (const auto& [label, lidar] : file.lidars) longest_s = std::max(longest_s, 1 / lidar.rate_hz);
  return longest_s + 1;
}

}  // namespace

template <class Model, class Options>
void Race::addDevices(const CarFile::Devices<Options>& devices, const RaceOptions& options,
                      double duration_share) {
  for (const auto& [label, device] : devices) {
    if (!matchesLabel(options.labels, label)) continue;
    x_devices.push_back(
        {Model(device, label, options.seed),
         {device.rate_hz, device.phase_s, duration_share / device.rate_hz, device.latency_s}});
  }
}

Race::Race(const Circuit& circuit, const CarFile& car, const RaceOptions& options)
    : x_circuit(circuit),
      x_car_path(car.path),
      x_distance_m(options.laps * circuit.track.length_m()),
      x_stand_s(options.stand_s),
      x_line(circuit.track, car.driver.margin_m),
      x_profile(circuit.track, x_line, car.car, car.driver, circuit.pace),
      x_world(sceneryMesh(circuit, options.seed)),
      x_traffic(circuit.track, x_line, x_profile, car.car, options.traffic, options.seed),
      x_car(circuit.track, x_line, x_profile, car.car, car.driver,
            options.start_mps.value_or(x_profile.at(0).speed_mps), options.seed),
      x_motion(circuit.track, car.car, memoryFor(car)) {
  if (x_stand_s > 0 && x_car.state().forward_mps > 0)
    throw std::invalid_argument("Race: a car that stands on the grid starts with speed 0");
  (void)car.devices(options.labels);  // throws when a pattern fits none
  addDevices<LidarModel>(car.lidars, options, 1);
  addDevices<GpsModel>(car.gps, options, 0);
  addDevices<ImuModel>(car.imus, options, 0);
  addDevices<VehicleModel>(car.vehicles, options, 0);
  x_devices.push_back({std::monostate(), {kTruth_hz, kMargin_s, 0, 0}});
  // Nothing measures before differences of poses can be taken.
  for (auto& device : x_devices) device.schedule.phase_s = std::max(device.schedule.phase_s, kMargin_s);
  x_motion.add(x_car.state());
}

double Race::progress() const { return std::clamp(x_car.state().s_m / x_distance_m, 0.0, 1.0); }

void Race::driveUntil(double time_s) {
  constexpr double kLost_m = 30, kStuck_s = 60, kStuck_m = 5;
  const auto failed = [&](const std::string& what) {
    const RaceCarState& x = x_car.state();
    char place[80];
    std::snprintf(place, sizeof place, " at station %.0f m, %.0f s after the start, at %.1f m/s", x.s_m,
                  x.time_s, x.forward_mps);
    return InputError("car " + x_car_path + " on track " + x_circuit.path + ": " + what + place);
  };
  while (x_car.state().time_s < time_s) {
    x_car.step(x_car.state().time_s >= x_stand_s);
    const RaceCarState& state = x_car.state();
    x_motion.add(state);
    if (!x_finish_s && state.s_m >= x_distance_m) x_finish_s = state.time_s;
    const RoadFrame road = x_circuit.track.at(state.s_m);
    if (!(state.n_m < road.left_m + kLost_m && state.n_m > -road.right_m - kLost_m))  // NaN too
      throw failed("the driver left the road");
    if (state.s_m > x_progress_m + kStuck_m || state.time_s < x_stand_s) {
      x_progress_m = state.s_m;
      x_progress_s = state.time_s;
    }
    if (state.time_s > x_progress_s + kStuck_s) throw failed("the car does not get on");
  }
}

void Race::measure(Device& device) {
  const double begin_s = device.schedule.begin_s(),
               arrival_s = device.schedule.ready_s() + device.schedule.latency_s;
  const std::uint64_t number = device.schedule.number++;
  std::visit(
      [&](auto& model) {
        using Model = std::decay_t<decltype(model)>;
        if constexpr (std::is_same_v<Model, std::monostate>) {
          x_arrivals.push(arrival_s, StampedPose{kStartStamp_s + begin_s, x_motion.T_map_body(begin_s)});
        } else if constexpr (std::is_same_v<Model, LidarModel>) {
          x_arrivals.push(arrival_s, model.sweep(x_motion, x_world, x_traffic, begin_s, number));
        } else if constexpr (std::is_same_v<Model, GpsModel>) {
          auto output = model.measure(x_motion, begin_s, number);
          if (output.pose) x_arrivals.push(arrival_s, std::move(*output.pose));
          x_arrivals.push(arrival_s, std::move(output.fix));
        } else {
          x_arrivals.push(arrival_s, model.measure(x_motion, begin_s, number));
        }
      },
      device.model);
}

std::optional<Race::Arrival> Race::next() {
  for (;;) {
    if (auto arrival = x_arrivals.pop(x_now_s)) return Arrival{arrival->first, std::move(arrival->second)};
    if (x_now_s == std::numeric_limits<double>::infinity()) return std::nullopt;
    auto& due = *std::min_element(x_devices.begin(), x_devices.end(), [](const Device& a, const Device& b) {
      return a.schedule.ready_s() < b.schedule.ready_s();
    });
    const double ready_s = due.schedule.ready_s();
    driveUntil(ready_s + kMargin_s);
    if (x_finish_s && ready_s > *x_finish_s) {
      x_now_s = std::numeric_limits<double>::infinity();  // what is still on its way arrives
      continue;
    }
    measure(due);
    x_now_s = ready_s;
  }
}

}  // namespace raceloc
