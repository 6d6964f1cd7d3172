#include "wall/guard.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace raceloc {

const char* nameOf(GuardState state) {
  switch (state) {
    case GuardState::localized:
      return "localized";
    case GuardState::wall_following:
      return "wall_following";
    case GuardState::emergency:
      return "emergency";
    case GuardState::no_wall:
      return "no_wall";
  }
  return "no_wall";
}

void GuardOptions::describe(OptionList& keys) {
  keys.add("side", side, {{"left", Side::left}, {"right", Side::right}},
           "of the wall that is followed when both are there");
  keys.add("reject_s", reject_s, between(0, 10), "not localized for so long: along the wall [s]");
  keys.add("accept_s", accept_s, between(0, 60),
           "localized again for so long: back from the wall to the tracked path [s]");
  keys.add("emergency_distance_m", emergency_distance_m, between(0, 10),
           "a wheel that is nearer to a wall and nears it, or will be so ... [m]");
  keys.add("emergency_time_s", emergency_time_s, between(0, 10), "... within this time: emergency [s]");
  keys.add("clear_distance_m", clear_distance_m, between(0, 10),
           "an emergency ends when the wheels are so far from the wall ... [m]");
  keys.add("clear_time_s", clear_time_s, between(0, 10), "... and will not come near it for so long ... [s]");
  keys.add("clear_s", clear_s, between(0, 10), "... and both have been so for this time [s]");
  keys.add("wheelbase_m", wheelbase_m, between(0.5, 10), "from the rear to the front axle [m]");
  keys.add("half_width_m", half_width_m, between(0.1, 3), "from the middle to the wheels' outer faces [m]");
  keys.add("handover_deg_per_s", handover_deg_per_s, above(0),
           "of steering, by which a change of who steers may show [deg/s]");
  keys.add("emergency_deg_per_s", emergency_deg_per_s, above(0), "the same into an emergency [deg/s]");
  keys.atMost("emergency_distance_m", emergency_distance_m, "clear_distance_m", clear_distance_m);
  keys.atMost("emergency_time_s", emergency_time_s, "clear_time_s", clear_time_s);
}

namespace {

constexpr double kOnward = 0.75;  // of emergency_time_s: so far a wall is taken to go on as where it is seen
constexpr double kStanding_mps = 0.1;  // slower, no wall is reached in any time that matters

/** Of the nearer one of the wheels on the wall's side, the body being at a point of a path. */
double wheelClearance_m(const Wall& wall, const PathPoint& at, const GuardOptions& options) {
  const double across_m = wall.side == Side::left ? options.half_width_m : -options.half_width_m;
  const Eigen::Rotation2Dd R(at.heading_rad);
  const auto of = [&](double ahead_m) {
    return wall.clearance_m(Eigen::Vector2d(at.x_m, at.y_m) + R * Eigen::Vector2d(ahead_m, across_m));
  };
  return std::min(of(0), of(options.wheelbase_m));
}

Clearance clearanceOf(const Wall& wall, const Path& tracked, double speed_mps, const GuardOptions& options) {
  constexpr double kAlong = 0.005;  // of the way: less is along the wall, whose heading is known to 0.3 deg
  Clearance found;
  found.side = wall.side;
  found.wheel_m = wheelClearance_m(wall, {0, 0, 0, 0, 0}, options);
  if (speed_mps < kStanding_mps) return found;
  double before_s_m = 0, before_m = found.wheel_m;
  for (const PathPoint& at : tracked) {
    if (at.x_m > std::max(wall.to_x_m, kOnward * options.emergency_time_s * speed_mps)) break;
    const double now_m = wheelClearance_m(wall, at, options);
    if (at.s_m <= 0) {  // the car's place, with the path's heading
      before_m = now_m;
      continue;
    }
    // Where between the two points it gets so near.
    const auto timeOf = [&](double limit_m) {
      const double share = before_m > limit_m ? (before_m - limit_m) / (before_m - now_m) : 0;
      return (before_s_m + share * (at.s_m - before_s_m)) / speed_mps;
    };
    const bool nears = before_m - now_m > kAlong * (at.s_m - before_s_m);
    if (!found.time_to_close_s && nears && now_m < options.emergency_distance_m)
      found.time_to_close_s = timeOf(options.emergency_distance_m);
    if (now_m <= 0) {
      found.time_to_wall_s = timeOf(0);
      break;
    }
    before_s_m = at.s_m;
    before_m = now_m;
  }
  return found;
}

}  // namespace

Clearance clearanceOf(const WallScan& walls, const Path& tracked, double speed_mps,
                      const GuardOptions& options) {
  Clearance worst;
  const auto urgency = [](const Clearance& c) {
    constexpr double kNever_s = 1e9;
    return std::array{c.time_to_wall_s.value_or(kNever_s), c.time_to_close_s.value_or(kNever_s), c.wheel_m};
  };
  for (const auto* wall : {&walls.left, &walls.right}) {
    if (!*wall) continue;
    const Clearance here = clearanceOf(**wall, tracked, speed_mps, options);
    if (!worst.side || urgency(here) < urgency(worst)) worst = here;
  }
  return worst;
}

