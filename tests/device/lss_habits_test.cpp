// Devices that do LSS as known stacks do it, seen from the bus (docs/plant-file.md, `habits`). What each does was read
// in the stack's source and, as far as the row says it, seen on SocketCAN.
#include "berth/device/lss_habits.hpp"

#include <gtest/gtest.h>
#include <cstdint>
#include <string>

#include <algorithm>

#include "rig.hpp"

namespace berth::device::test {
namespace {

constexpr LssAddress own = address_of(0x0A);
constexpr const char* waiting = "7E5#0400000000000000";
constexpr const char* configuration = "7E5#0401000000000000";
constexpr const char* scan_reset = "7E5#5100000000800000";
constexpr const char* found = "7E4#4F00000000000000";
constexpr const char* selected = "7E4#4400000000000000";

struct OneDevice : Rig {
  explicit OneDevice(LssHabit habit, NodeId id = NodeId()) : node(world, bus, options(habit, id)) {
    node.on();
    run(milliseconds(100));
    record.clear();
  }
  static Options options(LssHabit habit, NodeId id) {
    Options o;
    o.address = own;
    o.node_id = id;
    o.rand = RandMode::off;
    o.lss.habit = habit;
    o.lss.habit_seed = 5;
    return o;
  }
  // Longer than its main loop is ever busy.
  std::size_t answers_to(const std::string& request) {
    record.clear();
    ask(request, milliseconds(50));
    return record.text.size() - 1;
  }
  bool gets(const std::string& request, std::string_view answer) {
    return answers_to(request) == 1 && record.count(answer) == 1;
  }
  static std::string with(unsigned command, std::uint32_t value) {
    return "7E5#" + hex8(command) + le32(value) + "000000";
  }
  static std::string scan(std::uint32_t value, unsigned bit, unsigned sub, unsigned next) {
    return "7E5#51" + le32(value) + hex8(bit) + hex8(sub) + hex8(next);
  }
  // 46h to 4Bh with its own address; how many frames it answered with.
  std::size_t identify() {
    const std::array<std::uint32_t, 6> values{own.vendor,   own.product, own.revision,
                                              own.revision, own.serial,  own.serial};
    std::size_t answers = 0;
    for (unsigned i = 0; i < values.size(); ++i) answers += answers_to(with(0x46 + i, values.at(i)));
    return answers;
  }
  [[nodiscard]] bool configures() const { return node.device.lss().state() == lss::State::configuration; }

