// How a slot's device is watched when its 1017h is not what Berth wants (CiA 301 §7.5.2.20): limits, a constant, none.
#include <gtest/gtest.h>
#include <unistd.h>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;

namespace error_control_tests {
namespace {

// A device with these objects behind the mandatory ones, for a slot with node-ID 5.
struct Described {
  std::string name;
  std::string objects;
};

// Another user's file of this name could not be written over.
std::string own_file(const std::string& name) {
  return ::testing::TempDir() + "error-control-" + std::to_string(::getuid()) + "-" + name;
}

std::string write_description(const Described& what) {
  const std::string file = own_file(what.name + ".eds");
  std::ofstream out(file);
  out << "[DeviceInfo]\nVendorNumber=0x1\nProductNumber=0x1\nLSS_Supported=0\n"
         "[MandatoryObjects]\nSupportedObjects=3\n1=0x1000\n2=0x1001\n3=0x1018\n"
         "[1000]\nParameterName=Device type\nObjectType=7\nDataType=7\nAccessType=ro\nDefaultValue=0x20192\n"
         "[1001]\nParameterName=Error register\nObjectType=7\nDataType=5\nAccessType=ro\nDefaultValue=0\n"
         "[1018]\nParameterName=Identity\nObjectType=9\nSubNumber=2\n"
         "[1018sub0]\nParameterName=n\nObjectType=7\nDataType=5\nAccessType=ro\nDefaultValue=1\n"
         "[1018sub1]\nParameterName=p\nObjectType=7\nDataType=7\nAccessType=ro\nDefaultValue=1\n"
      << what.objects;
  return file;
}

const std::string guarding =
    "[100C]\nParameterName=Guard time\nObjectType=7\nDataType=6\nAccessType=rw\nDefaultValue=0\n"
    "[100D]\nParameterName=Life time factor\nObjectType=7\nDataType=5\nAccessType=rw\nDefaultValue=0\n";

std::string heartbeat(const std::string& access, unsigned period, const std::string& limits = {}) {
  return "[1017]\nParameterName=Producer heartbeat time\nObjectType=7\nDataType=6\nAccessType=" + access +
         "\nDefaultValue=" + std::to_string(period) + "\n" + limits;
}

std::string with(const std::string& numbers, const std::string& objects) {
  std::string list;
  unsigned count = 0;
  for (std::size_t at = 0; at + 4 <= numbers.size(); at += 5) {
    list += std::to_string(++count) + "=0x" + numbers.substr(at, 4) + "\n";
  }
  return "[OptionalObjects]\nSupportedObjects=" + std::to_string(count) + "\n" + list + objects;
}

design::Machine machine() {
  design::Machine m = one_bus(125'000);
  add_slot(m, 5, type_b);
  m.slots.back().spec.assign = places::Assign::fixed;
  return m;
}

plant::PlantFile plant_of(const Described& what) {
  auto p = one_bus_plant(1);
  auto& d = add_device(p, "d", type_b, 0);
  d.eds = d.eds_path = write_description(what);
  d.source = plant::NodeIdSource::switches;
  d.node_id = NodeId(5);
  d.speaks = {};
  return p;
}

// Operational, and so for a minute; then it is unplugged.
void runs_and_is_missed(Rig& rig) {
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  rig.run_for(60s);
  ASSERT_TRUE(rig.operational()) << rig.log();
  EXPECT_EQ(rig.log().find("absent"), std::string::npos) << "not all the time\n" << rig.log();
  EXPECT_EQ(rig.log().find("second device"), std::string::npos) << rig.log();
  rig.device("d").unplug();
  EXPECT_TRUE(rig.run_until([&] { return !rig.operational(); }, 60s)) << rig.log();
}

}  // namespace

// 500 ms are refused, and 1000 ms are not.
TEST(ErrorControl, ALowLimitIsFoundByAsking) {
  for (const unsigned own : {0U, 5000U}) {
    const std::string limit = "LowLimit=1000\n";
    Rig rig(machine(), plant_of({"low", with("100C 100D 1017", guarding + heartbeat("rw", own, limit))}));
    runs_and_is_missed(rig);
    EXPECT_NE(rig.log().find(own == 0 ? "it comes every 1000 ms" : "it comes every 5000 ms"), std::string::npos)
        << rig.log();
    EXPECT_NE(rig.log().find("1017h"), std::string::npos) << rig.log();
    EXPECT_NE(rig.log().find("0609003"), std::string::npos) << "the abort code is told\n" << rig.log();
  }
}

TEST(ErrorControl, AHighLimitIsFoundByAsking) {
  Rig rig(machine(), plant_of({"high", with("1017", heartbeat("rw", 100, "HighLimit=200\n"))}));
  runs_and_is_missed(rig);
}

TEST(ErrorControl, AConstantPeriodIsTakenAsItIs) {
  for (const unsigned period : {100U, 2000U, 5000U}) {
    Rig rig(machine(), plant_of({"constant", with("1017", heartbeat("ro", period))}));
    runs_and_is_missed(rig);
    rig.kill();
    rig.device("d").plug();
    rig.run_for(2s);
    // The next run does not know what this one has learnt.
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    rig.kill();
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << period << rig.log();
    rig.run_for(30s);
    ASSERT_TRUE(rig.until_operational(30s)) << period << rig.log();
    rig.run_for(60s);
    EXPECT_TRUE(rig.operational()) << period << rig.log();
  }
}

TEST(ErrorControl, WithoutAHeartbeatItIsAskedByGuarding) {
  Rig rig(machine(), plant_of({"guarding", with("100C 100D", guarding)}));
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  rig.run_for(60s);
  EXPECT_TRUE(rig.operational()) << rig.log();
  const auto slot = rig.network(0).report().front();
  EXPECT_EQ(slot.boot, manager::BootStatus::booted) << "guarding is error control, too";
  EXPECT_NE(slot.reason.find("it is watched by guarding, every 500 ms"), std::string::npos) << slot.reason;
  EXPECT_NE(slot.reason.find("06020000h"), std::string::npos) << slot.reason;
}

namespace {

std::uint32_t value(Rig& rig, ObjectRef object) {
  return rig.device("d").device().values().get_or<std::uint32_t>(object, 0);
}
bool is_absent(Rig& rig) { return rig.network(0).report().front().state == SlotState::absent; }

// A port that sends no remote frames, as socketcand's: nobody can be guarded.
class WithoutRemoteFrames final : public can::Port {
 public:
  explicit WithoutRemoteFrames(can::Port& beneath) : beneath_(&beneath) {}
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    return frame.remote ? can::Queued::closed : beneath_->send(frame, tag);
  }
  void withdraw(std::uint32_t tag) noexcept override { beneath_->withdraw(tag); }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    beneath_->listen(listener, accept);
  }
  [[nodiscard]] can::Status status() const noexcept override { return beneath_->status(); }
  bool restart(std::uint32_t bit_rate) noexcept override { return beneath_->restart(bit_rate); }

