#include "cli/closed_loop_args.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "cli/closed_loop.h"
#include "cli/loop_localizer.h"
#include "cli/text_options.h"
#include "core/output_file.h"
#include "eval/time_picture.h"

namespace raceloc {

namespace {

constexpr char kClosedLoopManual[] = R"(NAME
  raceloc-sim closed-loop - a car that steers by what it measures, into trouble, with the guard and without it

SYNOPSIS
  raceloc-sim closed-loop --track TRACK --car CAR.ini --from M [--fail-for S] [--gap M] -o NAME
  raceloc-sim closed-loop --track TRACK --car CAR.ini --from M --shift M -o NAME

DESCRIPTION
  The two experiments on resilient navigation. The simulated car's sensors feed the filter and the gate of raceloc-live,
  whose estimate a path tracker steers by; its LiDARs feed the wall detector and the guard. There is no map: the scan
  match is the true pose with noise of 3 cm and 0.05 deg, ten times a second and 60 ms late. The path tracker, look-ahead
  with a feed-forward of curvature and tyre slip, is a means of this test and no product.

  When localization fails: the car is told to drive beside the right wall, --gap from it. After 2 s every receiver and the
  scan match drift off to the left for --fail-for seconds, at 1, 1.5, 2, ... times --drift and with 1 m of noise; or
  --faults says what goes wrong (ini/sim/faults; the scan match is a receiver labelled scan_match).
  When the path is wrong: with --shift the car is told the racing line, which after 150 m runs up to so far to the right
  of where it should, for 350 m, into the wall.

  Each is driven twice, with the guard and without it (the same filter and gate), until a wheel touches a wall or it is
  over. Writes NAME_guarded.csv, NAME_unguarded.csv and NAME.svg: steering, distance from wheel to wall, error of the
  believed position. Same arguments, same bytes. A line of CSV is 10 ms: time since the start; station and speed of the
  car, the truth; steering commanded to the road wheels, left is positive; wheel_to_wall, the least of the four wheels';
  gap, from the rear axle's middle to the right wall, and what the wall detector says of it (nan: no wall seen);
  believed_left, how far to the left of the car the estimate is; alarm of the gate (0 or 1); state of the guard.

EXAMPLES
  raceloc-sim closed-loop --track share/tracks/lvms.ini --car ini/sim/indy.ini --from 450 --fail-for 5 -o corner
  raceloc-sim closed-loop --track share/tracks/lvms.ini --car ini/sim/indy.ini --from 870 --shift 3 -o shifted

EXIT STATUS
  0 done, whatever the car hit; 2 an input is missing or wrong (one line says which); 1 a fault of raceloc.
)";

constexpr double kFailAt_s = 2, kAfter_s = 4;
constexpr double kShiftAfter_m = 150, kShiftRamp_m = 100, kShifted_m = 350;

std::string csvText(const ClosedLoopDrive& drive) {
  std::string text =
      "time_s,station_m,speed_mps,steering_command_deg,wheel_to_wall_m,gap_m,seen_gap_m,believed_left_m,"
      "alarm,guard\n";
  char line[200];
  for (const auto& r : drive.rows) {
    std::snprintf(line, sizeof line, "%.2f,%.3f,%.3f,%.4f,%.4f,%.4f,%.4f,%.4f,%d,%s\n", r.time_s, r.station_m,
                  r.speed_mps, r.steering_command_rad / kDegree, r.wheel_to_wall_m, r.gap_m, r.seen_gap_m,
                  r.believed_left_m, r.alarm ? 1 : 0, nameOf(r.guard));
    text += line;
  }
  return text;
}

TimeCurve curveOf(const ClosedLoopDrive& drive, const std::string& name,
                  double (*value)(const ClosedLoopRow&)) {
  TimeCurve curve{name, {}, {}};
  for (const auto& row : drive.rows) {
    curve.time_s.push_back(row.time_s);
    curve.values.push_back(value(row));
  }
  return curve;
}

std::string pictureOf(const ClosedLoopDrive& guarded, const ClosedLoopDrive& unguarded, double emergency_m,
                      std::vector<TimeSpan> spans) {
  for (const auto& row : guarded.rows) {
    if (row.guard == GuardState::localized) continue;
    const bool goes_on =
        !spans.empty() && spans.back().name == nameOf(row.guard) && row.time_s < spans.back().to_s + 0.015;
    if (goes_on)
      spans.back().to_s = row.time_s;
    else
      spans.push_back({row.time_s, row.time_s, nameOf(row.guard)});
  }
  const auto both = [&](const std::string& label, double (*value)(const ClosedLoopRow&)) {
    return TimePanel{
        label, {curveOf(guarded, "with the guard", value), curveOf(unguarded, "without", value)}, {}};
  };
  std::vector<TimePanel> panels{
      both("steering command [deg]", [](const ClosedLoopRow& r) { return r.steering_command_rad / kDegree; }),
      both("wheel to wall [m]", [](const ClosedLoopRow& r) { return r.wheel_to_wall_m; }),
      both("believed position, to the left [m]", [](const ClosedLoopRow& r) { return r.believed_left_m; })};
  panels[1].levels = {{0, "wall"}, {emergency_m, "emergency"}};
  return timePicture(panels, spans);
}

void print(const char* name, const ClosedLoopDrive& drive, double gap_m) {
  double least_m = HUGE_VAL, off_m = 0, slowest_mps = HUGE_VAL;
  double following_s = 0, emergency_s = 0, alarm_s = 0;
  for (std::size_t i = 1; i < drive.rows.size(); ++i) {
    const auto& r = drive.rows[i];
    const double dt_s = r.time_s - drive.rows[i - 1].time_s;
    least_m = std::min(least_m, r.wheel_to_wall_m);
    slowest_mps = std::min(slowest_mps, r.speed_mps);
    if (r.alarm) alarm_s += dt_s;
    if (r.guard == GuardState::emergency) emergency_s += dt_s;
    if (r.guard != GuardState::wall_following) continue;
    following_s += dt_s;
    off_m = std::max(off_m, std::abs(r.gap_m - gap_m));
  }
  const auto& last = drive.rows.back();
  if (drive.hasHit())
    std::printf("%-16s HIT THE WALL after %.2f s at %.1f m/s, station %.0f m\n", name, last.time_s,
                last.speed_mps, last.station_m);
  else
    std::printf("%-16s no wall was touched in %.2f s at %.1f m/s or more: wheel to wall %.2f m at least\n",
                name, last.time_s, slowest_mps, least_m);
  std::printf("                 alarm %.2f s, along the wall %.2f s, emergency %.2f s", alarm_s, following_s,
              emergency_s);
  if (following_s > 0) std::printf("; gap along the wall off by %.2f m at most", off_m);
  std::printf("\n");
}

}  // namespace

