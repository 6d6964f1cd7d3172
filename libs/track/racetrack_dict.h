/** \file
 * Which key poses were where on the loop, and on which lap. */
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

namespace raceloc {

/** One key pose in both graphs: its number in the GPS/INS graph and in the LiDAR graph. */
struct KeyPair {
  std::uint32_t key_G, key_L;
};

/** A key pose on the loop. */
struct RacetrackEntry {
  KeyPair keys;
  int id;       ///< racetrack ID, 0 .. N-1
  int session;  ///< the drive it belongs to
  int lap;  ///< of its session, see RacetrackDict; negative for one that backed over the line at its start
};

/** `racetrack_dict[(key_G, key_L)] -> id`, its reverse, and the laps, each in O(1). Source: reading.md section 3,
 * paper's racetrack_dict.
 *
 * Laps are counted by station = lap * N + id: from one key pose of a session to the next it changes by the shorter
 * way round the loop, and the first one has lap 0. So a lap begins at way-point 0, and a car that stands, or whose
 * ID jitters there, gains none. Between two key poses with IDs must lie less than half a lap. */
class RacetrackDict {
 public:
  /** \param id_count  N of the loop \throws std::invalid_argument if it is < 1 */
  explicit RacetrackDict(int id_count);

  /** As entries() gave it. \throws std::invalid_argument as add() does, and for laps that those entries cannot have. */
  RacetrackDict(int id_count, const std::vector<RacetrackEntry>& entries);

  /** The next key pose that has an ID. Within a session in the order of driving.
   * \return its entry's number \throws std::invalid_argument for an ID out of range, keys that are in it already, or
   * a session that came before the latest one */
  std::size_t add(const KeyPair& keys, int id, int session);

  [[nodiscard]] std::optional<int> id(const KeyPair& keys) const;  ///< racetrack_dict[(key_G, key_L)]
  [[nodiscard]] int idCount() const { return static_cast<int>(x_passages.size()); }

  /** All of it, in the order of add(): what is stored. */
  [[nodiscard]] const std::vector<RacetrackEntry>& entries() const { return x_entries; }

  /** Numbers of the entries with this ID, ascending; IDs beyond 0 .. N-1 wrap round the loop. */
  [[nodiscard]] const std::vector<std::size_t>& passages(int id) const;

  /** Way-points since the first way-point 0 of its session's lap 0. */
  [[nodiscard]] std::int64_t station(std::size_t entry) const;

  /** Whether two entries belong to one pass over a place: the same session, less than half a lap apart. */
  [[nodiscard]] bool samePass(std::size_t a, std::size_t b) const;

 private:
  std::vector<RacetrackEntry> x_entries;
  std::unordered_map<std::uint64_t, std::size_t> x_by_keys;
  std::vector<std::vector<std::size_t>> x_passages;  ///< by ID
};

}  // namespace raceloc
