// SYNC producer and consumer (docs/protocols/cia301.md §SYNC and TIME; HC2.4).
#include <gtest/gtest.h>
#include <cstdint>
#include <vector>

#include "pdo_rig.hpp"

using namespace berth;
using namespace berth::test;
using od::AbortCode;

namespace sync_tests {
namespace {

constexpr auto ok = AbortCode::none;

struct Sync : ::testing::Test, Rig, co::Sync::Observer {
  Sync() { service.observe(this); }
  explicit Sync(const RigOptions& options) : Rig(options) { service.observe(this); }
  void synchronised(std::uint8_t counter, rt::Time at) noexcept override {
    heard.push_back(counter);
    heard_at.push_back(at);
  }
  void sync_missing(bool missing, rt::Time at) noexcept override {
    gaps.push_back(missing);
    EXPECT_EQ(service.missing(), missing);
    EXPECT_EQ(at, executor.now());
  }
  void produce(std::uint32_t period, std::uint8_t overflow = 0) {
    if (overflow != 0) {
      ASSERT_EQ(write_u8(0x1019, 0, overflow), ok);
    }
    ASSERT_EQ(write_u32(0x1006, 0, period), ok);
    ASSERT_EQ(write_u32(0x1005, 0, 0x40000080), ok);
    service.start();
  }
  co::Sync service{device.dispatcher, values, owner, &pdos};
  std::vector<int> heard;
  std::vector<rt::Time> heard_at;
  std::vector<bool> gaps;
};

// OD.1005, OD.1006: bit 30 makes a producer, 1006h is its period in microseconds.
TEST_F(Sync, A5_1_OD_1005_OD_1006_Producer) {
  service.start();
  run(100ms);
  EXPECT_TRUE(take().empty()) << "a consumer is silent";
  ASSERT_EQ(write_u32(0x1005, 0, 0x40000080), ok);
  EXPECT_FALSE(service.producer());
  run(100ms);
  EXPECT_TRUE(take().empty()) << "no period, no SYNC";
  ASSERT_EQ(write_u32(0x1006, 0, 10'000), ok);
  EXPECT_TRUE(service.producer());
  run(35ms);
  EXPECT_EQ(wire.log, (Log{"080#", "080#", "080#"}));
  EXPECT_EQ(heard, (std::vector<int>{0, 0, 0})) << "own ones too";
  ASSERT_EQ(write_u32(0x1006, 0, 0), ok);
  run(100ms);
  EXPECT_EQ(take().size(), 3U);
  ASSERT_EQ(write_u32(0x1006, 0, 10'000), ok);
  ASSERT_EQ(write_u32(0x1005, 0, 0x00000080), ok);
  run(100ms);
  EXPECT_TRUE(take().empty());
}

// The first within one period after bit 30 is set, and no drift: the period is from due time to due time.
TEST_F(Sync, A5_2_ThePeriodDoesNotDrift) {
  run(3ms);
  produce(10'000);
  const auto begin = executor.now();
  run(10'001ms);
  ASSERT_EQ(wire.times.size(), 1000U);
  for (std::size_t i = 0; i < wire.times.size(); ++i) {
    ASSERT_EQ(wire.times[i] - wire.frame_time - begin, 10ms * static_cast<int>(i + 1));
  }
}

TEST_F(Sync, A5_2_AWriteOfThePeriodBeginsItAnew) {
  produce(10'000);
  run(8ms);
  ASSERT_EQ(write_u32(0x1006, 0, 20'000), ok);
  run(19ms);
  EXPECT_TRUE(take().empty());
  run(2ms);
  EXPECT_EQ(take().size(), 1U);
}

TEST_F(Sync, ThePeriodIsTheDevicesOwn) {
  owner.scale = 3;
  produce(10'000);
  run(100ms);
  EXPECT_EQ(take().size(), 3U);
}

// While bit 30 is set bits 29..0 stay as they are: 0609 0030.
TEST_F(Sync, A5_1_TheCobIdIsFrozenWhileProducing) {
  ASSERT_EQ(write_u32(0x1005, 0, 0x00000090), ok);
  ASSERT_EQ(write_u32(0x1005, 0, 0x40000090), ok);
  EXPECT_EQ(write_u32(0x1005, 0, 0x40000091), AbortCode::invalid_value);
  EXPECT_EQ(write_u32(0x1005, 0, 0x60000090), AbortCode::invalid_value) << "bit 29";
  EXPECT_EQ(write_u32(0x1005, 0, 0x00000091), AbortCode::invalid_value) << "first bit 30, then the rest";
  EXPECT_EQ(write_u32(0x1005, 0, 0x40000090), ok) << "nothing changes";
  EXPECT_EQ(write_u32(0x1005, 0, 0x00000090), ok);
  EXPECT_EQ(write_u32(0x1005, 0, 0x00000091), ok);
}

TEST_F(Sync, A1_2_RestrictedIdentifiersAreRefused) {
  for (const std::uint32_t id : {0x000, 0x07F, 0x101, 0x180, 0x581, 0x5FF, 0x601, 0x67F, 0x6E0, 0x6FF, 0x701, 0x7FF}) {
    EXPECT_EQ(write_u32(0x1005, 0, id), AbortCode::invalid_value) << id;
    EXPECT_EQ(write_u32(0x1005, 0, 0x40000000U | id), AbortCode::invalid_value) << id;
  }
  EXPECT_EQ(write_u32(0x1005, 0, 0x00000880), AbortCode::invalid_value) << "bit 11 of an 11-bit identifier";
  EXPECT_EQ(write_u32(0x1005, 0, 0x20000880), ok);
}

TEST_F(Sync, A1_3_AnotherIdentifierActsAtOnce) {
  service.start();
  ASSERT_EQ(write_u32(0x1005, 0, 0x20012345), ok);
  hear("080#");
  EXPECT_TRUE(heard.empty());
  hear("00012345#");
  EXPECT_EQ(heard.size(), 1U);
  ASSERT_EQ(write_u32(0x1005, 0, 0x60012345), ok);
  ASSERT_EQ(write_u32(0x1006, 0, 1000), ok);
  run(1500us);
  EXPECT_EQ(take(), Log{"00012345#"});
}

// OD.1019: 1 up to the value, then 1 again.
TEST_F(Sync, A5_3_OD_1019_TheCounterRunsFrom1) {
  produce(10'000, 3);
  run(75ms);
  EXPECT_EQ(take(), (Log{"080#01", "080#02", "080#03", "080#01", "080#02", "080#03", "080#01"}));
  EXPECT_EQ(heard, (std::vector<int>{1, 2, 3, 1, 2, 3, 1}));
  service.stop();
  run(50ms);
  EXPECT_TRUE(take().empty());
  service.start();
  run(15ms);
  EXPECT_EQ(take(), Log{"080#01"}) << "starts at 1 again";
}

TEST_F(Sync, A5_3_OverflowValues) {
  for (unsigned value = 0; value <= 255; ++value) {
    const bool good = value == 0 || (value >= 2 && value <= 240);
    EXPECT_EQ(write_u8(0x1019, 0, value), good ? ok : AbortCode::invalid_value) << value;
  }
}

// HC2.4: only while 1006h is 0, whether this device makes the SYNC or hears it (CiA 301 §7.5.2.22): 0800 0022.
TEST_F(Sync, A5_3_HC2_4_TheOverflowChangesOnlyWhileThePeriodIsZero) {
  for (const std::uint32_t role : {0x40000080U, 0x80U}) {
    ASSERT_EQ(write_u32(0x1005, 0, role), ok);
    ASSERT_EQ(write_u32(0x1006, 0, 0), ok);
    EXPECT_EQ(write_u8(0x1019, 0, 10), ok);
    ASSERT_EQ(write_u32(0x1006, 0, 1000), ok);
    EXPECT_EQ(write_u8(0x1019, 0, 20), AbortCode::device_state) << role;
    EXPECT_EQ(write_u8(0x1019, 0, 0), AbortCode::device_state) << role;
    EXPECT_EQ(values.get<std::uint8_t>({0x1019, 0}), 10);
    EXPECT_EQ(write_u8(0x1019, 0, 10), ok) << "nothing changes";
    EXPECT_EQ(write_u8(0x1019, 0, 241), AbortCode::invalid_value) << "never, whatever the period";
  }
}

// Bit 30 set anew begins to count anew (CiA 301 §7.2.5.3.1); another write of a producer's 1005h does not.
TEST_F(Sync, A5_3_Bit30SetAnewStartsTheCounterAnew) {
  produce(10'000, 10);
  run(35ms);
  EXPECT_EQ(take(), (Log{"080#01", "080#02", "080#03"}));
  ASSERT_EQ(write_u32(0x1005, 0, 0x40000080), ok);
  run(15ms);
  EXPECT_EQ(take(), Log{"080#04"}) << "bit 30 was set already";
  ASSERT_EQ(write_u32(0x1005, 0, 0x80), ok);
  run(25ms);
  ASSERT_EQ(write_u32(0x1005, 0, 0x40000080), ok);
  run(25ms);
  EXPECT_EQ(take(), (Log{"080#01", "080#02"}));
}

TEST_F(Sync, A5_3_AnotherOverflowStartsTheCounterAnew) {
  produce(10'000, 10);
  run(35ms);
  ASSERT_EQ(write_u32(0x1006, 0, 0), ok);
  ASSERT_EQ(write_u8(0x1019, 0, 20), ok);
  ASSERT_EQ(write_u32(0x1006, 0, 10'000), ok);
  run(15ms);
  EXPECT_EQ(take(), (Log{"080#01", "080#02", "080#03", "080#01"}));
}

// A SYNC that did not get on the bus is no SYNC: its counter comes again.
TEST_F(Sync, A5_3_ASyncThatWaitsTooLongIsReplaced) {
  produce(10'000, 4);
  run(15ms);
  device.port.mute = true;
  run(30ms);
  EXPECT_EQ(device.port.queued(), 1U);
  EXPECT_EQ(heard.size(), 1U);
  device.port.mute = false;
  run(10ms);
  EXPECT_EQ(take(), (Log{"080#01", "080#02"}));
}

TEST_F(Sync, AFullPortLosesOneSyncOnly) {
  produce(10'000, 4);
  device.port.refuses = can::Queued::full;
  run(15ms);
  device.port.refuses.reset();
  run(10ms);
  EXPECT_EQ(take(), Log{"080#01"});
}

TEST_F(Sync, A5_1_Consumer) {
  service.start();
  hear("080#");
  hear("080#");
  EXPECT_EQ(heard, (std::vector<int>{0, 0}));
  EXPECT_EQ(service.count(), 2U);
  hear("080#R0");
  hear("081#");
  EXPECT_EQ(heard.size(), 2U);
  service.stop();
  hear("080#");
  EXPECT_EQ(heard.size(), 2U);
}

// A consumer knows by 1006h when a SYNC is missing: after one and a half periods, once.
TEST_F(Sync, A5_2_OD_1006_AConsumerMissesSync) {
  ASSERT_EQ(write_u32(0x1006, 0, 10'000), ok);
  service.start();
  run(1s);
  EXPECT_TRUE(gaps.empty()) << "none came yet";
  for (int i = 0; i < 10; ++i) {
    hear("080#");
    run(13ms);
  }
  EXPECT_TRUE(gaps.empty());
  run(2ms);
  EXPECT_EQ(gaps, std::vector<bool>{true});
  run(1s);
  EXPECT_EQ(gaps.size(), 1U);
  hear("080#");
  EXPECT_EQ(gaps, (std::vector<bool>{true, false}));
  run(20ms);
  EXPECT_EQ(gaps.size(), 3U);
  ASSERT_EQ(write_u32(0x1006, 0, 0), ok);
  EXPECT_EQ(gaps.back(), false) << "no period, nothing missing";
  hear("080#");
  run(1s);
  EXPECT_EQ(gaps.size(), 4U);
  ASSERT_EQ(write_u32(0x1006, 0, 10'000), ok);
  hear("080#");
  ASSERT_EQ(write_u32(0x1005, 0, 0x40000080), ok);
  device.port.mute = true;
  run(100ms);
  EXPECT_EQ(gaps.size(), 4U) << "a producer does not wait for itself";
}

// EMCY 8240h; a SYNC of the wrong length does not count; the next good one ends the error.
TEST_F(Sync, A5_4_WrongLength) {
  service.start();
  hear("080#01");
  EXPECT_EQ(owner.events, Log{"8240 on"});
  EXPECT_EQ(owner.last_info, (std::array<std::uint8_t, 5>{1, 0, 0, 0, 0}));
  hear("080#0102030405060708");
  EXPECT_EQ(owner.events.size(), 1U);
  EXPECT_TRUE(heard.empty());
  hear("080#");
  EXPECT_EQ(owner.events, (Log{"8240 on", "8240 off"}));
  EXPECT_EQ(heard.size(), 1U);
  ASSERT_EQ(write_u8(0x1019, 0, 10), ok);
  hear("080#");
  EXPECT_EQ(owner.events.back(), "8240 on");
  EXPECT_EQ(owner.last_info[1], 1);
  hear("080#07");
  EXPECT_EQ(heard.back(), 7);
  hear("080#");
  service.stop();
  EXPECT_TRUE(owner.active.empty());
}

// OD.1007: the window reaches the PDOs.
TEST_F(Sync, A5_2_OD_1007_TheWindow) {
  tpdo(1, {.cob_id = 0x185, .type = 1, .map = {entry(0x2001, 0, 8)}});
  rpdo(1, {.cob_id = 0x205, .type = 1, .map = {entry(0x2001, 0, 8)}});
  ASSERT_EQ(write_u32(0x1007, 0, 5000), ok);
  service.start();
  pdos.start(node);
  hear("080#");
  EXPECT_EQ(take(), Log{"185#00"});
  run(10ms);
  hear("205#11");
  hear("080#");
  EXPECT_EQ(take(), Log{"185#00"}) << "came after the window";
  hear("205#22");
  hear("080#");
  EXPECT_EQ(take(), Log{"185#22"});
  ASSERT_EQ(write_u32(0x1007, 0, 0), ok);
  hear("080#");
  take();
  run(100ms);
  hear("205#33");
  hear("080#");
  EXPECT_EQ(take(), Log{"185#33"});
}

// The producer's own PDOs follow its SYNC, when it is on the bus and not before.
TEST_F(Sync, A5_1_OwnPdosFollowTheOwnSync) {
  tpdo(1, {.cob_id = 0x185, .type = 2, .map = {entry(0x2001, 0, 8)}});
  pdos.start(node);
  produce(1000);
  run(4500us);
  EXPECT_EQ(take(), (Log{"080#", "080#", "185#00", "080#", "080#", "185#00"}));
}

// A device without the optional objects.
TEST(SyncObjects, MissingOnesCountAsTheirDefaults) {
  Bench b;
  Station device(b.wire), peer(b.wire);
  od::DescriptionBuilder builder;
  builder.variable(0x1000, {.name = "Device type"});
  od::Values values(builder.build());
  berth::test::Owner owner;
  co::Sync sync(device.dispatcher, values, owner, nullptr);
  sync.start();
  peer.send("080#");
  b.run(1ms);
  EXPECT_EQ(sync.count(), 1U);
  EXPECT_FALSE(sync.producer());
}

// HU.34: a forbidden default keeps SYNC silent.
TEST(SyncObjects, HU_34_AForbiddenDefaultDoesNotAct) {
  Bench b;
  Station device(b.wire);
  od::DescriptionBuilder builder;
  builder.variable(0x1005, {.name = "COB-ID SYNC", .initial = od::Literal::number(0x40000000)});
  builder.variable(0x1006, {.name = "period", .initial = od::Literal::number(1000)});
  od::Values values(builder.build());
  berth::test::Owner owner;
  co::Sync sync(device.dispatcher, values, owner, nullptr);
  sync.start();
  b.run(10ms);
  EXPECT_TRUE(b.wire.log.empty()) << "000h is NMT";
}

}  // namespace
}  // namespace sync_tests