std::optional<ClosedLoopArgs> parseClosedLoop(std::vector<std::string> words) {
  CommandLine cmd(kClosedLoopManual);
  Text seed("", "seed", "of all noise and biases (default 1)", false, "1", "N", cmd);
  Text lidars("", "lidars", "those that look for walls (default lidar_front)", false, "lidar_front", "LABELS",
              cmd);
  Text shift("", "shift", "the racing line is told so far to the right of where it is [m]", false, "", "M",
             cmd);
  Text faults("", "faults", "what goes wrong, instead of the drift", false, "", "FAULTS.ini", cmd);
  Text drift("", "drift", "of the first receiver (default 4) [m/s]", false, "4", "MPS", cmd);
  Text fail_for("", "fail-for", "how long every source drifts (default 2) [s]", false, "2", "S", cmd);
  Text gap("", "gap", "from the rear axle's middle to the wall (default 3) [m]", false, "3", "M", cmd);
  Text speed("", "speed", "as fast as the tyres allow, but no faster (default 62) [m/s]", false, "62", "MPS",
             cmd);
  Text from("", "from", "station of the start (default 0) [m]", false, "0", "M", cmd);
  Text out("o", "output", "NAME_guarded.csv, NAME_unguarded.csv and NAME.svg are written", true, "", "NAME",
           cmd);
  Text car("c", "car", "the car and its devices", true, "", "CAR.ini", cmd);
  Text track("", "track", "the circuit; level along its centre line", true, "", "TRACK.ini|CSV", cmd);
  if (!cmd.parse(std::move(words))) return std::nullopt;
  ClosedLoopArgs args{track.getValue(),
                      car.getValue(),
                      faults.getValue(),
                      out.getValue(),
                      numberOf(from, between(0, 1e5)),
                      numberOf(speed, between(5, 120)),
                      numberOf(gap, between(1.5, 20)),
                      numberOf(fail_for, between(0, 60)),
                      numberOf(drift, between(0.1, 100)),
                      std::nullopt,
                      lidars.getValue(),
                      static_cast<std::uint64_t>(wholeNumberOf(seed, between(0, 1e9)))};
  if (shift.isSet()) args.shift_m = numberOf(shift, between(0, 10));
  for (const auto* other : {&fail_for, &faults, &drift, &gap})
    if (shift.isSet() && other->isSet())
      throw InputError("--shift: one experiment at a time, without --" + other->getName());
  for (const auto* other : {&fail_for, &drift})
    if (faults.isSet() && other->isSet())
      throw InputError("--faults: what the file says goes wrong, without --" + other->getName());
  return args;
}

