/** \file
 * What one thread hands to another. */
#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>

namespace raceloc {

/** First in, first out; whoever is ahead waits. */
template <class T>
class BoundedQueue {
 public:
  /** \param most  items that wait in it, >= 1 */
  explicit BoundedQueue(std::size_t most) : x_most(most) {}

  /** Waits for room. \return false if the queue is closed: the item is dropped */
  bool push(T item) {
    std::unique_lock lock(x_mutex);
    x_changed.wait(lock, [&] { return x_closed || x_items.size() < x_most; });
    if (x_closed) return false;
    x_items.push_back(std::move(item));
    x_changed.notify_all();
    return true;
  }

  /** Never waits: in a full queue the first item for which `isExpendable` holds makes room, else the first of all.
   * \return what had to go: none, an older item, or the item itself if the queue is closed */
  template <class Predicate>
  std::optional<T> pushOver(T item, const Predicate& isExpendable) {
    const std::lock_guard lock(x_mutex);
    std::optional<T> gone;
    if (x_closed) {
      gone = std::move(item);
      return gone;
    }
    if (x_items.size() >= x_most) {
      auto victim = std::find_if(x_items.begin(), x_items.end(), isExpendable);
      if (victim == x_items.end()) victim = x_items.begin();
      gone = std::move(*victim);
      x_items.erase(victim);
    }
    x_items.push_back(std::move(item));
    x_changed.notify_all();
    return gone;
  }

  /** Waits for an item. \return none if the queue is closed and empty */
  std::optional<T> pop() {
    std::unique_lock lock(x_mutex);
    x_changed.wait(lock, [&] { return x_closed || !x_items.empty(); });
    return takeFirst();
  }

  /** Waits for an item, but not for longer than this. */
  std::optional<T> popWithin(std::chrono::milliseconds longest) {
    std::unique_lock lock(x_mutex);
    x_changed.wait_for(lock, longest, [&] { return x_closed || !x_items.empty(); });
    return takeFirst();
  }

  /** Closed and empty: nothing will come any more. */
  [[nodiscard]] bool isAtEnd() const {
    const std::lock_guard lock(x_mutex);
    return x_closed && x_items.empty();
  }

  /** Nothing is taken any more; what is in it can still be had. Either side may say so, more than once. */
  void close() {
    const std::lock_guard lock(x_mutex);
    x_closed = true;
    x_changed.notify_all();
  }

 private:
  /** With the lock held. */
  std::optional<T> takeFirst() {
    if (x_items.empty()) return std::nullopt;
    std::optional<T> item(std::move(x_items.front()));
    x_items.pop_front();
    x_changed.notify_all();
    return item;
  }

  std::size_t x_most;
  mutable std::mutex x_mutex;
  std::condition_variable x_changed;
  std::deque<T> x_items;
  bool x_closed = false;
};

}  // namespace raceloc