Guard::Guard(const GuardOptions& options, const WallPathOptions& path) : x_options(options), x_path(path) {
  requireConsistent("guard", options);
  requireConsistent("wall_path", path);
}

bool Guard::lastsFor(bool is_so, double wanted_s, std::optional<double>& since_s) const {
  if (!is_so) {
    since_s.reset();
    return false;
  }
  if (!since_s) since_s = x_stamp_s;
  return *x_stamp_s - *since_s >= wanted_s;
}

void Guard::follow(std::optional<Side> side, const WallScan& walls) {
  if (side == x_side) return;
  x_side = side;
  x_hold_m.reset();
  if (side && (x_is_emergency || *side != x_options.side)) x_hold_m = walls.on(*side)->distance_m();
}

WallPath Guard::plan(const GuardInput& input) const {
  const auto& left = input.walls.left;
  const auto& right = input.walls.right;
  double gap_m = x_path.gap_m;
  if (left && right) gap_m = std::min(gap_m, 0.5 * (left->distance_m() + right->distance_m()));
  if (x_hold_m) gap_m = std::max(gap_m, *x_hold_m);
  return planAlong(*input.walls.on(*x_side), gap_m, input.speed_mps, input.curvature_per_m, x_path);
}

void Guard::hearOfEstimate(bool is_localized) {
  if (lastsFor(!is_localized, x_options.reject_s, x_lost_since_s)) x_is_lost = true;
  if (lastsFor(is_localized, x_options.accept_s, x_localized_since_s)) x_is_lost = false;
}

void Guard::chooseWall(const WallScan& walls) {
  if (x_side && !walls.on(*x_side)) {
    x_is_emergency = false;  // that wall is gone
    x_side.reset();
  }
  const Side other = x_options.side == Side::left ? Side::right : Side::left;
  for (const Side side : {x_options.side, other})
    if (x_is_lost && !x_side && walls.on(side)) follow(side, walls);
}

void Guard::hearOfClearance(const Clearance& clearance, const WallScan& walls) {
  const double close_s = clearance.time_to_close_s.value_or(std::numeric_limits<double>::infinity());
  const bool is_clear = !clearance.side || (clearance.wheel_m >= x_options.clear_distance_m &&
                                            close_s >= x_options.clear_time_s);
  if (lastsFor(is_clear, x_options.clear_s, x_clear_since_s)) x_is_emergency = false;
  if (close_s < x_options.emergency_time_s) {
    x_is_emergency = true;
    follow(clearance.side, walls);
  }
}

GuardState Guard::nextState() const {
  if (x_is_emergency) return GuardState::emergency;
  if (!x_is_lost) return GuardState::localized;
  return x_side ? GuardState::wall_following : GuardState::no_wall;
}

GuardOutput Guard::update(const GuardInput& seen) {
  const WallScan walls = ahead(seen.walls);
  Path arc;
  if (seen.tracked.empty())
    arc = arcPath(seen.curvature_per_m, std::max(x_path.min_length_m, x_path.horizon_s * seen.speed_mps));
  const GuardInput input{seen.stamp_s,   seen.is_localized,
                         walls,          seen.tracked.empty() ? arc : seen.tracked,
                         seen.speed_mps, seen.curvature_per_m};
  if (x_stamp_s && !(input.stamp_s >= *x_stamp_s))
    throw std::invalid_argument("Guard: stamps must not go back");
  x_stamp_s = input.stamp_s;
  hearOfEstimate(input.is_localized);
  chooseWall(walls);

  // Who is not localized drives the path along the wall.
  std::optional<WallPath> path;
  if (x_is_lost && x_side) path = plan(input);
  const Clearance clearance =
      clearanceOf(walls, path ? path->points : input.tracked, input.speed_mps, x_options);
  hearOfClearance(clearance, walls);

  const GuardState state = nextState();
  const bool has_changed = state != x_state;
  x_state = state;
  if (state == GuardState::localized) x_side.reset();
  if (!x_side) return {state, has_changed, std::nullopt, std::nullopt, clearance};
  if (!path || path->side != *x_side) path = plan(input);
  return {state, has_changed, x_side, std::move(path), clearance};
}

double SteeringHandover::steer(GuardState state, double wanted_rad, double dt_s) {
  if (x_state && state != *x_state) {
    x_off_rad = x_command_rad - wanted_rad;
    x_rate_rps = kDegree * (state == GuardState::emergency ? x_options.emergency_deg_per_s
                                                           : x_options.handover_deg_per_s);
  }
  x_state = state;
  const double fade_rad = x_rate_rps * dt_s;
  x_off_rad = std::copysign(std::max(0.0, std::abs(x_off_rad) - fade_rad), x_off_rad);
  return x_command_rad = wanted_rad + x_off_rad;
}

}  // namespace raceloc