  Node node;
};

TEST(LikeCanOpenNode, InConfigurationItAnswersEveryFastscanAndEverySerialNumber) {
  OneDevice d(LssHabit::canopennode);
  EXPECT_EQ(d.answers_to(configuration), 0U);
  ASSERT_TRUE(d.configures());
  EXPECT_TRUE(d.gets(OneDevice::scan(0x12345678, 3, 1, 1), found)) << "not its product";
  EXPECT_TRUE(d.gets(OneDevice::scan(0, 99, 9, 9), found)) << "no Fastscan at all";
  EXPECT_TRUE(d.gets(OneDevice::with(0x43, 0x77777777), selected)) << "not its serial number";
  EXPECT_EQ(d.answers_to(OneDevice::with(0x40, own.vendor)), 0U);
  EXPECT_EQ(d.answers_to(OneDevice::with(0x42, own.revision)), 0U);
  d.ask(waiting, milliseconds(50));
  EXPECT_FALSE(d.configures());
  EXPECT_EQ(d.answers_to(OneDevice::with(0x43, 0x77777777)), 0U);
  EXPECT_TRUE(d.gets(scan_reset, found));
  EXPECT_EQ(d.answers_to(OneDevice::scan(0x12345678, 3, 0, 0)), 0U);
}

TEST(LikeCanOpenNode, ItIsNeverIdentified) {
  OneDevice d(LssHabit::canopennode);
  EXPECT_EQ(d.identify(), 0U);
  EXPECT_EQ(d.answers_to("7E5#4C00000000000000"), 0U);
  d.ask(configuration, milliseconds(50));
  EXPECT_EQ(d.identify(), 0U);
  EXPECT_EQ(d.answers_to("7E5#4C00000000000000"), 0U);
}

// HC3.1: "LSSnext < LSSsub" where the serial number should be required.
TEST(LikeCanOpenNode, HC3_1_AScanOfFewerPartsEndsInConfiguration) {
  OneDevice d(LssHabit::canopennode);
  ASSERT_TRUE(d.gets(scan_reset, found));
  ASSERT_TRUE(d.gets(OneDevice::scan(own.vendor, 0, 0, 1), found));
  EXPECT_FALSE(d.configures());
  EXPECT_EQ(d.answers_to(OneDevice::scan(own.product, 0, 1, 4)), 0U) << "a next part above 3 is refused";
  ASSERT_TRUE(d.gets(OneDevice::scan(own.product, 0, 1, 0), found));
  EXPECT_TRUE(d.configures());
}

TEST(LikeCanOpenNode, ItIsSelectedInAnyOrderAndByTheLastFrameAlone) {
  OneDevice d(LssHabit::canopennode);
  d.ask(OneDevice::with(0x42, own.revision), milliseconds(50));
  d.ask(OneDevice::with(0x40, own.vendor), milliseconds(50));
  d.ask(OneDevice::with(0x41, own.product), milliseconds(50));
  EXPECT_EQ(d.answers_to(OneDevice::with(0x43, own.serial + 1)), 0U);
  EXPECT_TRUE(d.gets(OneDevice::with(0x43, own.serial), selected));
  EXPECT_TRUE(d.configures());
  d.ask(waiting, milliseconds(50));
  EXPECT_EQ(d.answers_to(OneDevice::with(0x43, own.serial)), 0U) << "04 00 made it forget the other parts";
}

TEST(LikeCanOpenNode, UntilItsMainLoopAnsweredItHearsNothing) {
  OneDevice d(LssHabit::canopennode);
  d.ask(configuration, milliseconds(50));
  d.record.clear();
  d.send("7E5#5A00000000000000");
  d.send(waiting);
  d.run(milliseconds(50));
  EXPECT_EQ(d.record.count("7E4#5A01000001000000"), 1U);
  // Two requests of 0.25 ms each, and a main loop that takes up to 1 ms: now and then the second is lost.
  unsigned lost = 0;
  for (int i = 0; i < 100; ++i) {
    d.ask(configuration, milliseconds(50));
    d.send("7E5#5A00000000000000");
    d.send(waiting);
    d.run(milliseconds(50));
    if (d.configures()) ++lost;
  }
  EXPECT_GT(lost, 20U);
  EXPECT_LT(lost, 100U);
}

TEST(LikeCanOpenNode, NowAndThenItIsTensOfMillisecondsLate) {
  OneDevice d(LssHabit::canopennode);
  unsigned late = 0;
  constexpr unsigned times = 1000;
  for (unsigned i = 0; i < times; ++i) {
    d.record.clear();
    d.ask(scan_reset, milliseconds(60));
    ASSERT_EQ(d.record.text.size(), 2U);
    const auto after = d.record.times.at(1) - d.record.times.at(0);
    if (after > milliseconds(10)) ++late;
    EXPECT_LT(after, milliseconds(42));
  }
  EXPECT_GT(late, 5U);
  EXPECT_LT(late, 50U);
}

TEST(LikeCanOpenNode, ItGetsItsNodeIdAsEveryOther) {
  OneDevice d(LssHabit::canopennode);
  d.ask(configuration, milliseconds(50));
  EXPECT_TRUE(d.gets("7E5#1109000000000000", "7E4#1100000000000000"));
  EXPECT_TRUE(d.gets("7E5#5E00000000000000", "7E4#5EFF000000000000")) << "tells the node-ID in use";
  EXPECT_TRUE(d.gets("7E5#1700000000000000", "7E4#1700000000000000"));
  d.record.clear();
  d.ask(waiting, milliseconds(200));
  EXPECT_EQ(d.record.count("709#00"), 1U);
  EXPECT_EQ(d.answers_to(scan_reset), 0U) << "a device with a node-ID takes no part";
}

TEST(LikeLely, ADeviceWithANodeIdTakesPartInFastscan) {
  OneDevice d(LssHabit::lely, NodeId(9));
  ASSERT_EQ(d.node.device.node_id(), NodeId(9));
  EXPECT_TRUE(d.gets(scan_reset, found));
  EXPECT_TRUE(d.gets(OneDevice::scan(own.vendor, 0, 0, 1), found));
  EXPECT_TRUE(d.gets(OneDevice::scan(own.product, 0, 1, 2), found));
  EXPECT_TRUE(d.gets(OneDevice::scan(own.revision, 0, 2, 3), found));
  EXPECT_FALSE(d.configures());
  EXPECT_TRUE(d.gets(OneDevice::scan(own.serial, 0, 3, 0), found));
  EXPECT_TRUE(d.configures());
}

// CiA 305's state table: switch selective and Fastscan are services of LSS waiting.
TEST(LikeLely, InConfigurationItIsNeitherSelectedNorScanned) {
  OneDevice d(LssHabit::lely);
  d.ask(configuration);
  ASSERT_TRUE(d.configures());
  for (unsigned i = 0; i < 4; ++i) EXPECT_EQ(d.answers_to(OneDevice::with(0x40 + i, own.part(i))), 0U);
  EXPECT_EQ(d.answers_to(scan_reset), 0U);
  EXPECT_TRUE(d.gets("7E5#4C00000000000000", "7E4#5000000000000000"));
  EXPECT_EQ(d.identify(), 1U);
  d.ask(waiting);
  EXPECT_TRUE(d.gets(scan_reset, found));
}

TEST(LikeLely, WithItsFirstNodeIdItWaitsForNmt) {
  OneDevice d(LssHabit::lely);
  d.ask(configuration);
  EXPECT_TRUE(d.gets("7E5#1109000000000000", "7E4#1100000000000000"));
  d.record.clear();
  d.ask(waiting, milliseconds(200));
  d.ask("000#8209", milliseconds(200));
  EXPECT_EQ(d.record.count("709#00"), 0U);
  d.ask("000#82FF", milliseconds(200));
  EXPECT_EQ(d.record.count("709#00"), 1U);
  EXPECT_EQ(d.node.device.node_id(), NodeId(9));
  d.record.clear();
  d.ask("000#82FF", milliseconds(200));
  EXPECT_EQ(d.record.count("709#00"), 0U) << "255 is its node-ID no more";
}

// HC3.1
TEST(LikeLely, HC3_1_AScanOfFewerPartsEndsInConfiguration) {
  OneDevice d(LssHabit::lely);
  ASSERT_TRUE(d.gets(scan_reset, found));
  ASSERT_TRUE(d.gets(OneDevice::scan(own.vendor, 0, 0, 1), found));
  ASSERT_TRUE(d.gets(OneDevice::scan(own.product, 0, 1, 0), found));
  EXPECT_TRUE(d.configures());
}

}  // namespace
}  // namespace berth::device::test
