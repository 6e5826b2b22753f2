// What a SocketCAN port decides apart from its sockets: echoes, the filter, the status. The port itself is tried in the
// virtual machine (tests/vm).
#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "berth/io/controller_status.hpp"
#include "berth/io/echo_filter.hpp"
#include "berth/io/written_frames.hpp"

namespace berth::io {
namespace {

can::Frame with_id(std::uint32_t id) { return can::Frame::base(id, {1}); }

std::vector<std::uint32_t> told(WrittenFrames& written, const can::Frame& frame, std::uint32_t lost = 0) {
  std::vector<std::uint32_t> tags;
  written.echoed(frame, lost, [&](std::uint32_t tag) { tags.push_back(tag); });
  return tags;
}

using Tags = std::vector<std::uint32_t>;

TEST(WrittenFrames, AnEchoTellsItsOwnFrameOnly) {
  WrittenFrames written(8);
  written.add(with_id(0x100), 1);
  written.add(with_id(0x200), 2);
  written.add(with_id(0x300), 0);
  EXPECT_EQ(told(written, with_id(0x200)), Tags{2}) << "the controller sends by priority";
  EXPECT_EQ(told(written, with_id(0x300)), Tags{}) << "without a tag nothing is told";
  EXPECT_EQ(told(written, with_id(0x100)), Tags{1});
  EXPECT_EQ(told(written, with_id(0x100)), Tags{}) << "once";
}

TEST(WrittenFrames, BehindALossTheOnesBeforeWereSentToo) {
  WrittenFrames written(8);
  for (std::uint32_t tag = 1; tag <= 3; ++tag) written.add(with_id(0x100 + tag), tag);
  EXPECT_EQ(told(written, with_id(0x102), 5), (Tags{1, 2}));
  written.add(with_id(0x104), 4);
  EXPECT_EQ(told(written, with_id(0x104), 5), Tags{4}) << "no further loss: frame 3 is only passed over";
  EXPECT_EQ(written.size(), 1U);
}

TEST(WrittenFrames, OneThatIsPassedTooOftenIsGivenUp) {
  WrittenFrames written(100);
  written.add(with_id(0x700), 9);
  for (unsigned i = 0; i < WrittenFrames::most_passed; ++i) {
    EXPECT_EQ(written.size(), 1U);
    written.add(with_id(0x100), 1);
    static_cast<void>(told(written, with_id(0x100)));
  }
  EXPECT_EQ(written.size(), 0U);
}

TEST(WrittenFrames, WithdrawnOnesAndTheOldestOfTooManyAreNotTold) {
  WrittenFrames written(2);
  written.add(with_id(0x101), 1);
  written.add(with_id(0x102), 2);
  written.add(with_id(0x103), 3);
  written.withdraw(3);
  EXPECT_EQ(told(written, with_id(0x101)), Tags{});
  EXPECT_EQ(told(written, with_id(0x103)), Tags{});
  EXPECT_EQ(told(written, with_id(0x102)), Tags{2});
}

TEST(EchoFilter, AnEchoIsAskedForOnce) {
  EchoFilter filter;
  const std::array accept{can::IdRange{0x580, 0x5FF}};
  static_cast<void>(filter.install(accept));
  EXPECT_TRUE(filter.covers(accept));
  EXPECT_FALSE(filter.passes(0x601));
  EXPECT_TRUE(filter.expect(0x601));
  static_cast<void>(filter.install(accept));
  EXPECT_TRUE(filter.passes(0x601));
  EXPECT_FALSE(filter.expect(0x601));
  EXPECT_FALSE(filter.expect(0x585)) << "it passes anyway";
}

TEST(EchoFilter, OfTooManyIdentifiersEveryEchoIsRead) {
  EchoFilter filter;
  for (std::uint32_t key = 0; key <= EchoFilter::most_echoed; ++key) {
    ASSERT_TRUE(filter.expect(2 * key));
    static_cast<void>(filter.install({}));
  }
  EXPECT_TRUE(filter.passes(0x7FF));
  EXPECT_TRUE(filter.passes(can::extended_flag | 5U));
}

TEST(EchoFilter, ManyUnwantedFramesNarrowIt) {
  EchoFilter filter;
  const std::array accept{can::only(0x100)};
  for (std::uint32_t i = 1; i < EchoFilter::much_unwanted; ++i) ASSERT_FALSE(filter.much(0x101, accept));
  EXPECT_FALSE(filter.much(0x100, accept)) << "this one is wanted";
  EXPECT_TRUE(filter.much(0x101, accept));
  static_cast<void>(filter.install(accept));
  EXPECT_FALSE(filter.much(0x101, accept)) << "counted anew";
}

Link controller() { return {.index = 3, .name = "can0", .kind = "can", .can = true, .up = true, .running = true}; }

TEST(ControllerStatus, ListenersAreToldOfLevelsAndNotOfCounts) {
  ControllerStatus status(0);
  Link link = controller();
  link.bit_rate = 250'000;
  link.state = CanState::active;
  EXPECT_TRUE(status.learn(link, {}, true));
  EXPECT_TRUE(status.now().up);
  EXPECT_FALSE(status.learn(link, {}, true));
  link.counts = true;
  link.tec = 90;
  EXPECT_FALSE(status.learn(link, {}, true)) << "below the warning limit";
  link.tec = 96;
  EXPECT_TRUE(status.learn(link, {}, true));
  EXPECT_EQ(status.frame_time(), std::chrono::microseconds(520)) << "130 bits";
}

TEST(ControllerStatus, ThePassiveStateOfAKernelThatDoesNotCountIsShown) {
  ControllerStatus status(0);
  Link link = controller();
  link.state = CanState::passive;
  EXPECT_TRUE(status.learn(link, {}, true));
  EXPECT_EQ(status.now().tec, 128);
  link.state = CanState::active;
  EXPECT_TRUE(status.learn(link, {}, true));
  EXPECT_EQ(status.now().tec, 0);
}

TEST(ControllerStatus, BusOffIsUpAndARestartClearsTheCounters) {
  ControllerStatus status(0);
  Link link = controller();
  EXPECT_TRUE(status.learn(link, {}, true));
  EXPECT_TRUE(status.learn(BusReport{.error = true, .bus_off = true, .counts = true, .tec = 255}));
  EXPECT_TRUE(status.now().bus_off);
  EXPECT_EQ(status.now().errors, 1U);
  link.running = false;
  link.state = CanState::bus_off;
  EXPECT_FALSE(status.learn(link, {}, true)) << "a controller that is bus-off does not run, and is up";
  EXPECT_TRUE(status.now().up);
  EXPECT_TRUE(status.learn(BusReport{.restarted = true}));
  EXPECT_EQ(status.now().tec, 0);
  EXPECT_FALSE(status.learn(BusReport{.overflow = true}));
  EXPECT_EQ(status.overflows(), 1U);
}

TEST(ControllerStatus, AVirtualInterfaceThatIsUpIsNotLookedAt) {
  ControllerStatus status(500'000);
  Link link = controller();
  link.kind = "vcan";
  EXPECT_TRUE(status.unseen(link)) << "it is not up yet";
  EXPECT_TRUE(status.learn(link, {.bit_rate = 125'000}, true));
  EXPECT_TRUE(status.now().bit_rate_is_label);
  EXPECT_EQ(status.now().bit_rate, 125'000U);
  EXPECT_FALSE(status.unseen(link));
  EXPECT_TRUE(status.unseen(controller())) << "a controller's counters are not told";
}

}  // namespace
}  // namespace berth::io
