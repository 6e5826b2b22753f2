// The LSS commands of CiA 309-3 by transcript, on simulated devices.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "gateway_309_rig.hpp"

namespace berth::serve {
namespace {

TEST(Gateway309Lss, SelectConfigureStoreOneDevice) {
  Rig309 rig({.blank = 2});
  rig.play(R"(
> [1] set network 1
< [1] OK
> [2] lss_ident_nonconf
< [2] OK
> [3] lss_identity 0x11 0x22 0 0xFFFFFFFF 0 0xFFFFFFFF
< [3] OK
> [4] lss_identity 0x12 0x22 0 0xFFFFFFFF 0 0xFFFFFFFF
< [4] ERROR:103
> [5] lss_switch_sel 0x11 0x22 0x33 0x102
< [5] OK
> [6] lss_get_node
< [6] 255
> [7] lss_inquire_addr
< [7] 0x00000011 0x00000022 0x00000033 0x00000102
> [8] lss_inquire_addr 3
< [8] 0x00000102
> [9] lss_inquire_addr 0x5A
< [9] 0x00000011
> [10] lss_set_node 5
< [10] ERROR:502
> [11] lss_set_node 127
< [11] ERROR:502
> [12] lss_set_node 20
< [12] OK
> [13] lss_conf_bitrate 0 5
< [13] ERROR:503
> [14] lss_conf_bitrate 1 2
< [14] ERROR:503
> [15] lss_conf_bitrate 0 2
< [15] OK
> [16] lss_store
< [16] OK
> [17] lss_switch_glob 0
< [17] OK
< 1 20 BOOT_UP
> [18] 20 r 0x1018 4 x32
< [18] 0x00000102
)");
  EXPECT_EQ(rig.world().find("blank1")->truth().persistent, NodeId(20));
  EXPECT_FALSE(rig.session().network("backbone")->services().turn.taken());
}

// A device without SDO, that is guarded.
class Guarded final : public can::Listener {
 public:
  Guarded(plant::World& world, NodeId id) : id_(id), port_(world.attach_master("backbone", {.name = "guarded"})) {
    port_->listen(this, all_frames);
  }
  void received(const can::Frame& f, rt::Time) noexcept override {
    if (f.remote && f.id == 0x700U + id_.value()) port_->send(*can::parse_frame(fmt::format("{:03X}#05", f.id)), 0);
  }
  void sent(std::uint32_t, rt::Time) noexcept override {}
  void changed(const can::Status&, rt::Time) noexcept override {}

