/** \file
 * A circuit: the road, what stands beside it, where on earth it is, and how fast it is driven; read from
 * share/tracks/NAME.ini or from a centre-line CSV. */
#pragma once

#include <string>
#include <vector>

#include "core/options.h"
#include "core/types.h"
#include "track/track.h"

namespace raceloc {

enum class Side { left, right, both };

/** A wall along the road, with a catch-fence on it or none. */
struct Barrier {
  double from_m, to_m;  ///< stations
  Side side;            ///< left or right
  double offset_m;      ///< from the edge of the road to the wall's face
  double height_m;
  double fence_m;  ///< posts and cables reach this far above the wall; 0: no fence
};

enum class SceneryKind { grandstand, building, gantry, overpass, tunnel, trees };

/** What a LiDAR sees beside the walls. Section [scenery_NN]. */
struct Scenery {
  SceneryKind kind = SceneryKind::building;
  double from_m = 0, to_m = 0;  ///< stations
  Side side = Side::left;
  double offset_m = 10;
  double depth_m = 10;
  double height_m = 6;
  void describe(OptionList& keys);
};

/** How the track is driven. Section [pace]. */
struct Pace {
  double top_speed_mps = 60;
  double lateral_limit_mps2 = 60;
  void describe(OptionList& keys);
};

/** By how much the segments of a file missed a closed loop; the gap before or after the heading was put right,
 * whichever is larger. Zero for a centre line. */
struct ClosureMiss {
  double gap_m = 0, height_m = 0, heading_rad = 0;
};

struct Circuit {
  std::string name, path;
  GeodeticPoint origin;  ///< of the map frame, on the centre line at the start
  Track track;
  std::vector<Barrier> barriers;
  std::vector<Scenery> scenery;
  double post_spacing_m;  ///< of catch-fences
  bool kerbs;             ///< at the edges of corners
  Pace pace;
  ClosureMiss miss;
  std::vector<std::string> notes;  ///< what was assumed
};

/** Reads `path`: an ini (see share/tracks/lvms.ini), or a CSV `x_m,y_m,w_tr_right_m,w_tr_left_m` in the order of
 * driving, which gets default barriers on both sides and an assumed origin (said in `notes`).
 *
 * Curvature, bank, grade and widths of the segments are smoothed over `transition_m` (two moving averages of
 * half that length), so that turns begin as clothoids and their total angle stays. Then the miss is distributed:
 * of heading over the turns by their curvature, of position and height evenly along the track.
 *
 * \throws InputError naming file, section, key and value; also for segments that miss a closed loop by more than
 * 1 % of its length (or of a full turn), with the miss. */
[[nodiscard]] Circuit readCircuit(const std::string& path);

}  // namespace raceloc
