// A node that is taken off in the middle of its frame and another that comes at the same instant: a process that is
// ended and begun again. The bus must go on.
#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>

#include "berth/can/dispatcher.hpp"
#include "berth/sim/world.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace replaced_tests {
namespace {

struct Ear final : can::Listener {
  int heard = 0;
  void received(const can::Frame&, rt::Time) noexcept override { ++heard; }
  void sent(std::uint32_t, rt::Time) noexcept override {}
  void changed(const can::Status&, rt::Time) noexcept override {}
};

}  // namespace

TEST(SimReplaced, ABusSurvivesASenderReplacedAtAnyBitAndOffset) {
  for (const bool perturbed : {false, true}) {
    for (int eighth = 0; eighth < 8 * 150; ++eighth) {
      sim::World world(1);
      if (perturbed) world.executor().perturb(static_cast<std::uint64_t>(eighth) + 1);
      sim::Bus& bus = world.add_bus("b", 500'000);
      auto first = bus.attach({.name = "first"});
      auto second = bus.attach({.name = "second"});
      Ear ear;
      const can::IdRange all[] = {can::all_base, can::all_extended};
      second->listen(&ear, all);
      world.run_for(1ms);
      first->send(can::Frame::ext(0x1F940000, {0x80, 5, 0, 0}), 1);
      world.run_for(rt::Duration(2us) * eighth / 8);
      first.reset();
      auto third = bus.attach({.name = "third"});
      const int before = ear.heard;
      third->send(can::Frame::base(0x77F, {0}), 1);
      third->send(can::Frame::base(0x7E5, {4, 0, 0, 0, 0, 0, 0, 0}), 2);
      world.run_for(20ms);
      ASSERT_GE(ear.heard - before, 2) << "destroyed " << eighth << "/8 bits after sending, perturbed " << perturbed;
      second.reset();
    }
  }
}

}  // namespace replaced_tests
