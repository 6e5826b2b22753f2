// CiA 309-3 by transcript: what is said, and every line that is answered, by hand from the command table and the values
// that the devices are made with.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/base/base64.hpp"
#include "gateway_309_rig.hpp"

namespace berth::serve {
namespace {

TEST(Gateway309, WhereThereIsOneNetNoneNeedBeNamed) {
  Rig309 rig({.one_net = true});
  rig.play(R"(
> [1] 5 r 0x1000 0 x32
< [1] 0x00012345
> [2] 5 preop
< [2] OK
> [3] lss_switch_glob 0
< [3] OK
> [4] 2 5 r 0x1000 0 x32
< [4] ERROR:106
)");
  Rig309 two;
  two.play("> [1] 5 r 0x1000 0 x32\n< [1] ERROR:104\n");
}

TEST(Gateway309, DefaultsAndWhatIsNotThere) {
  Rig309 rig;
  rig.play(R"(
> [1] 5 read 0x1000 0 u32
< [1] ERROR:104
> [2] set network 3
< [2] ERROR:106
> [3] set network 1
< [3] OK
> [4] read 0x1000 0 u32
< [4] ERROR:105
> [5] set node 5
< [5] OK
> [6] read 0x1000 0 u32
< [6] 74565
> [7] 1 5 r 0x1000 0 x32
< [7] 0x00012345
> [8] 2 5 read 0x1000 0 u32
< [8] ERROR:0x05040000
> [9] 3 5 read 0x1000 0 u32
< [9] ERROR:106
> [10] 0 read 0x1000 0 u32
< [10] ERROR:107
> [11] 127 read 0x1000 0 u32
< [11] ERROR:107
> [12] 128 read 0x1000 0 u32
< [12] ERROR:107
> [13] frobnicate
< [13] ERROR:100
> [14] read
< [14] ERROR:101
> no sequence
< [0] ERROR:101
> # a comment, and a blank line

> [15] info version
< [15] 0 0 0.0 0 2 3.0 1.0
)");
}

TEST(Gateway309, ReadsAndWritesEveryType) {
  Rig309 rig;
  const std::pair<const char*, const char*> values[] = {
      {"b", "1"},
      {"i8", "-128"},
      {"i16", "-32768"},
      {"i24", "-8388608"},
      {"i32", "-2147483648"},
      {"i40", "-549755813888"},
      {"i48", "140737488355327"},
      {"i56", "-36028797018963968"},
      {"i64", "-9223372036854775808"},
      {"u8", "255"},
      {"u16", "65535"},
      {"u24", "16777215"},
      {"u32", "4294967295"},
      {"u40", "1099511627775"},
      {"u48", "281474976710655"},
      {"u56", "72057594037927935"},
      {"u64", "18446744073709551615"},
      {"x16", "0x0A0B"},
      {"r32", "0.1"},
      {"r64", "-2.5e-07"},
      {"t", "15000 86399999"},
      {"td", "0 1"},
      {"vs", R"("Say ""hi"" # now")"},
      {"os", "AP8QIA=="},
      {"us", "SABpAA=="},
      {"d", "AAECAwQFBgcICQoLDA0ODw=="},
      {"hex", "DE AD BE EF 01"},
  };
  unsigned n = 0;
  for (const bool block : {false, true}) {
    rig.play(fmt::format("> [1] 1 set sdo_block {}\n< [1] OK\n", block ? 1 : 0));
    for (const auto& [name, value] : values) {
      const auto type = *cia309::type_named(name);
      const auto object = type.shown == cia309::Type::Shown::hex_bytes ? od::DataType::octet_string : type.type;
      const unsigned sub = sub_of(object);
      ASSERT_NE(sub, 0U) << name;
      rig.play(
          fmt::format("> [{0}] 1 5 write 0x2000 {1} {2} {3}\n< [{0}] OK\n"
                      "> [{4}] 1 5 read 0x2000 {1} {2}\n< [{4}] {3}\n",
                      n, sub, name, value, n + 1));
      n += 2;
    }
  }
}

TEST(Gateway309, AbortCodesAndTimeouts) {
  Rig309 rig;
  rig.play(R"(
> [1] 1 5 r 0x5000 0 u8
< [1] ERROR:0x06020000
> [2] 1 5 r 0x1000 1 u8
< [2] ERROR:0x06090011
> [3] 1 5 w 0x1000 0 u32 1
< [3] ERROR:0x06010002
> [4] 1 5 r 0x2101 0
< [4] ERROR:0x06010001
> [5] 1 5 r 0x1000 0 u8
< [5] ERROR:0x06070010
> [6] 1 5 w 0x1017 0 u32 1
< [6] ERROR:0x06070012
> [7] 1 6 r 0x1000 0
< [7] ERROR:0x05040000
> [8] 1 5 r 0x1000 0
< [8] 45 23 01 00
)");
  const auto before = rig.world().executor().now();
  rig.play("> [1] 1 set sdo_timeout 50\n< [1] OK\n> [2] 1 6 r 0x1000 0\n< [2] ERROR:0x05040000\n");
  const auto took = rig.world().executor().now() - before;
  EXPECT_GE(took, 50ms);
  EXPECT_LT(took, 100ms);
}

TEST(Gateway309, ALongValueGoesInSegmentsOrInBlocksAsSet) {
  Rig309 rig;
  std::vector<std::uint8_t> bytes(4000);
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(i * 7);
  const auto text = to_base64(bytes);
  const std::string both =
      "> [1] 1 5 w 0x2100 0 d " + text + "\n< [1] OK\n> [2] 1 5 r 0x2100 0 d\n< [2] " + text + "\n";
  rig.play(both);
  const auto frames = [&](std::string_view start) {
    return std::ranges::count_if(rig.heard().frames, [&](const auto& f) { return f.starts_with(start); });
  };
  EXPECT_EQ(frames("605#21002100"), 1);  // initiate segmented download
  EXPECT_EQ(frames("605#C6002100"), 0);
  rig.heard().frames.clear();
  rig.play("> [3] 1 set sdo_block 1\n< [3] OK\n" + both);
  EXPECT_EQ(frames("605#C6002100"), 1);  // initiate block download, CRC, size indicated
  EXPECT_EQ(frames("605#21002100"), 0);
}

TEST(Gateway309, NmtCommandsAreOnTheBus) {
  Rig309 rig;
  rig.play(R"(
> [1] set network 1
< [1] OK
> [2] 5 start
< [2] OK
> [3] 5 stop
< [3] OK
> [4] 5 preop
< [4] OK
> [5] 1 0 start
< [5] OK
> [6] 2 7 preoperational
< [6] OK
)");
  EXPECT_EQ(rig.heard().frames, (std::vector<std::string>{"000#0105", "000#0205", "000#8005", "000#0100"}));
  EXPECT_EQ(rig.heard(2).frames, (std::vector<std::string>{"000#8007"}));
  EXPECT_EQ(rig.bench->state(), NmtState::operational);
  rig.play("> [7] 5 reset comm\n< [7] OK\n< 1 5 BOOT_UP\n> [8] 5 reset node\n< [8] OK\n< 1 5 BOOT_UP\n");
  rig.play("> [9] 1 boot_up_indication Disable\n< [9] OK\n> [10] 5 reset node\n< [10] OK\n");
  rig.run_for(1s);
  EXPECT_EQ(rig.said, "");
}

TEST(Gateway309, RepliesKeepTheOrderOfTheRequests) {
  Rig309 rig;
  rig.play(R"(
> [30] 1 6 r 0x1000 0 u32
> [20] 1 5 r 0x1000 0 u32
> [20] nonsense
> [10] info version
< [30] ERROR:0x05040000
< [20] 74565
< [20] ERROR:100
< [10] 0 0 0.0 0 2 3.0 1.0
)");
}

TEST(Gateway309, SupervisionAndEmergencies) {
  Rig309 rig;
  rig.play(R"(
> [1] 1 5 w 0x1017 0 u16 100
< [1] OK
> [2] 1 5 enable heartbeat 250
< [2] OK
< 1 5 ERROR 202
)");
  ASSERT_TRUE(rig.bench->errors().raise(0x2310, 0x02, {1, 2, 3, 4, 255}));
  rig.play("> [3] 1 5 r 0x1001 0 x8\n< 1 5 EMCY 0x2310 0x03 1 2 3 4 255\n< [3] 0x03\n");
  rig.unplug_bench();
  ASSERT_TRUE(rig.run_until([&] { return !rig.said.empty(); }, 5s));
  EXPECT_EQ(rig.said, "1 5 ERROR 203\r\n");
  rig.said.clear();
  rig.add_bench();
  rig.play("> [4] 1 5 disable heartbeat\n< [4] OK\n< 1 5 BOOT_UP\n");
  rig.play("> [5] 1 5 enable guarding 100 3\n< [5] OK\n");
  rig.run_for(1s);
  EXPECT_EQ(rig.said, "");
  EXPECT_GE(rig.heard().count("705#R1"), 8) << fmt::format("{}", fmt::join(rig.heard().frames, " "));
  rig.unplug_bench();
  ASSERT_TRUE(rig.run_until([&] { return !rig.said.empty(); }, 5s));
  EXPECT_EQ(rig.said, "1 5 ERROR 201\r\n");
  rig.said.clear();
  rig.play("> [6] 1 5 disable guarding\n< [6] OK\n");
  rig.run_for(10ms);  // the last question may be on its way
  rig.heard().frames.clear();
  rig.run_for(1s);
  EXPECT_EQ(rig.heard().frames, std::vector<std::string>{});
}

TEST(Gateway309, ReceivesPdos) {
  Rig309 rig;
  rig.play(R"(
> [1] set network 1
< [1] OK
> [2] set rpdo 1 0x185 event 3 u8 0x6000 1 i16 b
< [2] OK
> [3] r p 1
< [3] ERROR:102
> [4] r p 2
< [4] ERROR:102
> [5] set rpdo 2 0x185 event 1 u8
< [5] ERROR:400
> [6] set rpdo 2 0x186 event 2 u64 b
< [6] ERROR:401
> [7] set rpdo 2 0x601 event 1 u8
< [7] ERROR:102
> [8] set rpdo 2 0x286 sync1 1 u16
< [8] OK
)");
  rig.peer().send(can::Frame::base(0x185, {0x11, 0xFE, 0xFF, 0x01}), 0);
  rig.play("> [9] info version\n< [9] 0 0 0.0 0 2 3.0 1.0\n");
  rig.run_for(10ms);
  EXPECT_EQ(rig.said, "1 pdo 1 3 0x11 0xfffe 0x1\r\n");
  rig.said.clear();
  rig.play("> [10] r p 1\n< [10] 1 pdo 3 0x11 0xfffe 0x1\n");
  rig.peer().send(can::Frame::base(0x185, {0x12, 0, 0}), 0);  // too short: not taken
  rig.peer().send(can::Frame::base(0x286, {0x34, 0x12, 0x99}), 0);
  rig.run_for(10ms);
  EXPECT_EQ(rig.said, "");
  rig.peer().send(can::Frame::base(0x80, {}), 0);
  rig.run_for(10ms);
  EXPECT_EQ(rig.said, "1 pdo 2 1 0x1234\r\n");
  rig.said.clear();
  rig.play("> [11] set rpdo 1 0x80000185 event 0\n< [11] OK\n> [12] r p 1\n< [12] ERROR:102\n");
}

TEST(Gateway309, AsksForAPdo) {
  Rig309 rig;
  rig.play("> [1] 1 set rpdo 1 0x185 rtr 1 u8\n< [1] OK\n> [2] 1 r p 1\n< [2] ERROR:103\n");
  EXPECT_EQ(rig.heard().count("185#R1"), 1);
  rig.talk->take("[3] 1 r p 1");
  ASSERT_TRUE(rig.run_until([&] { return rig.heard().count("185#R1") == 2; }));
  rig.peer().send(can::Frame::base(0x185, {0x2A}), 0);
  ASSERT_TRUE(rig.run_until([&] { return rig.talk->idle(); }));
  EXPECT_EQ(rig.said, "1 pdo 1 1 0x2a\r\n[3] 1 pdo 1 0x2a\r\n");
}

TEST(Gateway309, SendsPdos) {
  Rig309 rig;
  rig.play(R"(
> [1] set network 1
< [1] OK
> [2] w p 1 1 5
< [2] ERROR:102
> [3] set tpdo 1 0x205 event 2 u8 i16
< [3] OK
> [4] w p 1 2 5 -2
< [4] OK
> [5] w p 1 1 5
< [5] ERROR:401
> [6] set tpdo 2 0x080 event 1 u8
< [6] ERROR:102
> [7] set tpdo 2 0x305 sync2 1 u8
< [7] OK
> [8] set tpdo 3 0x405 rtr 1 u8
< [8] OK
> [9] set tpdo 4 0x20000123 event 1 u8
< [9] OK
> [10] w p 2 1 0x77
< [10] OK
> [11] w p 3 1 0x78
< [11] OK
> [12] w p 4 1 0x79
< [12] OK
)");
  rig.run_for(10ms);
  EXPECT_EQ(rig.heard().frames, (std::vector<std::string>{"205#05FEFF", "00000123#79"}));
  for (int i = 0; i < 4; ++i) {
    rig.peer().send(can::Frame::base(0x80, {}), 0);
    rig.run_for(10ms);
  }
  EXPECT_EQ(rig.heard().count("305#77"), 2);
  rig.peer().send(can::Frame::request(0x405, 1), 0);
  rig.run_for(10ms);
  EXPECT_EQ(rig.heard().count("405#78"), 1);
}

TEST(Gateway309, InhibitTimeAndEventTimerOfATpdo) {
  Rig309 rig;
  rig.play("> [1] 1 set tpdox 1 0x205 event 500 200 1 u8\n< [1] OK\n");
  for (int i = 1; i <= 5; ++i) rig.play(fmt::format("> [{0}] 1 w p 1 1 {0}\n< [{0}] OK\n", i));
  rig.run_for(10ms);
  EXPECT_EQ(rig.heard().frames, (std::vector<std::string>{"205#01"}));
  rig.run_for(50ms);  // 50 ms after the first: what is newest then
  EXPECT_EQ(rig.heard().frames, (std::vector<std::string>{"205#01", "205#05"}));
  rig.run_for(1s);
  EXPECT_GE(rig.heard().count("205#05"), 5);
  EXPECT_LE(rig.heard().count("205#05"), 7);
}

// Two clients must not produce one PDO; what is a client's own ends with it.
TEST(Gateway309, ConversationsAreApart) {
  Rig309 rig;
  rig.play("> [1] set network 1\n< [1] OK\n> [2] set tpdo 1 0x205 event 1 u8\n< [2] OK\n");
  std::string other;
  auto second = std::make_unique<cia309::Conversation>(
      rig.house(), [&](std::string_view text) { other += text; }, [] {});
  second->take("[1] 5 start");
  second->take("[2] 1 set tpdo 9 0x205 event 1 u8");
  second->take("[3] 2 set tpdo 9 0x205 event 1 u8");
  ASSERT_TRUE(rig.run_until([&] { return second->idle(); }));
  EXPECT_EQ(other, "[1] ERROR:104\r\n[2] ERROR:400\r\n[3] OK\r\n");
  rig.begin();  // the first one leaves
  second->take("[4] 1 set tpdo 9 0x205 event 1 u8");
  ASSERT_TRUE(rig.run_until([&] { return second->idle(); }));
  EXPECT_TRUE(other.ends_with("[4] OK\r\n")) << other;
  second.reset();
}

TEST(Gateway309, SyncIndicationsWhenAskedFor) {
  Rig309 rig;
  rig.peer().send(can::Frame::base(0x80, {}), 0);
  rig.run_for(5ms);
  EXPECT_EQ(rig.said, "");
  rig.play("> [1] 1 _sync_indication Enable\n< [1] OK\n");
  rig.peer().send(can::Frame::base(0x80, {}), 0);
  rig.peer().send(can::Frame::base(0x80, {7}), 0);
  rig.run_for(5ms);
  EXPECT_EQ(rig.said, "1 SYNC\r\n1 SYNC 7\r\n");
}

TEST(Gateway309, GatewayCommands) {
  Rig309 rig;
  rig.play(R"(
> [1] 1 init 2
< [1] OK
> [2] 1 init 5
< [2] ERROR:503
> [3] 1 init 9
< [3] ERROR:503
> [4] 1 set heartbeat 500
< [4] OK
> [5] 1 set heartbeat 50
< [5] ERROR:102
> [6] 1 set id 127
< [6] OK
> [7] 1 set id 1
< [7] ERROR:102
> [8] set command_size 64
< [8] OK
> [9] 1 5 w 0x2100 0 d AAECAwQFBgcICQoLDA0ODxAREhMUFRYXGBkaGxwdHh8gISIjJCUmJygpKiss
< [9] ERROR:600
> [10] set command_size 1048577
< [10] ERROR:600
> [11] set command_size 1
< [11] ERROR:102
)");
  EXPECT_TRUE(rig.heard().frames.empty());
}

TEST(Gateway309, CommandTimeoutEndsACommand) {
  Rig309 rig;
  rig.play("> [1] set command_timeout 100\n< [1] OK\n");
  const auto before = rig.world().executor().now();
  rig.play("> [2] 1 6 r 0x1000 0\n< [2] ERROR:103\n> [3] 1 5 r 0x1000 0\n< [3] 45 23 01 00\n");
  EXPECT_LT(rig.world().executor().now() - before, 200ms);
}

TEST(Gateway309, TooManyCommandsWait) {
  Rig309 rig;
  unsigned taken = 0;
  while (!rig.talk->full()) rig.talk->take(fmt::format("[{}] 1 6 r 0x1000 0", taken++));
  EXPECT_EQ(taken, cia309::Conversation::most_lines);
  ASSERT_TRUE(rig.run_until([&] { return rig.mores == 1; }, 300s));
  EXPECT_FALSE(rig.talk->full());
  ASSERT_TRUE(rig.run_until([&] { return rig.talk->idle(); }, 300s));
  EXPECT_EQ(std::ranges::count(rig.said, '\n'), static_cast<long>(taken));
}

// ---- roles ----

TEST(Gateway309, AnObserverSendsNothing) {
  Rig309 rig({.role = design::Role::observer});
  rig.play(R"(
> [1] 1 5 r 0x1000 0
< [1] ERROR:102
> [2] 1 5 start
< [2] ERROR:102
> [3] 1 5 enable guarding 100 3
< [3] ERROR:102
> [4] 1 lss_ident_nonconf
< [4] ERROR:102
> [5] 1 set tpdo 1 0x205 event 1 u8
< [5] ERROR:102
> [6] 1 set rpdo 1 0x185 event 1 u8
< [6] OK
> [7] 1 init 2
< [7] ERROR:102
> [8] 1 5 enable heartbeat 100
< [8] OK
)");
  EXPECT_TRUE(rig.heard().frames.empty());
  EXPECT_FALSE(rig.told.empty()) << "a person is told why";
}

TEST(Gateway309, ACommissionerNeitherStartsNorResets) {
  Rig309 rig({.role = design::Role::commissioner});
  rig.play(R"(
> [1] 1 5 start
< [1] ERROR:102
> [2] 1 5 reset node
< [2] ERROR:102
> [3] 1 5 preop
< [3] OK
> [4] 1 5 r 0x1000 0 u32
< [4] 74565
)");
  EXPECT_EQ(rig.heard().count("000#0105") + rig.heard().count("000#8105"), 0);
}

// As `berth nmt` and `berth sdo` have it: reset and store of an operational device want a person's word.
TEST(Gateway309, AnOperationalDeviceOfARealBusIsLeftAlone) {
  Rig309 rig;
  rig.session().set_careful(true);
  rig.house().commands = true;
  const char* const disturbing = R"(
> [1] 1 5 reset node
< [1] ERROR:102
> [2] 1 5 w 0x1010 0 u32 0x65766173
< [2] ERROR:102
> [3] 1 lss_switch_glob 1
< [3] ERROR:102
> [4] 1 lss_activate_bitrate 100
< [4] ERROR:102
> [5] 1 lss_store
< [5] ERROR:102
> [6] 1 0 reset comm
< [6] ERROR:102
> [7] 1 init 4
< [7] ERROR:102
)";
  rig.play("> [1] 1 5 w 0x1017 0 u16 100\n< [1] OK\n> [2] 1 5 start\n< [2] OK\n");
  rig.run_for(500ms);
  rig.heard().frames.clear();
  rig.play(disturbing);
  for (const auto& f : rig.heard().frames) EXPECT_TRUE(f.starts_with("705#")) << f;
  rig.house().confirmed = true;
  rig.play("> [8] 1 5 reset node\n< [8] OK\n< 1 5 BOOT_UP\n");
}

// Nothing that changes a device leaves the gateway towards a real bus unless a person has allowed it there; questions
// do.
TEST(Gateway309, ARealBusIsOnlyReadUntilAPersonAllowsMore) {
  const char* const commands = R"(
> [1] 1 5 start
< [1] ERROR:102
> [2] 1 0 preop
< [2] ERROR:102
> [3] 1 5 stop
< [3] ERROR:102
> [4] 1 5 w 0x1017 0 u16 100
< [4] ERROR:102
> [5] 1 set tpdo 1 0x205 event 1 u8
< [5] ERROR:102
> [6] 1 write pdo 1 1 7
< [6] ERROR:102
> [7] 1 lss_switch_glob 0
< [7] ERROR:102
> [8] 1 lss_switch_sel 1 2 3 4
< [8] ERROR:102
> [9] 1 lss_set_node 9
< [9] ERROR:102
> [10] 1 lss_allnodes
< [10] ERROR:102
> [11] 1 _lss_fastscan
< [11] ERROR:102
)";
  Rig309 rig;
  rig.session().set_careful(true);
  rig.play(commands);
  EXPECT_TRUE(rig.heard().frames.empty()) << rig.heard().frames.front();
  ASSERT_FALSE(rig.told.empty());
  EXPECT_NE(rig.told.front().find("--commands"), std::string::npos) << rig.told.front();
  rig.play("> [12] 1 5 r 0x1000 0 u32\n< [12] 74565\n> [13] 1 lss_ident_nonconf\n< [13] ERROR:103\n");
  rig.house().commands = true;
  rig.play("> [14] 1 5 w 0x1017 0 u16 100\n< [14] OK\n> [15] 1 5 start\n< [15] OK\n");
}

TEST(Gateway309, ASimulatedBusNeedsNoAllowance) {
  Rig309 rig;
  rig.play("> [1] 1 5 w 0x1017 0 u16 100\n< [1] OK\n> [2] 1 set tpdo 1 0x205 event 1 u8\n< [2] OK\n");
}

}  // namespace
}  // namespace berth::serve