 private:
  NodeId id_;
  std::unique_ptr<sim::Controller> port_;
};

TEST(Gateway309Lss, ANodeIdThatAnswersGuardingAloneIsTaken) {
  Rig309 rig({.blank = 1});
  Guarded guarded(rig.world(), NodeId(20));
  rig.play(R"(
> [1] 1 lss_switch_sel 0x11 0x22 0x33 0x101
< [1] OK
> [2] 1 lss_set_node 20
< [2] ERROR:502
> [3] 1 lss_set_node 21
< [3] OK
)");
  ASSERT_EQ(rig.told.size(), 1U);
  EXPECT_NE(rig.told.front().find("another device answers under this node-ID"), std::string::npos) << rig.told.front();
}

// Two devices of one LSS address in configuration state would both take the node-ID.
TEST(Gateway309Lss, OfTwoWithOneAddressNoneIsSelected) {
  Rig309 rig({.blank = 1, .clone = true});
  rig.play(R"(
> [1] 1 lss_switch_sel 0x11 0x22 0x33 0x101
< [1] ERROR:501
)");
  EXPECT_FALSE(rig.session().network("backbone")->services().turn.taken());
}

TEST(Gateway309Lss, NobodyAnswers) {
  Rig309 rig;
  rig.play(R"(
> [1] 1 lss_switch_sel 1 2 3 4
< [1] ERROR:103
> [2] 1 lss_ident_nonconf
< [2] ERROR:103
> [3] 1 lss_get_node
< [3] ERROR:103
> [4] 1 lss_store
< [4] ERROR:103
> [5] 1 _lss_fastscan 5
< [5] ERROR:103
> [6] 1 _lss_slowscan 1 2 0 0xFFFFFFFF 0 0xFFFFFFFF
< [6] ERROR:103
> [7] 1 lss_allnodes 5
< # Found 0 nodes, search finished.
< [7] OK
)");
}

TEST(Gateway309Lss, Scans) {
  Rig309 rig({.blank = 3});
  rig.play(R"(
> [1] set network 1
< [1] OK
> [2] _lss_fastscan 5
< [2] 0x00000011 0x00000022 0x00000033 0x00000101
> [3] lss_get_node
< [3] 255
> [4] lss_switch_glob 0
< [4] OK
> [5] _lss_slowscan 0x11 0x22 0 0xFFFFFFFF 0x102 0xFFFFFFFF
< [5] 0x00000011 0x00000022 0x00000033 0x00000102
> [6] lss_inquire_addr 3
< [6] 0x00000102
> [7] lss_switch_glob 0
< [7] OK
> [8] _lss_fastscan 5 0x11 0xFFFFFFFF 0x22 0xFFFFFFFF 0 0 0x103 0xFFFFFFFF
< [8] 0x00000011 0x00000022 0x00000033 0x00000103
> [9] lss_switch_glob 0
< [9] OK
> [10] _lss_fastscan 5 0x10 0xFFFFFFFF 0 0 0 0 0 0
< [10] ERROR:103
)");
  EXPECT_FALSE(rig.session().network("backbone")->services().turn.taken());
}

// Node-IDs that somebody has are passed over: the bench device has 5, heard by its boot-up.
TEST(Gateway309Lss, AllNodes) {
  Rig309 rig({.blank = 3});
  rig.play(R"(
> [1] 1 boot_up_indication Disable
< [1] OK
> [2] 1 lss_allnodes 5 4 1 0 0 0 0 0 0 0 0
< # Node-ID 4 assigned to: 0x00000011 0x00000022 0x00000033 0x00000101
< # Node-ID 6 assigned to: 0x00000011 0x00000022 0x00000033 0x00000102
< # Node-ID 7 assigned to: 0x00000011 0x00000022 0x00000033 0x00000103
< # Found 3 nodes, search finished.
< [2] OK
> [3] 1 6 r 0x1018 4 x32
< [3] 0x00000102
)");
  EXPECT_EQ(rig.world().find("blank2")->truth().persistent, NodeId(7));
  EXPECT_FALSE(rig.session().network("backbone")->services().turn.taken());
}

TEST(Gateway309Lss, AllNodesThatAreEqualToAValue) {
  Rig309 rig({.blank = 3});
  rig.play(R"(
> [1] 1 boot_up_indication Disable
< [1] OK
> [2] 1 lss_allnodes 5 30 0 0 0 0 0 0 0 2 0x102
< # Node-ID 30 assigned to: 0x00000011 0x00000022 0x00000033 0x00000102
< # Found 1 nodes, search finished.
< [2] OK
)");
  EXPECT_EQ(rig.world().find("blank1")->truth().persistent, NodeId());
}

// The device in configuration state and the main job's searches would be in each other's way.
TEST(Gateway309Lss, WhoHasSelectedKeepsTheTurnUntilHeIsDone) {
  Rig309 rig({.blank = 1});
  auto& turn = rig.session().network("backbone")->services().turn;
  rig.play("> [1] 1 lss_switch_sel 0x11 0x22 0x33 0x101\n< [1] OK\n");
  EXPECT_TRUE(turn.taken());
  std::string other;
  cia309::Conversation second(
      rig.house(), [&](std::string_view text) { other += text; }, [] {});
  second.take("[1] 1 lss_get_node");
  ASSERT_TRUE(rig.run_until([&] { return second.idle(); }));
  EXPECT_EQ(other, "[1] ERROR:102\r\n");
  rig.play("> [2] 1 lss_get_node\n< [2] 255\n");
  rig.run_for(cia309::Conversation::lss_patience - 1s);
  EXPECT_TRUE(turn.taken());
  rig.heard().frames.clear();
  rig.run_for(2s);
  EXPECT_FALSE(turn.taken());
  EXPECT_EQ(rig.heard().frames, (std::vector<std::string>{"7E5#0400000000000000"}));
}

TEST(Gateway309Lss, WhoLeavesLetsTheDevicesWaitAgain) {
  Rig309 rig({.blank = 1});
  rig.play("> [1] 1 lss_switch_glob 1\n< [1] OK\n");
  rig.heard().frames.clear();
  rig.talk.reset();
  EXPECT_FALSE(rig.session().network("backbone")->services().turn.taken());
  rig.run_for(10ms);
  EXPECT_EQ(rig.heard().frames, (std::vector<std::string>{"7E5#0400000000000000"}));
}

TEST(Gateway309Lss, WhoLeavesInMidScan) {
  Rig309 rig({.blank = 2});
  rig.talk->take("[1] 1 _lss_fastscan 5");
  ASSERT_TRUE(rig.run_until([&] { return rig.heard().frames.size() > 40; }));
  rig.talk.reset();
  rig.run_for(100ms);
  EXPECT_FALSE(rig.session().network("backbone")->services().turn.taken());
  EXPECT_EQ(rig.heard().frames.back(), "7E5#0400000000000000");
}

TEST(Gateway309Lss, WhoseCommandTakesTooLong) {
  Rig309 rig({.blank = 1});
  rig.play("> [1] set command_timeout 200\n< [1] OK\n> [2] 1 _lss_fastscan 50\n< [2] ERROR:103\n");
  rig.play("> [3] 1 lss_switch_glob 0\n< [3] OK\n");
  EXPECT_FALSE(rig.session().network("backbone")->services().turn.taken());
}

TEST(Gateway309Lss, BitRateOfOneDeviceAlone) {
  Rig309 rig({.bench = false, .blank = 1});
  rig.play(R"(
> [1] set network 1
< [1] OK
> [2] lss_switch_glob 1
< [2] OK
> [3] lss_conf_bitrate 0 4
< [3] OK
> [4] lss_activate_bitrate 100
< [4] OK
)");
  rig.run_for(1s);
  EXPECT_EQ(rig.world().find("blank0")->truth().bit_rate, 125'000U);
}

}  // namespace
}  // namespace berth::serve
