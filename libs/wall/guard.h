/** \file
 * Who steers: the path of the localized car, or the wall. */
#pragma once

#include <optional>

#include "core/options.h"
#include "wall/wall_path.h"

namespace raceloc {

enum class GuardState {
  localized,       ///< the tracked path is driven
  wall_following,  ///< the gate has rejected everything for a while: the path along the wall
  emergency,       ///< the car, or the path it tracks, comes too close to a wall: the path along that wall
  no_wall          ///< not localized, and no wall either: nothing here can say where to go
};

[[nodiscard]] const char* nameOf(GuardState state);

/** Section [guard]. */
struct GuardOptions {
  Side side = Side::right;
  double reject_s = 0.3;
  double accept_s = 1.0;
  double emergency_distance_m = 0.5;
  double emergency_time_s = 1.0;
  double clear_distance_m = 0.8;
  double clear_time_s = 1.5;
  double clear_s = 0.5;
  double wheelbase_m = 2.97;
  double half_width_m = 0.97;
  double handover_deg_per_s = 10;
  double emergency_deg_per_s = 40;
  void describe(OptionList& keys);
};

/** What the guard decides on, at one instant. */
struct GuardInput {
  double stamp_s;
  bool is_localized;       ///< false: the gate rejects every source, or the estimate is lost
  const WallScan& walls;   ///< of the newest scan, body frame
  const Path& tracked;     ///< that the car would drive, body frame; empty: the arc that it drives now
  double speed_mps;        ///< forward
  double curvature_per_m;  ///< yaw rate over speed
};

/** How near the walls are: the wheels' outer faces against the nearest wall. */
struct Clearance {
  std::optional<Side> side = std::nullopt;  ///< of the wall meant; none: no wall is seen or remembered
  double wheel_m = 0;                       ///< from the nearest wheel to that wall now; < 0: it is beyond
  /** Along the tracked path at this speed, until a wheel touches; none: it does not, as far as path and wall go. */
  std::optional<double> time_to_wall_s = std::nullopt;
  /** And until a wheel is nearer than emergency_distance_m and still nears. */
  std::optional<double> time_to_close_s = std::nullopt;
};

/** Of the wall that is reached first; if none is, the nearest. */
[[nodiscard]] Clearance clearanceOf(const WallScan& walls, const Path& tracked, double speed_mps,
                                    const GuardOptions& options);

struct GuardOutput {
  GuardState state;
  bool has_changed;              ///< in this call
  std::optional<Side> side;      ///< of the wall that is followed; none in localized and no_wall
  std::optional<WallPath> path;  ///< to drive in wall_following and emergency
  Clearance clearance;
};

/** The state machine. Rules, first that applies:
 *  - emergency: a wheel nears a wall and is nearer than emergency_distance_m, or will be within emergency_time_s, on the
 *    path that is driven. It ends after clear_s with clear_distance_m and clear_time_s, or when that wall is gone.
 *  - wall_following: not localized for reject_s. The wall on `side`, at gap_m, or in the middle of a road that is
 *    narrower; without it the other one. The wall once followed as long as it is there. It ends after accept_s of being
 *    localized.
 *  - no_wall: the same, but there is no wall.
 *  - localized.
 * In an emergency, and along the other wall, the car does not go nearer than it was when that began: it does not cross
 * the road to gap_m. The path that is driven is the tracked one; once the car is lost, the one along the wall. Walls are those that are not passed, by their curves ahead: ahead(). */
class Guard {
 public:
  /** \throws InputError if options contradict each other. */
  Guard(const GuardOptions& options, const WallPathOptions& path);
  /** \throws std::invalid_argument if a stamp is earlier than the one before. */
  [[nodiscard]] GuardOutput update(const GuardInput& seen);
  [[nodiscard]] GuardState state() const { return x_state; }

 private:
  [[nodiscard]] bool lastsFor(bool is_so, double wanted_s, std::optional<double>& since_s) const;
  /** Notes whether the car is lost (reject_s, accept_s). */
  void hearOfEstimate(bool is_localized);
  /** Lets go of a wall that is gone; who is lost takes another one. */
  void chooseWall(const WallScan& walls);
  /** Begins or ends the emergency; the wall that is near becomes the one followed. */
  void hearOfClearance(const Clearance& clearance, const WallScan& walls);
  [[nodiscard]] GuardState nextState() const;
  void follow(std::optional<Side> side, const WallScan& walls);
  [[nodiscard]] WallPath plan(const GuardInput& input) const;

  GuardOptions x_options;
  WallPathOptions x_path;
  GuardState x_state = GuardState::localized;
  bool x_is_lost = false, x_is_emergency = false;
  std::optional<double> x_stamp_s, x_localized_since_s, x_lost_since_s, x_clear_since_s;
  std::optional<Side> x_side;      ///< of the wall that is followed
  std::optional<double> x_hold_m;  ///< at least this far from it
};

/** Merges the steering of who steers now with that of who steered before: at a change the command goes on from where it
 * was, and what it is off the new one fades at handover_deg_per_s (into an emergency: emergency_deg_per_s). So no
 * change of state makes a step, and every one is over after a bounded time. */
class SteeringHandover {
 public:
  explicit SteeringHandover(const GuardOptions& options) : x_options(options) {}
  /** \param wanted_rad  of the controller on the path of `state`, road wheels
   * \param dt_s         since the call before, >= 0
   * \return what to steer [rad] */
  [[nodiscard]] double steer(GuardState state, double wanted_rad, double dt_s);

 private:
  GuardOptions x_options;
  std::optional<GuardState> x_state;
  double x_command_rad = 0, x_off_rad = 0, x_rate_rps = 0;
};

}  // namespace raceloc
