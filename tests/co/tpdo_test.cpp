// TPDOs: transmission types, inhibit time, event timer, window (docs/protocols/cia301.md §PDO; HC2.3, HC2.4).
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "pdo_rig.hpp"

using namespace berth;
using namespace berth::test;
using od::AbortCode;

namespace tpdo_tests {
namespace {

constexpr auto ok = AbortCode::none;

struct Tpdo : ::testing::Test, Rig {
  // TPDO 1 carries 2001h.
  void one(Pdo pdo) {
    pdo.cob_id = pdo.cob_id == 0 ? 0x185 : pdo.cob_id;
    pdo.map = {entry(0x2001, 0, 8)};
    tpdo(1, pdo);
    pdos.start(node);
    run(1ms);
  }
  void set(unsigned value) { values.set({0x2001, 0}, value); }
  // A SYNC of the peer; what the device sent until 1 ms later.
  Log sync(std::uint8_t counter = 0) {
    pdos.sync(counter, executor.now());
    run(1ms);
    return take();
  }
  // n SYNCs; for each 1 = a TPDO came.
  std::string syncs(unsigned n, unsigned overflow = 0) {
    std::string pattern;
    for (unsigned i = 0; i < n; ++i) {
      pattern += sync(static_cast<std::uint8_t>(overflow == 0 ? 0 : 1 + i % overflow)).empty() ? '0' : '1';
    }
    return pattern;
  }
};

TEST_F(Tpdo, A8_3_OD_1800_EveryNthSync) {
  one({.type = 1});
  EXPECT_TRUE(take().empty()) << "nothing at the start";
  EXPECT_EQ(syncs(4), "1111");
  one({.type = 3});
  EXPECT_EQ(syncs(9), "001001001");
  one({.type = 240});
  EXPECT_EQ(syncs(480), std::string(239, '0') + '1' + std::string(239, '0') + '1');
}

// HC2.4: type 0 is sent after a SYNC when an event came since the one before.
TEST_F(Tpdo, A8_3_HC2_4_AcyclicSynchronous) {
  one({.type = 0});
  EXPECT_EQ(syncs(2), "00");
  EXPECT_TRUE(pdos.event(1));
  EXPECT_TRUE(pdos.event(1));
  run(5ms);
  EXPECT_TRUE(take().empty()) << "waits for the SYNC";
  set(7);
  EXPECT_EQ(sync(), Log{"185#07"}) << "sampled at the SYNC, not at the event";
  EXPECT_EQ(syncs(2), "00") << "two events before one SYNC are one";
  EXPECT_TRUE(pdos.changed({0x2001, 0}));
  EXPECT_EQ(syncs(2), "10");
}

// HC2.4: the SYNC that carries the start value is the first of the n.
TEST_F(Tpdo, A8_5_HC2_4_SyncStartValue) {
  one({.type = 1, .start = 3});
  EXPECT_EQ(syncs(8, 8), "00111111");
  one({.type = 2, .start = 3});
  EXPECT_EQ(syncs(12, 6), "000101010101");
  one({.type = 4, .start = 4});
  EXPECT_EQ(syncs(16, 4), "0000001000100010");
  one({.type = 2, .start = 3});
  EXPECT_EQ(syncs(6), "010101") << "a SYNC without counter: the start value is ignored";
  one({.type = 1, .start = 9});
  EXPECT_EQ(syncs(16, 8), std::string(16, '0')) << "no such counter";
  one({.type = 2, .start = 0});
  EXPECT_EQ(syncs(6, 3), "010101");
}

// HC2.4: FCh sampled at SYNC, sent when asked; FDh sampled when asked.
TEST_F(Tpdo, A8_3_HC2_4_RemoteFrames) {
  one({.type = 0xFC});
  set(1);
  EXPECT_TRUE(sync().empty());
  set(2);
  hear("185#R1");
  EXPECT_EQ(take(), Log{"185#01"}) << "as of the SYNC";
  hear("185#R8");
  EXPECT_EQ(take(), Log{"185#01"});
  EXPECT_TRUE(sync().empty());
  hear("185#R1");
  EXPECT_EQ(take(), Log{"185#02"});
  EXPECT_FALSE(pdos.event(1)) << "remote frames only";

  one({.type = 0xFD});
  EXPECT_TRUE(take().empty());
  set(3);
  EXPECT_TRUE(sync().empty());
  hear("185#R1");
  EXPECT_EQ(take(), Log{"185#03"}) << "as of now";
  EXPECT_FALSE(pdos.event(1));

  one({.type = 0xFF});
  take();
  hear("185#R1");
  EXPECT_EQ(take(), Log{"185#03"});
  one({.type = 1});
  hear("185#R1");
  EXPECT_TRUE(take().empty()) << "SYNC only";
}

// Before the first SYNC there is no sample yet: the answer is sampled when asked.
TEST_F(Tpdo, A8_3_HC2_4_RemoteFrameBeforeTheFirstSync) {
  one({.type = 0xFC});
  set(9);
  hear("185#R1");
  EXPECT_EQ(take(), Log{"185#09"});
}

// HC2.2: a type that is sent on remote frames alone, and bit 30 that forbids them: no valid PDO has both, in whatever
// order they come.
TEST_F(Tpdo, A1_3_HC2_2_Bit30AndTheTypesOfRemoteFramesExcludeEachOther) {
  for (const unsigned type : {0xFC, 0xFD}) {
    one({.cob_id = 0x40000185, .type = 0xFF});
    EXPECT_EQ(write_u8(0x1800, 2, type), AbortCode::invalid_value) << type;
    one({.type = static_cast<std::uint8_t>(type)});
    EXPECT_EQ(write_u32(0x1800, 1, 0x40000185), AbortCode::invalid_value) << type;
    ASSERT_EQ(write_u32(0x1800, 1, 0xC0000185), ok) << "not valid";
    EXPECT_EQ(write_u32(0x1800, 1, 0x40000185), AbortCode::invalid_value) << type;
    EXPECT_EQ(write_u8(0x1800, 2, type), ok) << "not valid: in any order";
    EXPECT_EQ(write_u32(0x1800, 1, 0x00000185), ok) << type;
  }
  EXPECT_EQ(write_u8(0x1400, 2, 0xFC), AbortCode::invalid_value) << "an RPDO has no such type";
}

// HC2.2: bit 30 forbids remote frames, also when it is set while the PDO is valid.
TEST_F(Tpdo, A1_3_HC2_2_Bit30ForbidsRemoteFrames) {
  for (const unsigned type : {0xFE, 0xFF}) {
    one({.cob_id = 0x40000185, .type = static_cast<std::uint8_t>(type)});
    sync();
    take();
    hear("185#R1");
    EXPECT_TRUE(take().empty()) << type;
    ASSERT_EQ(write_u32(0x1800, 1, 0x185), ok);
    hear("185#R1");
    EXPECT_EQ(take().size(), 1U) << type;
  }
}

TEST_F(Tpdo, A8_3_EventDriven) {
  for (const unsigned type : {0xFE, 0xFF}) {
    one({.type = static_cast<std::uint8_t>(type)});
    EXPECT_EQ(take().size(), 1U) << "once when operational is entered";
    EXPECT_EQ(syncs(3), "000");
    set(type);
    EXPECT_TRUE(pdos.event(1));
    run(1ms);
    EXPECT_EQ(take(), Log{type == 0xFE ? "185#FE" : "185#FF"});
    EXPECT_TRUE(pdos.changed({0x2001, 0}));
    EXPECT_FALSE(pdos.changed({0x2002, 0})) << "not mapped";
    EXPECT_FALSE(pdos.changed({0x7777, 0})) << "not there";
    run(1ms);
    EXPECT_EQ(take().size(), 1U);
  }
}

TEST_F(Tpdo, NothingBeforeStartAndAfterStop) {
  one({.type = 0xFF, .timer = 10});
  pdos.stop();
  take();
  EXPECT_FALSE(pdos.event(1));
  EXPECT_TRUE(sync().empty());
  hear("185#R1");
  run(100ms);
  EXPECT_TRUE(take().empty());
}

TEST_F(Tpdo, TheStartNeedNotSend) {
  tpdo(1, {.cob_id = 0x185, .map = {entry(0x2001, 0, 8)}});
  Station other(wire);
  berth::test::Owner other_owner;
  co::Pdos quiet(other.dispatcher, values, other_owner, {.send_at_start = false});
  quiet.start(node);
  run(1ms);
  EXPECT_TRUE(take().empty());
}

TEST_F(Tpdo, A1_3_ExtendedIdentifier) {
  one({.cob_id = 0x20012345, .type = 1});
  set(0xAB);
  EXPECT_EQ(sync(), Log{"00012345#AB"});
}

// --- Inhibit time ----------------------------------------------------------------------------------------------------

// HC2.3: deferred to the end of the inhibit time, one PDO for all events, with the values of then.
TEST_F(Tpdo, A8_1_HC2_3_InhibitTimeDefers) {
  one({.type = 0xFF, .inhibit = 100});  // 10 ms
  ASSERT_EQ(wire.log.size(), 1U);
  const auto first = wire.times[0];
  run(1ms);
  for (unsigned i = 1; i <= 5; ++i) {
    set(i);
    EXPECT_TRUE(pdos.event(1)) << "taken, not dropped";
    run(1ms);
  }
  EXPECT_EQ(wire.log.size(), 1U);
  set(6);
  run(20ms);
  ASSERT_EQ(wire.log, (Log{"185#00", "185#06"}));
  EXPECT_EQ(wire.times[1] - wire.frame_time, first + 10ms) << "at the first instant that is allowed";
  pdos.event(1);
  run(1ms);
  EXPECT_EQ(wire.log.size(), 3U) << "free again";
}

// HC2.3: the time counts from the end of the frame on the bus, also when it waited for the bus.
TEST_F(Tpdo, HC2_3_InhibitTimeBeginsOnTheBus) {
  device.port.mute = true;
  one({.type = 0xFF, .inhibit = 100});
  run(50ms);
  pdos.event(1);
  device.port.mute = false;
  wire.wake();
  run(100ms);
  ASSERT_EQ(wire.times.size(), 2U);
  EXPECT_GE(wire.times[1] - wire.times[0], 10ms);
}

// A port that was restarted forgets its queue without saying so.
TEST_F(Tpdo, HC2_3_ALostFrameDoesNotBlockForEver) {
  device.port.mute = true;
  one({.type = 0xFF, .inhibit = 100});
  for (std::uint32_t tag = 0; tag < 100; ++tag) device.port.withdraw(tag);
  device.port.mute = false;
  pdos.event(1);
  run(2s);
  EXPECT_EQ(take().size(), 1U);
  EXPECT_TRUE(pdos.event(1));
  run(20ms);
  EXPECT_EQ(take().size(), 1U);
}

// What operational's end withdrew was not sent: the inhibit time does not hold up the next start.
TEST_F(Tpdo, HC2_3_AWithdrawnPdoInhibitsNothing) {
  device.port.mute = true;
  one({.type = 0xFF, .inhibit = 100});
  pdos.stop();
  EXPECT_EQ(device.port.queued(), 0U);
  device.port.mute = false;
  pdos.start(node);
  run(1ms);
  EXPECT_EQ(take().size(), 1U);
}

// Any sequence of events: never two within the inhibit time, and after the last event there is one more PDO.
RC_GTEST_PROP(TpdoProperty, HC2_3_NeverEarlyNeverDropped, (std::uint64_t seed)) {
  Random random(seed);
  Rig rig;
  const auto inhibit = static_cast<std::uint16_t>(1 + random.below(50));
  const bool timer = random.below(2) == 0;
  rig.executor.perturb(random.next() | 1U);
  rig.tpdo(1, {.cob_id = 0x185,
               .map = {entry(0x2002, 0, 16)},
               .inhibit = inhibit,
               .timer = timer ? static_cast<std::uint16_t>(1 + random.below(20)) : std::uint16_t{0}});
  rig.pdos.start(Rig::node);
  const auto least = std::chrono::microseconds(100) * inhibit;
  for (std::uint16_t i = 1; i <= 60; ++i) {
    rig.run(std::chrono::microseconds(random.below(4000)));
    if (random.below(10) == 0) rig.device.port.refuses = can::Queued::full;
    if (random.below(3) == 0) rig.device.port.refuses.reset();
    rig.values.set({0x2002, 0}, i);
    RC_ASSERT(rig.pdos.event(1));
  }
  rig.device.port.refuses.reset();
  rig.run(100ms);
  for (std::size_t i = 1; i < rig.wire.times.size(); ++i) {
    RC_ASSERT(rig.wire.times[i] - rig.wire.times[i - 1] >= least);
  }
  RC_ASSERT(rig.wire.log.back() == "185#3C00");
}

TEST_F(Tpdo, AFullQueueDefers) {
  one({.type = 0xFF});
  take();
  device.port.refuses = can::Queued::full;
  set(1);
  EXPECT_TRUE(pdos.event(1));
  set(2);
  EXPECT_TRUE(pdos.event(1));
  run(10ms);
  EXPECT_TRUE(take().empty());
  device.port.refuses.reset();
  run(2ms);
  EXPECT_EQ(take(), Log{"185#02"});
  device.port.refuses = can::Queued::bus_off;
  pdos.event(1);
  run(1s);
  device.port.refuses.reset();
  run(200ms);
  EXPECT_EQ(take(), Log{"185#02"});
}

// --- Event timer -----------------------------------------------------------------------------------------------------

TEST_F(Tpdo, A8_1_EventTimerCountsFromTheLastTransmission) {
  one({.type = 0xFE, .timer = 50});
  take();
  run(48ms);
  EXPECT_TRUE(wire.log.empty());
  run(2ms);
  EXPECT_EQ(wire.log.size(), 1U);
  run(48ms);
  EXPECT_EQ(wire.log.size(), 1U);
  pdos.event(1);
  run(49ms);
  EXPECT_EQ(wire.log.size(), 2U) << "the event began it anew";
  run(2ms);
  ASSERT_EQ(wire.log.size(), 3U);
  EXPECT_EQ(wire.times[2] - wire.times[1], 50ms);
}

TEST_F(Tpdo, A8_1_EventTimerIsWrittenWhileRunning) {
  one({.type = 0xFE});
  take();
  run(1s);
  EXPECT_TRUE(take().empty());
  ASSERT_EQ(write_u16(0x1800, 5, 100), ok);
  run(250ms);
  EXPECT_EQ(take().size(), 2U);
  ASSERT_EQ(write_u16(0x1800, 5, 10), ok);
  run(105ms);
  EXPECT_EQ(take().size(), 10U);
  ASSERT_EQ(write_u16(0x1800, 5, 0), ok);
  run(1s);
  EXPECT_TRUE(take().empty());
  one({.type = 1, .timer = 10});
  run(1s);
  EXPECT_TRUE(take().empty()) << "event-driven ones only";
}

TEST_F(Tpdo, A8_1_AnEventTimerShorterThanTheInhibitTime) {
  one({.type = 0xFF, .inhibit = 200, .timer = 5});
  run(200ms);
  ASSERT_GE(wire.times.size(), 8U);
  for (std::size_t i = 1; i < wire.times.size(); ++i) EXPECT_GE(wire.times[i] - wire.times[i - 1], 20ms);
}

// The device's clock runs at half the speed of the world's.
TEST_F(Tpdo, TimesAreTheDevicesOwn) {
  owner.scale = 2;
  one({.type = 0xFE, .inhibit = 100, .timer = 50});
  run(350ms);
  ASSERT_EQ(wire.times.size(), 4U);
  EXPECT_EQ(wire.times[2] - wire.times[1], 100ms);
  pdos.event(1);
  pdos.event(1);
  run(60ms);
  ASSERT_GE(wire.times.size(), 6U);
  EXPECT_EQ(wire.times[5] - wire.frame_time - wire.times[4], 20ms);
}

// --- Synchronous window ----------------------------------------------------------------------------------------------

// OD.1007: what is not on the bus when the window closes is dropped for that cycle.
TEST_F(Tpdo, A5_2_TheWindowDropsWhatIsLate) {
  one({.type = 1});
  device.port.mute = true;
  set(1);
  pdos.sync(0, executor.now(), 2ms);
  run(1ms);
  EXPECT_EQ(device.port.queued(), 1U);
  run(2ms);
  EXPECT_EQ(device.port.queued(), 0U);
  device.port.mute = false;
  run(5ms);
  EXPECT_TRUE(take().empty());
  set(2);
  pdos.sync(0, executor.now(), 2ms);
  run(5ms);
  EXPECT_EQ(take(), Log{"185#02"});
  device.port.refuses = can::Queued::full;
  pdos.sync(0, executor.now(), 2ms);
  run(500us);
  device.port.refuses.reset();
  run(5ms);
  EXPECT_EQ(take(), Log{"185#02"}) << "there was room in time";
  device.port.refuses = can::Queued::full;
  pdos.sync(0, executor.now(), 2ms);
  run(2500us);
  device.port.refuses.reset();
  run(5ms);
  EXPECT_TRUE(take().empty()) << "there was not";
}

// Without a window a late PDO is replaced by that of the next SYNC.
TEST_F(Tpdo, A8_3_ALatePdoIsReplacedAtTheNextSync) {
  one({.type = 1});
  device.port.mute = true;
  for (unsigned i = 1; i <= 3; ++i) {
    set(i);
    pdos.sync(0, executor.now());
    run(1ms);
  }
  EXPECT_EQ(device.port.queued(), 1U);
  device.port.mute = false;
  wire.wake();
  run(1ms);
  EXPECT_EQ(take(), Log{"185#03"});
}

// A short queue is filled as it empties: the PDOs of a SYNC follow each other without gaps.
TEST_F(Tpdo, A8_3_AShortQueueLeavesNoGaps) {
  device.port.capacity = 1;
  for (unsigned n = 1; n <= 4; ++n) tpdo(n, {.cob_id = 0x180U + n, .type = 1, .map = {entry(0x2001, 0, 8)}});
  pdos.start(node);
  pdos.sync(0, executor.now());
  run(450us);
  EXPECT_EQ(take(), (Log{"181#00", "182#00", "183#00", "184#00"}));
}

TEST_F(Tpdo, EventDrivenPdosKnowNoWindow) {
  one({.type = 0xFF, .inhibit = 10});
  take();
  run(5ms);
  device.port.mute = true;
  pdos.sync(0, executor.now(), 1ms);
  pdos.event(1);
  run(5ms);
  device.port.mute = false;
  wire.wake();
  run(1ms);
  EXPECT_EQ(take().size(), 1U);
}

// --- Others ----------------------------------------------------------------------------------------------------------

// One object in several TPDOs: each has its event.
TEST_F(Tpdo, ChangedMarksAllThatMapIt) {
  tpdo(2, {.cob_id = 0x285, .map = {entry(0x2002, 0, 16), entry(0x2001, 0, 8)}});
  tpdo(3, {.cob_id = 0x385, .type = 0, .map = {entry(0x2001, 0, 8)}});
  tpdo(4, {.cob_id = 0x485, .type = 1, .map = {entry(0x2001, 0, 8)}});
  one({});
  take();
  EXPECT_TRUE(pdos.changed({0x2001, 0}));
  run(1ms);
  EXPECT_EQ(take(), (Log{"185#00", "285#000000"}));
  EXPECT_EQ(sync(), (Log{"385#00", "485#00"}));
  EXPECT_EQ(sync(), (Log{"485#00"}));
}

// SX.7: another node that sends with the identifier of a TPDO.
TEST_F(Tpdo, AForeignFrameWithAnOwnIdentifierIsACollision) {
  one({.type = 1});
  hear("186#00");
  EXPECT_TRUE(owner.events.empty());
  hear("185#00");
  hear("185#00");
  EXPECT_EQ(owner.events, Log{"8150 on"}) << "once";
  owner.active.clear();  // the device was reset
  one({.type = 1});
  hear("185#00");
  EXPECT_EQ(owner.events.size(), 2U);
}

// 1013h is the time of sampling in microseconds.
TEST_F(Tpdo, A5_5_OD_1013_TheHighResolutionTimeStampIsOfTheSampling) {
  run(1234567us);
  tpdo(1, {.cob_id = 0x185, .type = 1, .map = {entry(0x1013, 0, 32), entry(0x2001, 0, 8)}});
  pdos.start(node);
  EXPECT_EQ(sync(), Log{"185#87D6120000"});  // 1 234 567 = 12D687h
  EXPECT_EQ(values.get<std::uint32_t>({0x1013, 0}), 1234567U);
}

// 64 objects of one bit each.
TEST(TpdoBits, A8_2_SixtyFourBooleans) {
  Rig rig({.rpdos = 0, .tpdos = 1, .entries = 64});
  std::vector<std::uint32_t> map;
  for (std::uint8_t i = 1; i <= 64; ++i) map.push_back(entry(0x2011, i, 1));
  rig.tpdo(1, {.cob_id = 0x185, .type = 1, .map = map});
  for (const std::uint8_t sub : std::initializer_list<std::uint8_t>{1, 10, 64}) rig.values.set({0x2011, sub}, true);
  rig.pdos.start(Rig::node);
  rig.pdos.sync(0, rig.executor.now());
  rig.run(1ms);
  EXPECT_EQ(rig.take(), Log{"185#0102000000000080"});
}

TEST(TpdoBits, LocalChangesNeedARefresh) {
  Rig rig;
  rig.pdos.start(Rig::node);
  rig.values.set({0x1A00, 1}, entry(0x2001, 0, 8));
  rig.values.set({0x1A00, 0}, 1);
  rig.values.set({0x1800, 1}, 0x185U);
  EXPECT_FALSE(rig.pdos.event(1));
  rig.pdos.refresh();
  EXPECT_TRUE(rig.pdos.event(1));
  rig.run(1ms);
  EXPECT_EQ(rig.take(), Log{"185#00"});
}

}  // namespace
}  // namespace tpdo_tests
