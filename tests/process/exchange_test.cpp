// Either side of an exchange may begin anew, as after its process was killed: whose which buffer is stands in the
// memory.
#include "berth/process/exchange.hpp"

#include <gtest/gtest.h>

#include <new>
#include <optional>
#include <vector>

#include "../pch.hpp"

namespace berth::process {
namespace {

struct Memory {
  Memory() { new (begin()) Owners::Word(Owners::initial); }
  std::uint8_t* begin() { return reinterpret_cast<std::uint8_t*>(words.data()); }
  BlockLayout layout{.size = 4, .runs = {{0, 4}}};
  std::vector<std::uint64_t> words = std::vector<std::uint64_t>((BlockLayout{.size = 4, .runs = {}}.memory()) / 8);
};

void give(Giver& giver, std::uint8_t value) {
  giver.work()[0] = value;
  giver.give();
}

// In each of the orders in which the three buffers can lie.
TEST(Exchange, ASideThatBeginsAnewGoesOnWithItsOwnBuffer) {
  for (int takes = 1; takes <= 6; ++takes) {
    for (int gives = 1; gives <= 3; ++gives) {
      Memory memory;
      std::optional<Giver> giver(std::in_place, memory.begin(), memory.layout);
      std::optional<Taker> taker(std::in_place, memory.begin(), memory.layout);
      std::uint8_t value = 0;
      for (int i = 0; i < takes; ++i) {
        for (int k = 0; k < gives; ++k) give(*giver, ++value);
        ASSERT_TRUE(taker->take());
        ASSERT_EQ(taker->taken()[0], value);
      }
      const auto held = value;
      taker.emplace(memory.begin(), memory.layout);
      EXPECT_EQ(taker->taken()[0], held);
      giver.emplace(memory.begin(), memory.layout);
      for (int k = 0; k < 4; ++k) {
        give(*giver, ++value);
        ASSERT_EQ(taker->taken()[0], held) << "it is written while it is read";
      }
      EXPECT_TRUE(taker->take());
      EXPECT_EQ(taker->taken()[0], value);
      EXPECT_FALSE(taker->take());
    }
  }
}

}  // namespace
}  // namespace berth::process