void runClosedLoop(const ClosedLoopArgs& args) {
  const std::string guarded_path = args.out_path + "_guarded.csv",
                    unguarded_path = args.out_path + "_unguarded.csv";
  const std::string picture_path = args.out_path + ".svg";
  for (const auto& path : {guarded_path, unguarded_path, picture_path})
    (void)OutputFile(path);  // what cannot be written is told before the work
  Circuit circuit = readCircuit(args.track_path);
  constexpr double kTyresAlone_mps2 = 100;
  circuit.pace = {args.speed_mps, kTyresAlone_mps2};
  const CarFile car = readCarFile(args.car_path);
  if (args.from_m >= circuit.track.length_m())
    throw InputError("--from " + std::to_string(args.from_m) + ": a lap of " + args.track_path + " has " +
                     std::to_string(circuit.track.length_m()) + " m");
  const ClosedLoop loop(circuit, car, args.lidars, args.seed);

  ClosedLoopOptions options;
  options.from_m = args.from_m;
  options.seed = args.seed;
  std::vector<TimeSpan> spans;
  if (args.shift_m) {
    options.duration_s = (kShiftAfter_m + kShifted_m) / args.speed_mps + kAfter_s;
  } else {
    double until_s = kFailAt_s + args.fail_for_s;
    if (args.faults_path.empty()) {
      options.faults = everySourceDrifts(circuit.track, car, args.from_m + kFailAt_s * args.speed_mps,
                                         kFailAt_s, until_s, args.drift_mps);
      spans.push_back({kFailAt_s, until_s, "every source drifts"});
    } else {
      options.faults = readFaults(args.faults_path);
      auto devices = car.devices();
      devices.push_back({kMatchLabel, "gps"});
      requireDevices(options.faults, args.faults_path, devices);
      for (const auto& fault : options.faults) until_s = std::max({until_s, fault.from_s, fault.to_s});
      for (const auto& fault : options.faults)
        spans.push_back({fault.from_s, std::min(fault.end_s(), until_s + kAfter_s), nameOf(fault.kind)});
    }
    options.duration_s = until_s + kAfter_s;
  }
  const RacingLine told =
      args.shift_m ? shiftedLine(circuit.track, RacingLine(circuit.track, car.driver.margin_m),
                                 args.from_m + kShiftAfter_m, args.from_m + kShiftAfter_m + kShifted_m,
                                 kShiftRamp_m, *args.shift_m)
                   : lineAlongWall(circuit, car.car, Side::right, args.gap_m);
  GuardOptions guard;
  guard.wheelbase_m = car.car.wheelbase_m;
  guard.half_width_m = 0.5 * car.car.width_m;
  WallPathOptions wall_path;
  wall_path.gap_m = args.gap_m;
  wall_path.least_gap_m = std::min(wall_path.least_gap_m, args.gap_m);

  const ClosedLoopDrive guarded = loop.drive(told, options, guard, wall_path);
  options.is_guarded = false;
  const ClosedLoopDrive unguarded = loop.drive(told, options, guard, wall_path);
  writeTextFile(guarded_path, csvText(guarded));
  writeTextFile(unguarded_path, csvText(unguarded));
  writeTextFile(picture_path, pictureOf(guarded, unguarded, guard.emergency_distance_m, spans));

  std::printf("track            %s, from station %.0f m\n", circuit.name.c_str(), args.from_m);
  print("with the guard", guarded, args.gap_m);
  print("without", unguarded, args.gap_m);
  std::printf("written          %s, %s, %s\n", guarded_path.c_str(), unguarded_path.c_str(),
              picture_path.c_str());
}

}  // namespace raceloc
