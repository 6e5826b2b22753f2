// The errors of a device, its error control, its identifiers and its controller's errors: each part by itself.
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "../pch.hpp"
#include "berth/device/bus_off.hpp"
#include "berth/device/error_control.hpp"
#include "berth/device/own_identifiers.hpp"
#include "part_rig.hpp"

namespace berth::device::test::errors_tests {
namespace {

std::uint32_t read32(const od::Values& values, ObjectRef ref) {
  std::array<std::uint8_t, 4> raw{};
  if (!values.read(ref, raw)) return 0xFFFF'FFFF;
  return raw[0] | raw[1] << 8U | raw[2] << 16U | static_cast<std::uint32_t>(raw[3]) << 24U;
}

od::AbortCode write32(od::Values& values, ObjectRef ref, std::uint32_t value) {
  const std::array<std::uint8_t, 4> raw{static_cast<std::uint8_t>(value), static_cast<std::uint8_t>(value >> 8U),
                                        static_cast<std::uint8_t>(value >> 16U),
                                        static_cast<std::uint8_t>(value >> 24U)};
  return values.write(ref, raw);
}

TEST(Errors, AnErrorShowsIn1001hIn1003hAndOnTheBus) {
  PartRig rig;
  rig.boot();
  EXPECT_TRUE(rig.errors.raise(0x4210, co::error_register::temperature, {1, 2, 3, 4, 5}));
  EXPECT_FALSE(rig.errors.raise(0x4210, co::error_register::temperature)) << "it is active already";
  rig.run(milliseconds(1));
  EXPECT_EQ(rig.record.text, (std::vector<std::string>{"089#1042090102030405"}));
  EXPECT_EQ(rig.values.get<std::uint8_t>({0x1001, 0}), std::uint8_t{9});
  EXPECT_EQ(read32(rig.values, {0x1003, 0}), 1U);
  EXPECT_EQ(read32(rig.values, {0x1003, 1}), 0x0201'4210U);
  EXPECT_EQ(rig.changed, (std::vector<ObjectRef>{{0x1001, 0}})) << "an event of the TPDO that maps it";
  EXPECT_TRUE(rig.errors.active(0x4210));

  EXPECT_TRUE(rig.errors.clear(0x4210));
  EXPECT_FALSE(rig.errors.clear(0x4210));
  rig.run(milliseconds(1));
  EXPECT_EQ(rig.record.text.back(), "089#0000000000000000");
  EXPECT_EQ(rig.values.get<std::uint8_t>({0x1001, 0}), std::uint8_t{0});
  EXPECT_EQ(read32(rig.values, {0x1003, 0}), 1U) << "1003h is a history";
  EXPECT_EQ(rig.changed.size(), 2U);
}

TEST(Errors, A1003hIsClearedByZeroOnly) {
  PartRig rig;
  rig.boot();
  rig.errors.raise(0x4210, 0);
  const std::array<std::uint8_t, 1> one{1}, zero{0};
  EXPECT_EQ(rig.values.write({0x1003, 0}, one), od::AbortCode::invalid_value);
  EXPECT_EQ(read32(rig.values, {0x1003, 0}), 1U);
  EXPECT_EQ(rig.values.write({0x1003, 0}, zero), od::AbortCode::none);
  EXPECT_EQ(read32(rig.values, {0x1003, 0}), 0U);
  EXPECT_EQ(rig.values.view({0x1003, 1}).error(), od::AbortCode::no_data);
}

// CiA 301 §7.5.2.17: the identifier changes only over "not valid".
TEST(Errors, A1014hMovesOverNotValid) {
  PartRig rig;
  rig.boot();
  EXPECT_EQ(write32(rig.values, {0x1014, 0}, 0x0A0), od::AbortCode::invalid_value);
  EXPECT_EQ(write32(rig.values, {0x1014, 0}, 0x8000'0089), od::AbortCode::none);
  rig.errors.raise(0x4210, 0);
  rig.run(milliseconds(1));
  EXPECT_EQ(rig.record.text.size(), 0U) << "it waits while 1014h is not valid";
  EXPECT_EQ(write32(rig.values, {0x1014, 0}, 0x601), od::AbortCode::invalid_value) << "restricted";
  EXPECT_EQ(write32(rig.values, {0x1014, 0}, 0x0A0), od::AbortCode::none);
  rig.run(milliseconds(1));
  EXPECT_EQ(rig.record.text, (std::vector<std::string>{"0A0#1042010000000000"}));
}

TEST(Errors, A1029hSaysWhatAnErrorDoes) {
  for (const auto& [value, state] : {std::pair{0U, NmtState::pre_operational}, std::pair{1U, NmtState::operational},
                                     std::pair{2U, NmtState::stopped}}) {
    PartRig rig;
    rig.boot();
    rig.nmt.apply(co::NmtCommand::start);
    rig.values.set({0x1029, 1}, value);
    rig.errors.behave(0);
    EXPECT_EQ(rig.nmt.state(), NmtState::operational) << "1029h:00 is a count";
    rig.errors.behave(Errors::communication);
    EXPECT_EQ(rig.nmt.state(), state) << value;
  }
}

TEST(Errors, AResetForgetsThemSilently) {
  PartRig rig;
  rig.boot();
  rig.errors.raise(0x4210, 0);
  rig.errors.reset();
  rig.run(milliseconds(1));
  EXPECT_FALSE(rig.errors.active(0x4210));
  EXPECT_EQ(rig.record.count("089#0000000000000000"), 0U);
}

/// Notes what it hears.
struct Heard final : co::HeartbeatConsumer::Observer {
  void heartbeat(const co::HeartbeatEvent& event, rt::Time) noexcept override { events.push_back(event); }
  std::vector<co::HeartbeatEvent> events;
};

TEST(ErrorControl, EachLostNodeIsAnErrorOfItsOwn) {
  PartRig rig;
  Heard heard;
  ErrorControl control(rig.dispatcher, rig.values, rig.errors, rig.host, rt::Duration(0), heard);
  rig.values.set({0x1016, 1}, 0x0005'0032U);  // node 5, 50 ms
  rig.values.set({0x1016, 2}, 0x0006'0032U);
  rig.boot();
  rig.nmt.apply(co::NmtCommand::start);
  control.start(NodeId(9), rig.nmt.state());
  rig.send("705#05");
  rig.send("706#05");
  rig.run(milliseconds(60));
  EXPECT_EQ(rig.record.count("089#3081110500000000"), 1U);
  EXPECT_EQ(rig.record.count("089#3081110600000000"), 1U);
  EXPECT_EQ(rig.nmt.state(), NmtState::pre_operational) << "1029h:01 = 0";
  EXPECT_EQ(heard.events.size(), 4U) << "two started, two lost";
  rig.ask("705#05", milliseconds(1));
  EXPECT_TRUE(rig.errors.active(co::emcy_code::life_guard_or_heartbeat)) << "node 6 is still away";
  EXPECT_EQ(write32(rig.values, {0x1016, 2}, 0), od::AbortCode::none);
  EXPECT_FALSE(rig.errors.active(co::emcy_code::life_guard_or_heartbeat)) << "supervised no more, missed no more";
  control.stop();
}

TEST(ErrorControl, HeartbeatsBy1017hAndGuardingWithoutThem) {
  PartRig rig;
  Heard heard;
  ErrorControl control(rig.dispatcher, rig.values, rig.errors, rig.host, rt::Duration(0), heard);
  rig.boot();
  control.start(NodeId(9), rig.nmt.state());
  rig.ask("709#R", milliseconds(1));
  EXPECT_EQ(rig.record.count("709#7F"), 1U) << "guarding: toggle bit 0, pre-operational";
  const std::array<std::uint8_t, 2> ten{10, 0};
  EXPECT_EQ(rig.values.write({0x1017, 0}, ten), od::AbortCode::none);
  rig.record.clear();
  rig.run(milliseconds(35));
  EXPECT_EQ(rig.record.count("709#7F"), 3U);
  control.hush();
  rig.run(milliseconds(30));
  EXPECT_EQ(rig.record.count("709#7F"), 3U);
  control.speak(NodeId(9), NmtState::operational);
  rig.run(milliseconds(15));
  EXPECT_EQ(rig.record.count("709#05"), 1U);
  control.stop();
  rig.run(milliseconds(30));
  EXPECT_EQ(rig.record.count("709#05"), 1U);
}

// 1017h by a clock that is 10 % slow.
TEST(ErrorControl, ADriftingClockDrawsItsPeriods) {
  PartRig rig(Timing{.drift_ppm = -100'000});
  Heard heard;
  ErrorControl control(rig.dispatcher, rig.values, rig.errors, rig.host, rt::Duration(0), heard);
  rig.values.set({0x1017, 0}, std::uint16_t{90});
  rig.boot();
  control.start(NodeId(9), rig.nmt.state());
  rig.run(milliseconds(95));
  EXPECT_EQ(rig.record.count("709#7F"), 0U);
  rig.run(milliseconds(10));
  EXPECT_EQ(rig.record.count("709#7F"), 1U);
}

struct Doubled final : OwnIdentifiers::Owner {
  void doubled() noexcept override { ++times; }
  unsigned times = 0;
};

TEST(OwnIdentifiers, AnotherNodesFramesWithThemAreACollision) {
  for (const std::string frame : {"589#6000100000000000", "709#05", "089#0000000000000000"}) {
    PartRig rig;
    Doubled doubled;
    OwnIdentifiers own(rig.dispatcher, rig.values, rig.nmt, rig.errors, doubled, true);
    rig.boot();
    rig.ask(frame);
    EXPECT_EQ(doubled.times, 0U) << "it does not listen yet";
    own.listen();
    rig.ask("58A#6000100000000000");
    rig.ask("709#R");
    EXPECT_EQ(doubled.times, 0U) << "another's, and a question for this node";
    rig.ask(frame);
    EXPECT_EQ(doubled.times, 1U) << frame;
    EXPECT_TRUE(rig.errors.active(co::emcy_code::id_collision)) << frame;
    own.stop();
    rig.ask(frame);
    EXPECT_EQ(doubled.times, 1U);
  }
}

TEST(OwnIdentifiers, FollowTheObjects) {
  PartRig rig;
  Doubled doubled;
  OwnIdentifiers own(rig.dispatcher, rig.values, rig.nmt, rig.errors, doubled, true);
  rig.boot();
  own.listen();
  EXPECT_EQ(write32(rig.values, {0x1014, 0}, 0x8000'0089), od::AbortCode::none);
  rig.ask("089#0000000000000000");
  EXPECT_EQ(doubled.times, 0U);
  EXPECT_EQ(write32(rig.values, {0x1014, 0}, 0x0A0), od::AbortCode::none);
  rig.ask("0A0#0000000000000000");
  EXPECT_EQ(doubled.times, 1U);
}

TEST(OwnIdentifiers, OffTheyHearNothing) {
  PartRig rig;
  Doubled doubled;
  OwnIdentifiers own(rig.dispatcher, rig.values, rig.nmt, rig.errors, doubled, false);
  rig.boot();
  own.listen();
  EXPECT_EQ(write32(rig.values, {0x1014, 0}, 0x8000'0089), od::AbortCode::none);
  rig.ask("589#6000100000000000");
  EXPECT_EQ(doubled.times, 0U);
}

/// A port whose controller's errors the test makes up.
class FailingPort final : public can::Port {
 public:
  can::Queued send(const can::Frame&, std::uint32_t) noexcept override { return can::Queued::yes; }
  void withdraw(std::uint32_t) noexcept override {}
  void listen(can::Listener* listener, std::span<const can::IdRange>) noexcept override { listener_ = listener; }
  [[nodiscard]] can::Status status() const noexcept override { return now_; }
  bool restart(std::uint32_t) noexcept override {
    ++restarts;
    tell({});
    return true;
  }
  void tell(const can::Status& status) noexcept {
    now_ = status;
    if (listener_ != nullptr) listener_->changed(now_, {});
  }
  unsigned restarts = 0;

 private:
  can::Listener* listener_ = nullptr;
  can::Status now_{};
};

TEST(BusOffRecovery, WaitsRestartsAndTellsIt) {
  PartRig rig;
  FailingPort port;
  can::Dispatcher dispatcher(rig.world.executor(), port);
  BusOffRecovery recovery(dispatcher, rig.host, rig.errors, milliseconds(20));
  rig.boot();
  rig.nmt.apply(co::NmtCommand::start);
  can::Status off{};
  off.bus_off = true;
  port.tell(off);
  EXPECT_EQ(rig.nmt.state(), NmtState::operational) << "without power the controller's state means nothing";
  recovery.power_on();
  port.tell(off);
  EXPECT_EQ(rig.nmt.state(), NmtState::pre_operational) << "1029h:01";
  rig.run(milliseconds(19));
  EXPECT_EQ(port.restarts, 0U);
  rig.run(milliseconds(2));
  EXPECT_EQ(port.restarts, 1U);
  EXPECT_EQ(rig.record.count("089#4081110000000000"), 1U) << "8140h, once";
  port.tell(off);
  recovery.power_off();
  rig.run(milliseconds(50));
  EXPECT_EQ(port.restarts, 1U) << "the power is off";
}

TEST(BusOffRecovery, ErrorPassiveIsAnErrorWhileItLasts) {
  PartRig rig;
  FailingPort port;
  can::Dispatcher dispatcher(rig.world.executor(), port);
  BusOffRecovery recovery(dispatcher, rig.host, rig.errors, rt::Duration(0));
  rig.boot();
  recovery.power_on();
  can::Status passive{};
  passive.tec = 128;
  port.tell(passive);
  EXPECT_TRUE(rig.errors.active(co::emcy_code::error_passive));
  port.tell({});
  EXPECT_FALSE(rig.errors.active(co::emcy_code::error_passive));
  can::Status off{};
  off.bus_off = true;
  port.tell(off);
  rig.run(seconds(10));
  EXPECT_EQ(port.restarts, 0U) << "0 = never";
}

// Two devices may stand on ports that they share with others: then neither takes the place of the other's handler.
TEST(BusOffRecovery, APortThatIsNotItsOwnIsLeftAlone) {
  PartRig rig;
  FailingPort port;
  can::Dispatcher dispatcher(rig.world.executor(), port);
  const Host shared(nullptr, {});
  BusOffRecovery recovery(dispatcher, shared, rig.errors, milliseconds(1));
  rig.boot();
  recovery.power_on();
  can::Status off{};
  off.bus_off = true;
  port.tell(off);
  rig.run(milliseconds(20));
  EXPECT_EQ(port.restarts, 0U);
}

}  // namespace
}  // namespace berth::device::test::errors_tests
