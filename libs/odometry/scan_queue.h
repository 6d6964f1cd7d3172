/** \file
 * A scan is stamped at the start of its sweep; the motion that de-skews it is known only when the sweep is over. The
 * sweeps of several LiDARs are matched as one. */
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cloud/deskew.h"
#include "cloud/point_times.h"
#include "core/samples.h"
#include "odometry/motion_history.h"

namespace raceloc {

/** What was wrong, and how often. */
using FaultCounts = std::map<std::string, std::size_t>;

/** Within the fault of a scan whose point times are missing or bad. */
constexpr char kTakenAsItIs[] = "scan taken as it is";

/** Holds scans until the motion of their sweep is known, or until it is late, and puts those together that end close
 * together, at most one of each LiDAR. Bounded: it never holds more than a few sweeps, because a scan leaves at the
 * latest 0.3 s after its end, or after the end at which a companion of its turn was due. Its own memory is kept from
 * sweep to sweep: only what is new (a LiDAR, a fault) allocates.
 *
 * Which belong together: LiDARs end their sweeps in turn, again and again; a sweep of all begins after the longest
 * pause in that turn. Two LiDARs that end less than half a period apart are one sweep whichever is first, and three
 * that fire evenly in turn are one sweep too.
 * Waiting: one LiDAR alone waits for no other. A LiDAR that was in time the last time is waited for until a quarter
 * of its period after the end that it should have had; one that is dead or late therefore delays the others by that,
 * once. A sweep that comes when its companions have left goes with the next. */
class ScanQueue {
 public:
  /** \param expected LiDARs that should be there: one that never delivers is named; it is not waited for */
  explicit ScanQueue(std::vector<std::string> expected = {}) : x_expected(std::move(expected)) {}

  /** What is wrong with a scan is named. One whose point times are bad is taken as it is, at the middle of its sweep if
   * that can be known. One is passed over if its stamp is no number or repeats the LiDAR's newest, or if it ends no
   * later than the last one of its LiDAR that has left. */
  void push(Scan scan);

  /** The next sweep whose motion is known, or which ended more than 0.3 s before `now_s` (the newest
   * stamp of the stream); null if it has to wait. Call until it gives none. Ends of sweeps increase. A sweep is good
   * until the next one leaves. */
  const Sweep* pop(const MotionHistory& history, double now_s);

  /** At the end of the stream: the next sweep, whatever is known. */
  const Sweep* popAny();

  [[nodiscard]] bool empty() const { return x_waiting.empty(); }

  /** What went wrong since the last call: scans that were passed over or late, LiDARs that are silent at `now_s`. */
  FaultCounts takeFaults(double now_s);

 private:
  struct Waiting {
    double end_s;
    Scan scan;
  };
  struct Lidar {
    double stamp_s = 0, end_s = 0;           ///< of its newest scan
    std::vector<double> gaps_s;              ///< between its last scans
    double sweep_s = 0;                      ///< of its newest scan with good point times
    bool ascending = true;                   ///< how the times of its points go along the cloud ...
    int same_order = 0;                      ///< ... and for how many scans it has been so
    int groundless = 0;                      ///< scans in a row without ground below the car
    std::map<PointTimes, std::string> told;  ///< of bad point times, as they were seen first: one text a kind
    std::optional<double> used_s;            ///< end of the last scan of it that has left
    bool in_time = true;                     ///< its newest scan came before its companions left
    bool silence_told = false;               ///< since its newest scan
    [[nodiscard]] double period_s() const;   ///< median gap; of usual LiDARs while there is none
    [[nodiscard]] double silentAfter_s() const;  ///< without a scan for so long, one has not come
  };
  /** One of the next sweep: waiting, or still awaited. */
  struct Member {
    double end_s;
    bool here;
  };
  /** Into x_members, by end; at least one. */
  void listMembers(double now_s);
  /** Takes away point times that cannot be believed. */
  void checkTimes(Scan& scan, Lidar& lidar);
  void checkContent(const Scan& scan, Lidar& lidar);
  const Sweep* leave();  ///< of x_members
  void note(const std::string& label, const std::string& what);

  std::vector<std::string> x_expected;
  std::vector<Waiting> x_waiting;      ///< by end of sweep, all later than x_last_end_s
  std::map<std::string, Scan> x_late;  ///< whose companions have left: for the next sweep
  std::map<std::string, Lidar> x_lidars;
  std::vector<Member> x_members;
  Sweep x_sweep{};                                ///< that left last
  std::optional<double> x_first_s, x_last_end_s;  ///< of the first scan; of the last sweep that left
  FaultCounts x_noted;
};

}  // namespace raceloc
