// A gateway's conversation that is destroyed after any frame, and a bus that is flooded: nothing is left behind, and
// memory has a plateau.
#include <gtest/gtest.h>
#include <malloc.h>
#include <cstdint>

#include "gateway_309_rig.hpp"

// There when the address sanitizer is; then the C library's own figures are not.
extern "C" std::size_t __sanitizer_get_current_allocated_bytes() __attribute__((weak));

namespace berth::serve {
namespace {

std::size_t allocated() {
  if (__sanitizer_get_current_allocated_bytes != nullptr) return __sanitizer_get_current_allocated_bytes();
  return ::mallinfo2().uordblks;
}

// Every wait of every operation: the coroutine goes while a frame of it is the newest on the bus.
TEST(Destroyed, AfterEachFrameOfEachCommand) {
  const char* const commands[] = {
      "[1] 1 5 r 0x2100 0",
      "[1] 1 5 w 0x2100 0 d QUJDREVGR0hJSktMTU5PUFFSU1RVVldYWVpBQkNERUZHSElKS0xNTk9QUVJTVFVWV1hZWg==",
      "[1] 1 5 w 0x1017 0 u16 0",
      "[1] 1 0 preop",
      "[1] 1 lss_switch_sel 0x11 0x22 0x33 0x101",
      "[1] 1 _lss_fastscan 20",
      "[1] 1 _lss_slowscan 0x11 0x22 0 0xFF 0 0xFFFF",
      "[1] 1 lss_allnodes 20 10 0",
      "[1] 1 lss_inquire_addr",
      "[1] 1 lss_ident_nonconf",
  };
  for (const bool block : {false, true}) {
    for (const char* const command : commands) {
      bool whole = false;
      for (std::size_t frames = 0; !whole && frames < 1000; frames += frames < 24 ? 1 : 7) {
        Rig309 rig({.blank = 2});
        if (block) rig.play("> [0] 1 set sdo_block 1\n< [0] OK\n");
        rig.heard().frames.clear();
        rig.talk->take(command);
        const bool reached = rig.run_until([&] { return rig.heard().frames.size() > frames || rig.talk->idle(); });
        ASSERT_TRUE(reached) << command;
        whole = rig.talk->idle();
        rig.talk.reset();
        rig.begin();
        rig.run_for(6s);
        rig.said.clear();  // devices that booted meanwhile
        EXPECT_FALSE(rig.session().network("backbone")->services().turn.taken())
            << command << " after frame " << frames;
        rig.play("> [2] 1 5 r 0x1000 0 u32\n< [2] 74565\n");
        if (::testing::Test::HasFailure()) return;
      }
      EXPECT_TRUE(whole) << command << " never ended";
    }
  }
}

// What a bus can bring without end: emergencies, boot-ups, SYNCs, answers that nobody asked for, LSS and RAND replies.
TEST(Flooded, MemoryHasAPlateau) {
  Rig309 rig;
  rig.session().start();
  Random random(12);
  const auto flood = [&](unsigned frames) {
    for (unsigned i = 0; i < frames; ++i) {
      const auto node = static_cast<std::uint16_t>(1 + random.below(127));
      std::array<std::uint8_t, 8> bytes{};
      for (auto& b : bytes) b = static_cast<std::uint8_t>(random.next());
      can::Frame frame;
      switch (random.below(6)) {
        case 0: frame = can::Frame::base(static_cast<std::uint16_t>(0x080 + node), bytes); break;
        case 1: frame = can::Frame::base(static_cast<std::uint16_t>(0x700 + node), {0}); break;
        case 2: frame = can::Frame::base(static_cast<std::uint16_t>(0x580 + node), bytes); break;
        case 3: frame = can::Frame::base(0x7E4, bytes); break;
        case 4: frame = can::Frame::ext(0x7E4U << 18U | static_cast<std::uint32_t>(random.below(1U << 18U)), {}); break;
        default: frame = can::Frame::base(0x080, {}); break;
      }
      rig.peer().send(frame, 0);
      rig.run_for(1ms);
      rig.said.clear();
      rig.told.clear();
      rig.heard().frames.clear();
      rig.heard(2).frames.clear();
    }
  };
  // The newest 10,000 events of a session are kept: so many come first.
  flood(30'000);
  const auto before = allocated();
  flood(30'000);
  const auto after = allocated();
  EXPECT_LT(after, before + (std::size_t{256} << 10U)) << "before " << before << ", after " << after;
  EXPECT_LT(after, std::size_t{64} << 20U);
}

}  // namespace
}  // namespace berth::serve
