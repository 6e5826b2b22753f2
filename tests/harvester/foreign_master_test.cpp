// NMT masters beneath gateways that do less than Berth's own: the machine comes up all the same.
#include <gtest/gtest.h>

#include <chrono>
#include <span>
#include <string>
#include <string_view>

#include "berth/can/port.hpp"
#include "berth/od/values.hpp"
#include "tests/harvester/signals.hpp"

namespace berth::test {
namespace {

void replace_first(std::string& text, std::string_view what, std::string_view by) {
  const auto at = text.find(what);
  ASSERT_NE(at, std::string::npos) << what;
  text.replace(at, what.size(), by);
}

/// How often node 1 of the left bus, its NMT master, has booted.
struct BootUps final : can::Tap {
  void frame(const can::Frame& frame, rt::Time, int) noexcept override {
    const bool boot_up = frame.id == 0x701 && !frame.extended && frame.size == 1 && frame.data[0] == 0;
    if (boot_up) ++count;
  }
  int count = 0;
};

/// Refuses a configuration for the master itself, node 1.
class NoneForItself final : public od::Hook {
 public:
  explicit NoneForItself(od::Values& values) { values.attach(*this, 0x1F22); }
  int refused = 0;

 private:
  od::AbortCode writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>) noexcept override {
    if (ref.sub != 1) return od::AbortCode::none;
    ++refused;
    return od::AbortCode::no_sub_index;
  }
};

int boots_of_left_master(SignalMachine& machine) {
  BootUps boots;
  machine.world->bus("left")->add_tap(boots);
  EXPECT_TRUE(machine.up()) << machine.log();
  machine.world->bus("left")->remove_tap(boots);
  return boots.count;
}

void expect_values(SignalMachine& machine) {
  machine.measure<std::int16_t>("torque sensor", {0x7100, 0}, std::int16_t{7});
  EXPECT_TRUE(machine.run_until(
      [&] {
        return machine.value<std::int16_t>("engine", {0x2002, 0}) == 7;
      },
      1s))
      << machine.log();
}

}  // namespace

// It has no configuration for itself, so that the list does not come in one transfer.
TEST(ForeignMaster, TakesItsListObjectByObject) {
  SignalMachine machine;
  NoneForItself left(machine.device("left port").values());
  NoneForItself reel(machine.device("reel port").values());
  ASSERT_TRUE(machine.up()) << machine.log();
  EXPECT_GT(left.refused, 0) << "it was not tried in one transfer";
  EXPECT_GT(reel.refused, 0);
  expect_values(machine);
}

// A gateway that does not run 5 s after it was let in: its master is taken for one that reads its list at its own
// boot-up only, and is reset.
TEST(ForeignMaster, ThatDoesNotLetAGatewayInIsReset) {
  SignalMachine quick;
  const int usual = boots_of_left_master(quick);
  SignalMachine slow([](std::string&, std::string& plant) {
    replace_first(plant, "name   = \"reel gateway\"\n", "name   = \"reel gateway\"\nreset = \"6 s\"\n");
  });
  EXPECT_EQ(boots_of_left_master(slow), usual + 1);
  expect_values(slow);
}

}  // namespace berth::test
