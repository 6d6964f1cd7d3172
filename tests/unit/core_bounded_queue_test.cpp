#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <thread>
#include <vector>

#include "core/bounded_queue.h"

namespace raceloc {
namespace {

TEST(BoundedQueue, HandsOverEverythingInOrder) {
  for (const std::size_t most : {1, 3, 100}) {
    BoundedQueue<int> queue(most);
    constexpr int kItems = 20'000;
    std::thread producer([&] {
      for (int i = 0; i < kItems; ++i) queue.push(i);
      queue.close();
    });
    std::vector<int> got;
    while (const auto item = queue.pop()) got.push_back(*item);
    producer.join();
    ASSERT_EQ(got.size(), static_cast<std::size_t>(kItems));
    for (int i = 0; i < kItems; ++i) ASSERT_EQ(got[static_cast<std::size_t>(i)], i);
  }
}

TEST(BoundedQueue, TheProducerWaitsForRoom) {
  BoundedQueue<std::shared_ptr<int>> queue(2);
  const auto item = std::make_shared<int>(7);
  std::thread producer([&] {
    for (int i = 0; i < 1000; ++i) queue.push(item);
    queue.close();
  });
  long most = 0;
  while (const auto got = queue.pop()) most = std::max(most, item.use_count());
  producer.join();
  EXPECT_LE(most, 1 + 2 + 2);  // the test's own, what waits, and one at each end on its way
}

TEST(BoundedQueue, AfterTheConsumerLeftPushTellsSo) {
  BoundedQueue<int> queue(1);
  EXPECT_TRUE(queue.push(1));
  std::thread consumer([&] { queue.close(); });
  while (queue.push(2)) {
  }
  consumer.join();
  EXPECT_FALSE(queue.push(3));
  EXPECT_EQ(queue.pop(), 1);
  EXPECT_EQ(queue.pop(), std::nullopt);
}

TEST(BoundedQueue, PushedOverItDropsTheFirstThatIsExpendable) {
  const auto isOdd = [](int item) { return item % 2 == 1; };
  BoundedQueue<int> queue(3);
  for (const int item : {2, 3, 5}) EXPECT_EQ(queue.pushOver(item, isOdd), std::nullopt);
  EXPECT_EQ(queue.pushOver(6, isOdd), 3);
  EXPECT_EQ(queue.pushOver(8, isOdd), 5);
  EXPECT_EQ(queue.pushOver(9, isOdd), 2);  // none is: the first of all
  queue.close();
  EXPECT_EQ(queue.pushOver(10, isOdd), 10);
  EXPECT_FALSE(queue.isAtEnd());
  for (const int item : {6, 8, 9}) EXPECT_EQ(queue.pop(), item);
  EXPECT_TRUE(queue.isAtEnd());
}

TEST(BoundedQueue, WaitsNoLongerThanItIsTold) {
  BoundedQueue<int> queue(1);
  EXPECT_EQ(queue.popWithin(std::chrono::milliseconds(1)), std::nullopt);
  std::thread producer([&] { queue.push(7); });
  EXPECT_EQ(queue.popWithin(std::chrono::milliseconds(60'000)), 7);
  producer.join();
}

TEST(BoundedQueue, ClosedItWakesWhoWaits) {
  BoundedQueue<int> queue(1);
  std::thread consumer([&] { EXPECT_EQ(queue.pop(), std::nullopt); });
  queue.close();
  consumer.join();
}

}  // namespace
}  // namespace raceloc
