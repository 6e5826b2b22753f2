// The application's ear by itself: what it is told goes to the callbacks that were set, and to no other.
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <vector>

#include "../pch.hpp"
#include "berth/device/application.hpp"
#include "berth/device/dictionary.hpp"

namespace berth::device::test::application_tests {
namespace {

std::shared_ptr<const od::Description> with_an_rpdo() {
  od::DescriptionBuilder b;
  add_device(b);
  for (std::uint16_t index = 0x2000; index < 0x2003; ++index) {
    b.variable(index, {.name = "Value", .type = od::DataType::unsigned8, .mappable = true});
  }
  add_rpdo(b, 2, {.map = {{{0x2000, 0}, 8}, {{0x2002, 0}, 8}}});
  return b.build();
}

TEST(Application, TakesNoMemoryUntilItIsUsed) {
  od::Values values(with_an_rpdo());
  Application application(values);
  application.tell(&Callbacks::state, NmtState::operational);
  static_cast<co::Pdos::Observer&>(application).received(1U, rt::Time{});
  EXPECT_EQ(application.memory(), 0U);
  application.on().sync = [](std::uint8_t) {};
  EXPECT_EQ(application.memory(), sizeof(Callbacks));
}

TEST(Application, HandsOnWhatTheServicesTell) {
  od::Values values(with_an_rpdo());
  Application application(values);
  std::vector<unsigned> calls;
  application.on().rpdo = [&](unsigned number) { calls.push_back(number); };
  application.on().sync = [&](std::uint8_t counter) { calls.push_back(100U + counter); };
  application.on().sync_missing = [&](bool missing) { calls.push_back(missing ? 201 : 200); };
  application.on().time = [&](const co::TimeOfDay& time) { calls.push_back(time.milliseconds); };
  application.on().emergency = [&](NodeId node, const co::Emcy& message) {
    calls.push_back(node.value());
    calls.push_back(message.code);
  };
  application.on().heartbeat = [&](const co::HeartbeatEvent& event) { calls.push_back(400U + event.node.value()); };
  const rt::Time now{};
  static_cast<co::Pdos::Observer&>(application).received(7U, now);
  static_cast<co::Sync::Observer&>(application).synchronised(3, now);
  static_cast<co::Sync::Observer&>(application).sync_missing(true, now);
  static_cast<co::TimeStamp::Observer&>(application).time_of_day({.milliseconds = 300, .days = 0}, now);
  static_cast<co::EmcyConsumer::Observer&>(application).emergency(NodeId(5), {.code = 0x4210}, now);
  static_cast<co::HeartbeatConsumer::Observer&>(application).heartbeat({.node = NodeId(6)}, now);
  EXPECT_EQ(calls, (std::vector<unsigned>{7, 103, 201, 300, 5, 0x4210, 406}));
  application.silence();
  static_cast<co::Pdos::Observer&>(application).received(7U, now);
  EXPECT_EQ(calls.size(), 7U);
}

// By SDO, and by the RPDO whose mapping has it; not what the RPDO does not carry.
TEST(Application, OnWriteHearsSdoAndRpdo) {
  od::Values values(with_an_rpdo());
  Application application(values);
  std::array<unsigned, 3> calls{};
  for (std::uint16_t i = 0; i < 3; ++i) {
    application.on_write({static_cast<std::uint16_t>(0x2000 + i), 0}, [&calls, i] { ++calls[i]; });
  }
  const std::array<std::uint8_t, 1> one{1};
  EXPECT_EQ(values.write({0x2001, 0}, one), od::AbortCode::none);
  EXPECT_EQ(calls, (std::array<unsigned, 3>{0, 1, 0}));
  static_cast<co::Pdos::Observer&>(application).received(2U, rt::Time{});
  EXPECT_EQ(calls, (std::array<unsigned, 3>{1, 1, 1}));
  static_cast<co::Pdos::Observer&>(application).received_mpdo({0x2001, 0}, rt::Time{});
  EXPECT_EQ(calls, (std::array<unsigned, 3>{1, 2, 1}));
}

}  // namespace
}  // namespace berth::device::test::application_tests
