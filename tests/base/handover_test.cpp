// The queue between two threads, with one that puts and one that takes.
#include "berth/base/handover.hpp"

#include <gtest/gtest.h>

#include <string>
#include <thread>

#include "../pch.hpp"

namespace berth {

TEST(Handover, IsBoundedAndKeepsTheOrder) {
  Handover<std::string> queue(4);
  for (int i = 0; i < 4; ++i) {
    std::string item(100, static_cast<char>('a' + i));
    EXPECT_TRUE(queue.put(item));
  }
  std::string more = "more";
  EXPECT_FALSE(queue.put(more));
  EXPECT_EQ(more, "more");
  EXPECT_EQ(queue.take(), std::string(100, 'a'));
  EXPECT_TRUE(queue.put(more));
  for (int i = 1; i < 4; ++i) EXPECT_EQ(queue.take(), std::string(100, static_cast<char>('a' + i)));
  EXPECT_EQ(queue.take(), "more");
  EXPECT_EQ(queue.take(), std::nullopt);
}

TEST(Handover, BetweenTwoThreadsNothingIsLost) {
  Handover<std::string> queue(8);
  constexpr int items = 20'000;
  std::thread producer([&] {
    for (int i = 0; i < items;) {
      std::string item = std::to_string(i);
      if (queue.put(item)) {
        ++i;
      } else {
        std::this_thread::yield();
      }
    }
  });
  for (int i = 0; i < items;) {
    const auto item = queue.take();
    if (!item) {
      std::this_thread::yield();
      continue;
    }
    ASSERT_EQ(*item, std::to_string(i));
    ++i;
  }
  producer.join();
}

}  // namespace berth