 private:
  can::Port* beneath_;
};

}  // namespace

TEST(ErrorControl, AGuardedDeviceThatLeavesIsMissedAndStartedWhenItIsBack) {
  Rig rig(machine(), plant_of({"guarded", with("100C 100D", guarding)}));
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  EXPECT_NE(rig.log().find("watched by guarding, every 500 ms"), std::string::npos) << rig.log();
  for (int time = 0; time < 3; ++time) {
    rig.device("d").unplug();
    ASSERT_TRUE(rig.run_until([&] { return is_absent(rig); }, 5s)) << rig.log();
    rig.run_for(10s);
    EXPECT_TRUE(is_absent(rig)) << rig.log();
    rig.device("d").plug();
    ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
    EXPECT_EQ(rig.device("d").truth().state, NmtState::operational);
  }
  // A cable that is cut tells no boot-up.
  sim::Controller* const cut[] = {&rig.device("d").controller()};
  rig.world().bus("backbone")->split(cut);
  ASSERT_TRUE(rig.run_until([&] { return is_absent(rig); }, 5s)) << rig.log();
  rig.run_for(5s);
  rig.world().bus("backbone")->join();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  // A new Berth finds it running.
  rig.kill();
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  rig.run_for(30s);
  EXPECT_TRUE(rig.operational()) << rig.log();
  rig.device("d").unplug();
  EXPECT_TRUE(rig.run_until([&] { return is_absent(rig); }, 5s)) << rig.log();
}

TEST(ErrorControl, AGuardedDeviceThatLeavesOperationalIsStartedAgain) {
  Rig rig(machine(), plant_of({"guarded-preop", with("100C 100D", guarding)}));
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  auto& nmt = rig.network(0).services().nmt;
  nmt.queue(co::NmtCommand::enter_pre_operational, NodeId(5));
  ASSERT_TRUE(rig.run_until([&] { return !rig.operational(); }, 5s)) << rig.log();
  ASSERT_TRUE(rig.until_operational(10s)) << rig.log();
  EXPECT_EQ(rig.device("d").truth().state, NmtState::operational);
}

