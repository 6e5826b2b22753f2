// What a slot's reason says after a person's commands.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "berth/can/empty_bus.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;

namespace {

design::Machine slot_three() {
  auto machine = one_bus(125'000);
  add_slot(machine, 3, type_b);
  return machine;
}

plant::PlantFile its_device() {
  auto plant = one_bus_plant(1);
  add_device(plant, "a", type_b, 7);
  return plant;
}

std::string reason_of(Rig& rig) { return rig.network().report().front().reason; }

}  // namespace

// "No heartbeat told ..." hid the EMCY 5000h that explains it.
TEST(Told, AnEmergencyExplainsWhyADeviceDoesNotBecomeOperational) {
  Rig rig(slot_three(), its_device());
  auto& device = rig.device("a").device();
  device.on().state = [&](NmtState state) {
    if (state != NmtState::operational) return;
    device.errors().raise(0x5000, 0x01);
    device.apply(co::NmtCommand::enter_pre_operational);
  };
  rig.begin();
  rig.run_for(20s);
  EXPECT_EQ(rig.state(3), SlotState::failed) << rig.log();
  EXPECT_EQ(reason_of(rig),
            "it was started and no heartbeat reported operational; it reported an error: EMCY 5000h (device hardware)");
}

// `nmt preop` after `nmt stop` left "it was made stopped" in the status.
TEST(Told, TheReasonFollowsTheNextCommand) {
  Rig rig(slot_three(), its_device());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  const auto tell = [&](co::NmtCommand command) {
    rig.network().commanded(command, NodeId(3));
    rig.network().services().nmt.queue(command, NodeId(3));
    rig.run_for(5s);
  };
  tell(co::NmtCommand::stop);
  EXPECT_EQ(rig.state(3), SlotState::present);
  EXPECT_EQ(reason_of(rig), "NMT stopped by command; `berth nmt start 3` starts it");
  tell(co::NmtCommand::enter_pre_operational);
  EXPECT_EQ(rig.state(3), SlotState::present);
  EXPECT_EQ(reason_of(rig), "NMT pre-operational by command; `berth nmt start 3` starts it");
  tell(co::NmtCommand::start);
  EXPECT_EQ(rig.state(3), SlotState::operational) << rig.log();
  EXPECT_EQ(reason_of(rig), "");
}

// What a person can do about a silent slot stays in sight, whatever is found out of its device later.
TEST(Told, AnAbsentSlotKeepsItsAdvice) {
  Rig rig(slot_three(), its_device());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  rig.device("a").power(false);
  ASSERT_TRUE(rig.run_until([&] { return rig.state(3) == SlotState::absent; }, 10s)) << rig.log();
  const char* const lost = "heartbeat lost; switch the device on, or `berth replace` it";
  EXPECT_EQ(reason_of(rig), lost);
  // It boots, beats, and hears no question.
  rig.device("a").deaf(0ms);
  rig.device("a").power(true);
  ASSERT_TRUE(rig.run_until([&] { return reason_of(rig).find("identity") != std::string::npos; }, 60s)) << rig.log();
  EXPECT_EQ(rig.state(3), SlotState::absent) << rig.log();
  EXPECT_NE(reason_of(rig).find("switch the device on, or `berth replace` it"), std::string::npos) << reason_of(rig);
}

namespace {

/// A device's description without heartbeat, which guarding knows alone; a file that goes with it.
class GuardedEds {
 public:
  GuardedEds() : path_(std::filesystem::temp_directory_path() / ("berth-told-" + std::to_string(::getpid()) + ".eds")) {
    std::ifstream in(example_eds("sensor.eds"));
    std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    const std::pair<std::string, std::string> changes[] = {{"=0x1017", "=0x1015"}, {"[1017]", "[1015]"}};
    for (const auto& [from, to] : changes) {
      const auto at = text.find(from);
      EXPECT_NE(at, std::string::npos) << from;
      if (at != std::string::npos) text.replace(at, from.size(), to);
    }
    std::ofstream(path_) << text;
  }
  ~GuardedEds() { std::filesystem::remove(path_); }
  GuardedEds(const GuardedEds&) = delete;
  GuardedEds& operator=(const GuardedEds&) = delete;
  [[nodiscard]] std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

}  // namespace

// No heartbeat tells that it stopped: the slot shows what it was told, and starts again as any other.
TEST(Told, ADeviceWithoutHeartbeatIsWhatItWasTold) {
  const GuardedEds eds;
  auto plant = its_device();
  plant.devices.front().eds = plant.devices.front().eds_path = eds.path();
  Rig rig(slot_three(), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  rig.network().services().dispatcher.send(co::to_frame({co::NmtCommand::stop, co::NmtTarget(NodeId(3))}));
  rig.network().commanded(co::NmtCommand::stop, NodeId(3));
  EXPECT_EQ(rig.state(3), SlotState::present) << rig.log();
  EXPECT_NE(reason_of(rig).find("NMT stopped by command; `berth nmt start 3` starts it"), std::string::npos)
      << reason_of(rig);
  rig.network().services().dispatcher.send(co::to_frame({co::NmtCommand::start, co::NmtTarget(NodeId(3))}));
  rig.network().commanded(co::NmtCommand::start, NodeId(3));
  EXPECT_TRUE(rig.until_operational(20s)) << rig.log();
}

// One line that says what to look at, not one for each kind of question.
TEST(Told, AnEmptyBusIsToldOnceWithWhatToLookAt) {
  auto plant = its_device();
  plant.devices.front().plugged = false;
  Rig rig(slot_three(), plant);
  rig.begin();
  rig.run_for(20s);
  std::size_t told = 0;
  for (const auto& event : rig.events()) told += event.kind == operate::EventKind::error ? 1U : 0U;
  EXPECT_EQ(told, 1U) << rig.log();
  EXPECT_NE(rig.log().find(can::no_acknowledge), std::string::npos) << rig.log();
  EXPECT_EQ(reason_of(rig), can::no_acknowledge);
  rig.device("a").plug();
  EXPECT_TRUE(rig.until_operational(60s)) << rig.log();
}

// It is asked in vain meanwhile, and that is no news.
TEST(Told, AnAbsentSlotKeepsItsReasonWhileNothingIsHeard) {
  auto plant = its_device();
  add_device(plant, "another", type_c, 9);  // it acknowledges what Berth sends
  Rig rig(slot_three(), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  rig.device("a").unplug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(3) == SlotState::absent; }, 10s)) << rig.log();
  rig.run_for(20s);
  EXPECT_EQ(rig.state(3), SlotState::absent);
  EXPECT_EQ(reason_of(rig).find("identity"), std::string::npos) << reason_of(rig) << rig.log();
}

// The new device was on the bus for twelve seconds while the slot said "switch the device on".
TEST(Told, AnAbsentSlotNamesTheDeviceThatIsThereForIt) {
  auto plant = its_device();
  add_device(plant, "new", type_b, 8).plugged = false;
  Rig rig(slot_three(), plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  rig.device("a").unplug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(3) == SlotState::absent; }, 10s)) << rig.log();
  rig.device("new").plug();
  const auto named = [&] { return reason_of(rig).find("berth replace s3` gives it this one") != std::string::npos; };
  EXPECT_TRUE(rig.run_until(named, 8s)) << rig.log();
  EXPECT_TRUE(reason_of(rig).starts_with("heartbeat lost; ") || reason_of(rig).starts_with("no heartbeat"))
      << reason_of(rig);
  // What is told of the silence later takes it not away.
  rig.run_for(30s);
  EXPECT_TRUE(named()) << reason_of(rig);
  rig.device("new").unplug();
  rig.run_for(60s);
  EXPECT_EQ(rig.state(3), SlotState::absent);
}
