/** \file
 * What one thread hands to another. */
#pragma once

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

  /** Waits for an item. \return none if the queue is closed and empty */
  std::optional<T> pop() {
    std::unique_lock lock(x_mutex);
    x_changed.wait(lock, [&] { return x_closed || !x_items.empty(); });
    if (x_items.empty()) return std::nullopt;
    std::optional<T> item(std::move(x_items.front()));
    x_items.pop_front();
    x_changed.notify_all();
    return item;
  }

  /** Nothing is taken any more; what is in it can still be had. Either side may say so, more than once. */
  void close() {
    const std::lock_guard lock(x_mutex);
    x_closed = true;
    x_changed.notify_all();
  }

 private:
  std::size_t x_most;
  std::mutex x_mutex;
  std::condition_variable x_changed;
  std::deque<T> x_items;
  bool x_closed = false;
};

}  // namespace raceloc
