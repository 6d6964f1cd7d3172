#include "track/racetrack_dict.h"

#include <cstdlib>
#include <stdexcept>

namespace raceloc {

namespace {

std::uint64_t packed(const KeyPair& keys) {
  return (static_cast<std::uint64_t>(keys.key_G) << 32) | keys.key_L;
}

/** a / b rounded down, b > 0. */
std::int64_t floorDiv(std::int64_t a, std::int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }

}  // namespace

RacetrackDict::RacetrackDict(int id_count) {
  if (id_count < 1) throw std::invalid_argument("RacetrackDict: needs an ID");
  x_passages.resize(static_cast<std::size_t>(id_count));
}

RacetrackDict::RacetrackDict(int id_count, const std::vector<RacetrackEntry>& entries)
    : RacetrackDict(id_count) {
  for (const auto& entry : entries)
    if (x_entries[add(entry.keys, entry.id, entry.session)].lap != entry.lap)
      throw std::invalid_argument("RacetrackDict: the stored laps do not follow from the IDs");
}

std::size_t RacetrackDict::add(const KeyPair& keys, int id, int session) {
  if (id < 0 || id >= idCount()) throw std::invalid_argument("RacetrackDict: ID out of range");
  if (!x_entries.empty() && session < x_entries.back().session)
    throw std::invalid_argument("RacetrackDict: sessions come one after the other");
  const std::size_t number = x_entries.size();
  if (!x_by_keys.emplace(packed(keys), number).second)
    throw std::invalid_argument("RacetrackDict: the keys are in it already");

  int lap = 0;
  if (number > 0 && x_entries.back().session == session) {
    const std::int64_t n = idCount(), before = station(number - 1);
    const std::int64_t ahead = (id - x_entries.back().id + n) % n;
    const std::int64_t now = before + (2 * ahead <= n ? ahead : ahead - n);  // the shorter way
    lap = static_cast<int>(floorDiv(now, n));
  }
  x_entries.push_back({keys, id, session, lap});
  x_passages[static_cast<std::size_t>(id)].push_back(number);
  return number;
}

std::optional<int> RacetrackDict::id(const KeyPair& keys) const {
  const auto found = x_by_keys.find(packed(keys));
  if (found == x_by_keys.end()) return std::nullopt;
  return x_entries[found->second].id;
}

const std::vector<std::size_t>& RacetrackDict::passages(int id) const {
  const int n = idCount();
  return x_passages[static_cast<std::size_t>((id % n + n) % n)];
}

std::int64_t RacetrackDict::station(std::size_t entry) const {
  const RacetrackEntry& e = x_entries.at(entry);
  return static_cast<std::int64_t>(e.lap) * idCount() + e.id;
}

bool RacetrackDict::samePass(std::size_t a, std::size_t b) const {
  return x_entries.at(a).session == x_entries.at(b).session &&
         2 * std::abs(station(a) - station(b)) < idCount();
}

}  // namespace raceloc
