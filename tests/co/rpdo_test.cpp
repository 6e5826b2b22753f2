// RPDOs: transmission types, lengths, deadlines, dummies (docs/protocols/cia301.md §PDO; HC2.5).
#include <gtest/gtest.h>
#include <cstdint>
#include <string>

#include "pdo_rig.hpp"

using namespace berth;
using namespace berth::test;
using od::AbortCode;

namespace rpdo_tests {
namespace {

constexpr auto ok = AbortCode::none;

struct Rpdo : ::testing::Test, Rig {
  // RPDO 1 brings 2001h and 2002h: three bytes.
  void one(Pdo pdo) {
    pdo.cob_id = pdo.cob_id == 0 ? 0x205 : pdo.cob_id;
    pdo.map = {entry(0x2001, 0, 8), entry(0x2002, 0, 16)};
    rpdo(1, pdo);
    pdos.start(node);
  }
  [[nodiscard]] std::string value() const {
    char text[16];
    std::snprintf(text, sizeof text, "%02X %04X", values.get<std::uint8_t>({0x2001, 0}).value(),
                  values.get<std::uint16_t>({0x2002, 0}).value());
    return text;
  }
};

// OD.1400: FEh and FFh at once.
TEST_F(Rpdo, A8_4_OD_1400_EventDriven) {
  for (const unsigned type : {0xFE, 0xFF}) {
    one({.type = static_cast<std::uint8_t>(type)});
    hear("205#AA3412");
    EXPECT_EQ(value(), "AA 1234");
    EXPECT_EQ(take_stored(), Log{"RPDO 1"});
    hear("205#000000");
    EXPECT_EQ(value(), "00 0000");
    take_stored();
  }
}

// 00h..F0h: at the next SYNC, whatever the number; the newest counts.
TEST_F(Rpdo, A8_4_SynchronousAtTheNextSync) {
  for (const unsigned type : {0x00, 0x01, 0x02, 0xF0}) {
    one({.type = static_cast<std::uint8_t>(type)});
    values.set({0x2001, 0}, 0);
    values.set({0x2002, 0}, 0);
    hear("205#AA3412");
    hear("205#BB7856");
    EXPECT_EQ(value(), "00 0000") << type;
    EXPECT_TRUE(take_stored().empty());
    pdos.sync(0, executor.now());
    EXPECT_EQ(value(), "BB 5678") << type;
    EXPECT_EQ(take_stored(), Log{"RPDO 1"}) << "once";
    values.set({0x2001, 0}, 0x11);
    pdos.sync(0, executor.now());
    EXPECT_EQ(value(), "11 5678") << "nothing new";
    EXPECT_TRUE(take_stored().empty());
  }
}

// What waits for a SYNC when operational is left is gone.
TEST_F(Rpdo, A8_4_StoppingForgetsWhatWaits) {
  one({.type = 1});
  hear("205#AA3412");
  pdos.stop();
  pdos.start(node);
  pdos.sync(0, executor.now());
  EXPECT_EQ(value(), "00 0000");
}

// HC2.5: ignored outside operational.
TEST_F(Rpdo, A8_4_HC2_5_NotOutsideOperational) {
  one({});
  pdos.stop();
  hear("205#AA3412");
  hear("205#AA");
  EXPECT_EQ(value(), "00 0000");
  EXPECT_TRUE(stored.empty());
  EXPECT_TRUE(owner.events.empty());
}

// HC2.5: shorter than mapped is not processed and said, longer is processed as far as it is mapped and said.
TEST_F(Rpdo, A8_8_HC2_5_Lengths) {
  one({});
  hear("205#AA3412");
  hear("205#BB56");
  EXPECT_EQ(value(), "AA 1234");
  EXPECT_EQ(owner.events, Log{"8210 on"});
  EXPECT_EQ(owner.last_info, (std::array<std::uint8_t, 5>{1, 0, 2, 3, 0})) << "RPDO 1, 2 bytes of 3";
  hear("205#");
  EXPECT_EQ(owner.events.size(), 1U) << "reported once";
  take_stored();
  hear("205#CC7856FF");
  EXPECT_EQ(value(), "CC 5678");
  EXPECT_EQ(take_stored(), Log{"RPDO 1"});
  EXPECT_EQ(owner.events, (Log{"8210 on", "8210 off", "8220 on"}));
  hear("205#DD7856FF99999999");
  EXPECT_EQ(value(), "DD 5678");
  hear("205#EE7856");
  EXPECT_EQ(owner.events, (Log{"8210 on", "8210 off", "8220 on", "8220 off"}));
  EXPECT_EQ(value(), "EE 5678");
}

// A short synchronous one does not drop the good one that waits.
TEST_F(Rpdo, A8_8_AShortSynchronousPdoChangesNothing) {
  one({.type = 1});
  hear("205#AA3412");
  hear("205#BB");
  EXPECT_EQ(owner.events, Log{"8210 on"});
  pdos.sync(0, executor.now());
  EXPECT_EQ(value(), "AA 1234");
}

// One emergency for all RPDOs with the same error: gone when the last one is.
TEST_F(Rpdo, A8_8_SeveralWithTheSameError) {
  rpdo(2, {.cob_id = 0x305, .map = {entry(0x2003, 0, 32)}});
  one({});
  hear("205#AA");
  hear("305#AA");
  EXPECT_EQ(owner.events, Log{"8210 on"});
  hear("205#AA0000");
  EXPECT_EQ(owner.events, Log{"8210 on"});
  hear("305#AA000000");
  EXPECT_EQ(owner.events, (Log{"8210 on", "8210 off"}));
  hear("305#AA");
  pdos.stop();
  EXPECT_TRUE(owner.active.empty()) << "no error of a PDO that is not there";
}

TEST_F(Rpdo, RemoteFramesAndOthersIdentifiersAreNotHeard) {
  one({});
  values.set({0x2001, 0}, 1);
  hear("205#R3");
  hear("206#AA3412");
  hear("00000205#AA3412");
  EXPECT_EQ(value(), "01 0000");
  EXPECT_TRUE(take_stored().empty());
  EXPECT_TRUE(owner.events.empty());
}

// --- Deadline --------------------------------------------------------------------------------------------------------

// HC2.5: supervision begins with the first reception; EMCY 8250h; the next reception ends it.
TEST_F(Rpdo, A8_1_HC2_5_Deadline) {
  one({.timer = 50});
  run(1s);
  EXPECT_TRUE(owner.events.empty()) << "never heard: not supervised";
  for (int i = 0; i < 10; ++i) {
    hear("205#AA3412");
    run(40ms);
  }
  EXPECT_TRUE(owner.events.empty());
  run(20ms);
  EXPECT_EQ(owner.events, Log{"8250 on"});
  EXPECT_EQ(owner.last_info[0], 1);
  run(1s);
  EXPECT_EQ(owner.events.size(), 1U);
  hear("205#AA3412");
  EXPECT_EQ(owner.events, (Log{"8250 on", "8250 off"}));
  run(60ms);
  EXPECT_EQ(owner.events.size(), 3U);
  pdos.stop();
  EXPECT_TRUE(owner.active.empty());
}

// HC2.5: a write of 1400h:05 begins the running deadline anew, with the new time.
TEST_F(Rpdo, A8_1_HC2_5_AWriteOfTheEventTimerRestartsTheDeadline) {
  one({.timer = 50});
  hear("205#AA3412");
  run(40ms);
  ASSERT_EQ(write_u16(0x1400, 5, 100), ok);
  run(95ms);
  EXPECT_TRUE(owner.events.empty());
  run(10ms);
  EXPECT_EQ(owner.events, Log{"8250 on"});
  hear("205#AA3412");
  run(20ms);
  ASSERT_EQ(write_u16(0x1400, 5, 10), ok) << "shorter";
  run(15ms);
  EXPECT_EQ(owner.events, (Log{"8250 on", "8250 off", "8250 on"}));
  ASSERT_EQ(write_u16(0x1400, 5, 0), ok);
  EXPECT_TRUE(owner.active.empty()) << "no supervision, no error";
  hear("205#AA3412");
  run(1s);
  EXPECT_TRUE(owner.active.empty());
  ASSERT_EQ(write_u16(0x1400, 5, 10), ok);
  run(1s);
  EXPECT_TRUE(owner.active.empty()) << "begins with the next reception";
}

// A PDO without a deadline gets one while it runs.
TEST_F(Rpdo, A8_1_HC2_5_ADeadlineBeginsWhileRunning) {
  one({});
  hear("205#AA3412");
  ASSERT_EQ(write_u16(0x1400, 5, 20), ok);
  run(1s);
  EXPECT_TRUE(owner.events.empty());
  hear("205#AA3412");
  run(30ms);
  EXPECT_EQ(owner.events, Log{"8250 on"});
}

TEST_F(Rpdo, A8_1_ShortPdosDoNotMeetTheDeadline) {
  one({.timer = 50});
  hear("205#AA3412");
  run(30ms);
  hear("205#AA");
  run(30ms);
  EXPECT_TRUE(owner.active.contains(0x8250));
}

TEST_F(Rpdo, A8_1_EachHasItsDeadline) {
  rpdo(2, {.cob_id = 0x305, .map = {entry(0x2003, 0, 32)}, .timer = 20});
  one({.timer = 100});
  hear("205#AA3412");
  hear("305#00000000");
  run(30ms);
  EXPECT_EQ(owner.events, Log{"8250 on"});
  EXPECT_EQ(owner.last_info[0], 2);
  hear("305#00000000");
  EXPECT_TRUE(owner.active.empty());
  for (int i = 0; i < 10; ++i) {
    hear("305#00000000");
    run(10ms);
  }
  EXPECT_TRUE(owner.active.contains(0x8250));
}

// --- Window, dummies, limits -----------------------------------------------------------------------------------------

// OD.1007: synchronous PDOs that come after the window are dropped until the next SYNC.
TEST_F(Rpdo, A5_2_TheWindowDropsWhatComesLate) {
  one({.type = 1});
  rpdo(2, {.cob_id = 0x305, .map = {entry(0x2003, 0, 32)}});
  hear("205#01FFFF");
  pdos.sync(0, executor.now(), 10ms);
  EXPECT_EQ(value(), "01 FFFF") << "before the first SYNC there is no window";
  hear("205#020000");
  run(20ms);
  hear("205#030000");
  hear("305#01000000");
  EXPECT_EQ(take_stored(), (Log{"RPDO 1", "RPDO 2"})) << "event-driven ones know no window";
  pdos.sync(0, executor.now(), 10ms);
  EXPECT_EQ(value(), "02 0000");
  hear("205#040000");
  pdos.sync(0, executor.now(), 10ms);
  EXPECT_EQ(value(), "04 0000");
}

// HC2.5: dummies 0001h..0007h skip bits.
TEST_F(Rpdo, A8_9_HC2_5_Dummies) {
  rpdo(1, {.cob_id = 0x205,
           .map = {entry(0x0005, 0, 8), entry(0x2001, 0, 8), entry(0x0007, 0, 32), entry(0x2002, 0, 16)}});
  pdos.start(node);
  hear("205#11AA222222223412");
  EXPECT_EQ(value(), "AA 1234");
  rpdo(1, {.cob_id = 0x205,
           .map = {entry(0x0001, 0, 1), entry(0x2005, 0, 1), entry(0x0001, 0, 1), entry(0x2001, 0, 8),
                   entry(0x0003, 0, 16)}});
  hear("205#FA07FFFF");  // bits 3..10: 1111 1 | 111
  EXPECT_EQ(value(), "FF 1234");
  EXPECT_EQ(values.get<bool>({0x2005, 0}), true);
  hear("205#05F80000");
  EXPECT_EQ(value(), "00 1234");
  EXPECT_EQ(values.get<bool>({0x2005, 0}), false);
  EXPECT_TRUE(owner.events.empty());
  rpdo(1, {.cob_id = 0x205, .map = {entry(0x0007, 0, 32), entry(0x0004, 0, 32)}});
  take_stored();
  hear("205#1111111111111111");
  EXPECT_EQ(take_stored(), Log{"RPDO 1"}) << "dummies only: received, nothing stored";
  EXPECT_EQ(value(), "00 1234");
}

// Documented: values come in as from the local side.
TEST_F(Rpdo, LimitsAreNotAskedAndTheApplicationIsTold) {
  rpdo(1, {.cob_id = 0x205, .map = {entry(0x2012, 0, 8)}});
  pdos.start(node);
  hear("205#FF");
  EXPECT_EQ(values.get<std::uint8_t>({0x2012, 0}), 0xFF);
  EXPECT_EQ(take_stored(), Log{"RPDO 1"});
}

TEST_F(Rpdo, A1_3_ExtendedIdentifier) {
  one({.cob_id = 0x20000205});
  hear("205#AA3412");
  EXPECT_EQ(value(), "00 0000");
  hear("00000205#AA3412");
  EXPECT_EQ(value(), "AA 1234");
}

TEST_F(Rpdo, A8_4_TheTypeActsAtOnce) {
  one({});
  ASSERT_EQ(write_u8(0x1400, 2, 1), ok);
  hear("205#AA3412");
  EXPECT_EQ(value(), "00 0000");
  pdos.sync(0, executor.now());
  EXPECT_EQ(value(), "AA 1234");
  ASSERT_EQ(write_u8(0x1400, 2, 0xFE), ok);
  hear("205#BB3412");
  EXPECT_EQ(value(), "BB 1234");
}

// The window of a SYNC before the start is none of this time's.
TEST_F(Rpdo, A5_2_AStartForgetsTheWindow) {
  one({.type = 1});
  pdos.sync(0, executor.now(), 1ms);
  run(5ms);
  pdos.stop();
  pdos.start(node);
  hear("205#AA3412");
  pdos.sync(0, executor.now(), 1ms);
  EXPECT_EQ(value(), "AA 1234");
}

// Two RPDOs of one identifier both take the frame; a device may cut one PDO into parts so.
TEST_F(Rpdo, TwoWithOneIdentifier) {
  rpdo(2, {.cob_id = 0x205, .map = {entry(0x2003, 0, 32)}});
  one({});
  hear("205#AA34127F");
  EXPECT_EQ(value(), "AA 1234");
  EXPECT_EQ(values.get<std::uint32_t>({0x2003, 0}), 0x7F1234AAU);
  EXPECT_EQ(take_stored().size(), 2U);
}

// Valid, invalid, valid again while operational.
TEST_F(Rpdo, A8_6_TheCobIdActsAtOnce) {
  one({});
  ASSERT_EQ(write_u32(0x1400, 1, 0x80000205), ok);
  hear("205#AA3412");
  EXPECT_EQ(value(), "00 0000");
  ASSERT_EQ(write_u32(0x1400, 1, 0x206), ok);
  hear("205#AA3412");
  EXPECT_EQ(value(), "00 0000");
  hear("206#AA3412");
  EXPECT_EQ(value(), "AA 1234");
}

// The observer answers at once, from within.
TEST(RpdoObserver, MaySend) {
  struct Echo final : co::Pdos::Observer {
    explicit Echo(co::Pdos& p) : pdos(p) {}
    void received(unsigned, rt::Time) noexcept override { pdos.event(1); }
    co::Pdos& pdos;
  };
  Rig rig;
  Echo echo(rig.pdos);
  rig.pdos.observe(&echo);
  rig.tpdo(1, {.cob_id = 0x185, .map = {entry(0x2001, 0, 8)}});
  rig.rpdo(1, {.cob_id = 0x205, .map = {entry(0x2001, 0, 8)}});
  rig.pdos.start(Rig::node);
  rig.run(1ms);
  rig.take();
  rig.hear("205#42");
  EXPECT_EQ(rig.take(), Log{"185#42"});
}

}  // namespace
}  // namespace rpdo_tests