TEST(ErrorControl, WithNeitherProtocolItIsAskedBySdo) {
  std::vector<std::unique_ptr<WithoutRemoteFrames>> ports;
  Rig rig(machine(), plant_of({"neither", with("1017", heartbeat("ro", 0))}));
  rig.put_between([&](can::Port& port, const std::string&) {
    return ports.emplace_back(std::make_unique<WithoutRemoteFrames>(port)).get();
  });
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  EXPECT_NE(rig.log().find("it is asked by SDO, every 1500 ms"), std::string::npos) << rig.log();
  const auto slot = rig.network(0).report().front();
  EXPECT_EQ(slot.boot, manager::BootStatus::k) << "nobody can say that it runs";
  EXPECT_NE(slot.reason.find("neither heartbeat"), std::string::npos) << slot.reason;
  rig.run_for(60s);
  ASSERT_TRUE(rig.operational()) << rig.log();
  rig.device("d").unplug();
  ASSERT_TRUE(rig.run_until([&] { return is_absent(rig); }, 10s)) << rig.log();
  EXPECT_NE(rig.log().find("it no longer answers SDO"), std::string::npos) << rig.log();
  rig.device("d").plug();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
}

// ---- what a slot says ----

TEST(ErrorControl, ASlotHasAPeriodOfItsOwn) {
  auto m = machine();
  m.slots.back().spec.watch.heartbeat_period = 100ms;
  Rig rig(m, plant_of({"own-period", with("1017", heartbeat("rw", 0))}));
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  rig.run_for(30s);
  ASSERT_TRUE(rig.operational()) << rig.log();
  EXPECT_EQ(value(rig, {0x1017, 0}), 100U);
  // In the bus's proportion, three to one; the bus's own would be 1.5 s.
  const auto at = rig.now();
  rig.device("d").unplug();
  ASSERT_TRUE(rig.run_until([&] { return is_absent(rig); }, 5s)) << rig.log();
  EXPECT_LE(rig.now() - at, 400ms);
}

TEST(ErrorControl, ASlotHasATimeoutOfItsOwn) {
  auto m = machine();
  m.slots.back().spec.watch.heartbeat_timeout = 6s;
  Rig rig(m, plant_of({"own-timeout", with("1017", heartbeat("rw", 0))}));
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  const auto at = rig.now();
  rig.device("d").unplug();
  ASSERT_TRUE(rig.run_until([&] { return is_absent(rig); }, 20s)) << rig.log();
  EXPECT_GE(rig.now() - at, 5s);
}

TEST(ErrorControl, GuardingIsWhatTheSlotSays) {
  auto m = machine();
  auto& watch = m.slots.back().spec.watch;
  watch.by = places::SlotWatch::By::guarding;
  watch.guard_time = 100ms;
  watch.life_time_factor = 4;
  Rig rig(m, plant_of({"guard-keys", with("100C 100D 1017", guarding + heartbeat("rw", 1000))}));
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  EXPECT_EQ(value(rig, {0x1017, 0}), 0U) << "a device beats or guards";
  EXPECT_EQ(value(rig, {0x100C, 0}), 100U);
  EXPECT_EQ(value(rig, {0x100D, 0}), 4U);
  const auto at = rig.now();
  rig.device("d").unplug();
  ASSERT_TRUE(rig.run_until([&] { return is_absent(rig); }, 5s)) << rig.log();
  EXPECT_LE(rig.now() - at, 600ms);
}

// A device that guards and refuses 1017h = 0 beats on and answers no guarding (CiA 301 §7.2.8.3.2).
TEST(ErrorControl, OneThatRefusesToSendNoHeartbeatIsWatchedByIt) {
  for (const bool also_guards : {true, false}) {
    auto m = machine();
    m.slots.back().spec.watch.by = places::SlotWatch::By::guarding;
    const std::string beats = heartbeat("rw", 5000, "LowLimit=1000\nHighLimit=60000\n");
    const std::string name = also_guards ? "beats-on" : "beats-on-alone";
    Rig rig(m, plant_of({name, also_guards ? with("100C 100D 1017", guarding + beats) : with("1017", beats)}));
    runs_and_is_missed(rig);
    EXPECT_NE(rig.log().find("it is watched by its heartbeat"), std::string::npos) << rig.log();
    EXPECT_EQ(rig.log().find("watched by guarding"), std::string::npos) << rig.log();
    rig.kill();
    rig.device("d").plug();
    rig.run_for(2s);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    rig.kill();
    rig.begin();  // it runs
    rig.run_for(60s);
    EXPECT_TRUE(rig.operational()) << rig.log();
    rig.device("d").unplug();
    EXPECT_TRUE(rig.run_until([&] { return !rig.operational(); }, 60s)) << rig.log();
  }
}

TEST(ErrorControl, NoneIsNotWatched) {
  auto m = machine();
  m.slots.back().spec.watch.by = places::SlotWatch::By::none;
  Rig rig(m, plant_of({"none", with("100C 100D 1017", guarding + heartbeat("rw", 700))}));
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  EXPECT_EQ(value(rig, {0x1017, 0}), 700U) << "1017h stays as it is";
  rig.device("d").unplug();
  rig.run_for(60s);
  EXPECT_TRUE(rig.operational()) << "nothing watches it\n" << rig.log();
  rig.device("d").plug();
  rig.run_for(20s);
  EXPECT_EQ(rig.device("d").truth().state, NmtState::operational) << "its boot-up is heard all the same\n" << rig.log();
}

