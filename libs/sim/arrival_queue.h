#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <utility>

namespace raceloc {

/** Puts messages in order of arrival; those that arrive together keep the order in which they were pushed. */
template <class Message>
class ArrivalQueue {
 public:
  void push(double arrival_s, Message message) { x_waiting.emplace(arrival_s, std::move(message)); }
  /** The first message that has arrived by `now_s`, with its time of arrival; none if there is none. Nothing that
   * arrives before `now_s` may be pushed afterwards. */
  std::optional<std::pair<double, Message>> pop(double now_s) {
    if (x_waiting.empty() || x_waiting.begin()->first > now_s) return std::nullopt;
    auto first = x_waiting.extract(x_waiting.begin());
    return std::pair(first.key(), std::move(first.mapped()));
  }
  [[nodiscard]] std::size_t size() const { return x_waiting.size(); }

 private:
  std::multimap<double, Message> x_waiting;
};

}  // namespace raceloc