// Its state is asked behind the start: a heartbeat of before, or the answer of a device that obeys late, is no refusal.
TEST(ErrorControl, AHeartbeatOfBeforeTheStartIsNoRefusal) {
  for (const auto response : {5ms, 900ms}) {
    auto m = machine();
    m.slots.back().spec.watch.by = places::SlotWatch::By::none;
    auto p = plant_of({"beats-quickly", with("1017", heartbeat("ro", 20))});
    p.devices.back().response = {response, response, 0, 0ms};
    Rig rig(m, p);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    EXPECT_EQ(rig.log().find("its error control reports"), std::string::npos) << rig.log();
  }
}

// It obeys later than Berth waits, and is started again.
TEST(ErrorControl, OneThatObeysTooLateIsStartedAgain) {
  auto m = machine();
  m.slots.back().spec.watch.by = places::SlotWatch::By::none;
  auto p = plant_of({"obeys-late", with("1017", heartbeat("ro", 100))});
  p.devices.back().response = {1300ms, 1300ms, 0, 0ms};
  Rig rig(m, p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(3min)) << rig.log();
  EXPECT_NE(rig.log().find("its error control reports"), std::string::npos) << "it was in time\n" << rig.log();
}

// ---- beside `config =` ----

TEST(ErrorControl, AConfigurationBesideAPeriodThatIsRefused) {
  for (const std::string& limits : {std::string("LowLimit=1000\n"), std::string()}) {
    const bool constant = limits.empty();
    const Described what{constant ? "config-constant" : "config-limit",
                         with("1017", heartbeat(constant ? "ro" : "rw", constant ? 2000 : 0, limits))};
    auto p = plant_of(what);
    auto m = machine();
    const std::string dcf = own_file(what.name + ".dcf");
    std::ofstream(dcf) << std::ifstream(p.devices.front().eds).rdbuf() << "[2000]\nParameterName=Limit\nObjectType=7\n"
                       << "DataType=6\nAccessType=rw\nDefaultValue=1\nParameterValue=9\n"
                       << "[ManufacturerObjects]\nSupportedObjects=1\n1=0x2000\n[DeviceComissioning]\nNodeID=5\n";
    p.devices.front().eds = p.devices.front().eds_path = dcf;
    m.slots.back().spec.config = dcf;
    Rig rig(m, p);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
    EXPECT_EQ(value(rig, {0x2000, 0}), 9U);
    EXPECT_EQ(value(rig, {0x1017, 0}), constant ? 2000U : 1000U);
    EXPECT_EQ(rig.log().find("failed"), std::string::npos) << rig.log();
    rig.run_for(30s);
    EXPECT_TRUE(rig.operational()) << rig.log();
  }
}

// ---- slow answers ----

// It answers guarding later than Berth waits: three questions, and three answers at their distance. They are no
// heartbeats that end (./run strangers, seeds 163 and 204).
TEST(ErrorControl, LateAnswersToGuardingAreNoHeartbeats) {
  for (const auto response : {450ms, 600ms}) {
    for (const bool guards : {false, true}) {
      auto m = machine();
      m.slots.back().spec.watch.sdo_timeout = 2s;
      if (guards) m.slots.back().spec.watch.by = places::SlotWatch::By::guarding;
      auto p = plant_of({"slow-guarding", with("100C 100D", guarding)});
      p.devices.front().response = {response, response, 0, 0ms};
      Rig rig(m, p);
      rig.begin();
      ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
      rig.run_for(120s);
      EXPECT_TRUE(rig.operational()) << rig.log();
      EXPECT_EQ(rig.log().find("absent"), std::string::npos) << rig.log();
      rig.device("d").unplug();
      EXPECT_TRUE(rig.run_until([&] { return rig.state(5) != places::SlotState::operational; }, 20s)) << rig.log();
    }
  }
}

TEST(ErrorControl, ASlowDeviceHasATimeoutOfItsOwn) {
  for (const bool says : {false, true}) {
    auto m = machine();
    if (says) m.slots.back().spec.watch.sdo_timeout = 1500ms;
    auto p = plant_of({"slow", with("1017", heartbeat("rw", 0))});
    p.devices.front().response = {900ms, 900ms, 0, 0ms};
    Rig rig(m, p);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    EXPECT_EQ(rig.network(0).services().sdo.late(NodeId(5)) == 0, says) << rig.log();
    EXPECT_EQ(rig.log().find("another device"), std::string::npos) << rig.log();
  }
}

}  // namespace error_control_tests
