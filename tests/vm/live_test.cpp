// What makes Berth safe to plug in, on a kernel's CAN: it asks before it begins, shares its port with no other process,
// yields to another master, and finds a bit rate by listening. And: its priority, when it is told one.
#include <gtest/gtest.h>
#include <sched.h>
#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "../paths.hpp"
#include "asker.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using namespace std::chrono_literals;
using Words = std::vector<std::string>;
using Json = nlohmann::json;

const char* const one_slot = R"(
[machine]
name = "one"
[bus.field]
port = "socketcan:vt0"
bitrate = 125_000
[[slot]]
bus = "field"
id = 9
name = "only"
type = { vendor = 0x0000_0001, product = 0x0000_0002 }
)";

const char* const one_device = R"(
[plant]
seed = 1
[bus.field]
bitrate = 125_000
[[device]]
bus = "field"
name = "d"
type = { vendor = 0x0000_0001, product = 0x0000_0002 }
serial = 0x0A
)";

class LiveOnVcan : public testing::Test {
 protected:
  void SetUp() override {
    if (const auto why = no_interface("vcan0"); !why.empty()) GTEST_SKIP() << "needs vm: " << why;
    vcan.emplace("vt0");
    machine = place.write("one.toml", one_slot);
    plant = place.write("plant.toml", one_device);
  }
  /// A command that ends by itself: its exit status; what it said is in `said`.
  int run(Words words) {
    Running process(place, "command", std::move(words));
    const int status = process.wait();
    said = process.out() + process.err();
    return status;
  }
  [[nodiscard]] bool told(const std::string& text) const { return said.find(text) != std::string::npos; }

  std::optional<Vcan> vcan;
  Place place;
  std::string machine, plant, said;
};

TEST_F(LiveOnVcan, TheFirstStartAndTheResetOfARunningDeviceAreConfirmed) {
  Running device(place, "device", {"device", plant, "--port", "socketcan:vt0"});
  Asker ear("vt0");
  EXPECT_EQ(run({"up", machine}), 1);
  EXPECT_TRUE(told("--yes")) << said;
  ear.listen_for(200ms);
  EXPECT_FALSE(ear.heard("7E5#0400000000000000")) << "nothing is sent unconfirmed";
  const std::string control = place.file("control");
  Running up(place, "up", {"up", machine, "--yes", "--control", control});
  ASSERT_TRUE(up.says("field  operational")) << up.out() << up.err();
  const Words reset{"nmt", "reset-node", "9", "--machine", machine, "--control", control};
  EXPECT_EQ(run(reset), 1);
  EXPECT_TRUE(told("is operational")) << said;
  ear.listen_for(200ms);
  EXPECT_FALSE(ear.heard("000#8109"));
  Words confirmed = reset;
  confirmed.emplace_back("--yes");
  EXPECT_EQ(run(confirmed), 0) << said;
  EXPECT_TRUE(ear.hears("000#8109"));
}

// The machine that Berth runs on had no time for it, longer than a heartbeat may stay away: those that came meanwhile
// count, and a device that has gone is told all the same.
TEST_F(LiveOnVcan, ABerthThatWasHeldUpTellsNoDeviceAbsentThatSentItsHeartbeats) {
  Running device(place, "device", {"device", plant, "--port", "socketcan:vt0"});
  Asker ear("vt0");
  Running up(place, "up", {"up", machine, "--yes", "--control", place.file("control")});
  ASSERT_TRUE(up.says("field  operational")) << up.out() << up.err();
  for (const auto before : {0s, 1s}) {  // with work in hand, asleep
    ear.listen_for(before);
    up.signal(SIGSTOP);
    ear.listen_for(4s);
    up.signal(SIGCONT);
    ear.listen_for(2s);
    EXPECT_EQ(up.out().find("absent"), std::string::npos) << up.out();
  }
  device.signal(SIGSTOP);
  EXPECT_TRUE(up.says("absent: heartbeat lost")) << up.out();
  device.signal(SIGCONT);
}

TEST_F(LiveOnVcan, APortBelongsToOneProcess) {
  Running device(place, "device", {"device", plant, "--port", "socketcan:vt0"});
  Running up(place, "up", {"up", machine, "--yes", "--control", place.file("control")});
  ASSERT_TRUE(up.says("field  operational")) << up.out() << up.err();
  const std::string other = place.write("other.toml", one_slot);
  EXPECT_EQ(run({"scan", "--machine", other}), 3) << said;
  EXPECT_TRUE(told("socketcan:vt0")) << said;
  EXPECT_TRUE(told(std::to_string(up.pid()))) << "who has it: " << said;
  EXPECT_EQ(run({"up", other, "--yes", "--control", place.file("another")}), 3) << said;
  EXPECT_TRUE(up.running());
}

TEST_F(LiveOnVcan, BesideAnotherMasterItRefuses) {
  Asker master("vt0");
  Running up(place, "up", {"up", machine, "--yes", "--control", place.file("control")});
  EXPECT_TRUE(eventually([&] {
    master.send("000#0100");
    master.listen_for(100ms);
    return !up.running();
  }));
  EXPECT_EQ(up.wait(), 1);
  EXPECT_NE(up.err().find("another master is on this bus"), std::string::npos) << up.out() << up.err();
  EXPECT_NE(up.err().find("000#0100"), std::string::npos) << up.err();
  EXPECT_FALSE(master.heard("7E5#0400000000000000")) << "it never wrote";
}

TEST_F(LiveOnVcan, RealTimeIsWhatItIsTold) {
  Running device(place, "device", {"device", plant, "--port", "socketcan:vt0", "--real-time", "7"});
  Asker ear("vt0");
  ASSERT_TRUE(ear.ask("7E5#4C00000000000000", "7E4#5000000000000000")) << device.err();
  EXPECT_EQ(::sched_getscheduler(device.pid()) & ~SCHED_RESET_ON_FORK, SCHED_FIFO);
  sched_param parameters{};
  ASSERT_EQ(::sched_getparam(device.pid(), &parameters), 0);
  EXPECT_EQ(parameters.sched_priority, 7);
  EXPECT_EQ(run({"device", plant, "--port", "socketcan:vt0", "--real-time", "100"}), 2) << said;
}

TEST_F(LiveOnVcan, AVirtualInterfaceHasNoBitRateToFind) {
  EXPECT_EQ(run({"scan", "--bitrate", "auto", "--port", "socketcan:vt0"}), 1);
  EXPECT_TRUE(told("a virtual interface has no bit rate")) << said;
}

// The emulated controllers hear each other whatever their rates, so the first rate is the one; what is tested is that
// nothing is sent, that a silent bus is undecidable, and that the interface is as it was before.
class LiveOnControllers : public LiveOnVcan {
 protected:
  void SetUp() override {
    if (const auto why = no_interface("can1"); !why.empty()) GTEST_SKIP() << "needs vm: " << why;
    ASSERT_TRUE(
        shell("ip link set can0 down; ip link set can1 down; "
              "ip link set can0 up type can listen-only off bitrate 250000 && "
              "ip link set can1 up type can listen-only off bitrate 250000"));
    ASSERT_TRUE(runs("can0") && runs("can1"));
  }
  static bool shows(const std::string& words) { return shell("ip -details link show can0 | grep -q '" + words + "'"); }
};

TEST_F(LiveOnControllers, TheBitRateIsFoundByListening) {
  const Words scan{"scan", "--bitrate", "auto", "--port", "socketcan:can0", "--timeout", "1", "--json"};
  Asker other("can1");
  EXPECT_EQ(run(scan), 1) << said;
  const Json silent = Json::parse(said, nullptr, false);
  ASSERT_FALSE(silent.is_discarded()) << said;
  EXPECT_TRUE(silent.at("bitrate").is_null());
  EXPECT_NE(silent.at("what").get<std::string>().find("silent: its bit rate cannot be found"), std::string::npos)
      << said;
  EXPECT_EQ(silent.at("heard").size(), 8U) << "every rate of CiA 301: " << said;
  EXPECT_TRUE(shows("bitrate 250000"));
  EXPECT_FALSE(shows("LISTEN-ONLY"));
  Running process(place, "heard", scan);
  EXPECT_TRUE(eventually([&] {
    other.send("705#05");
    other.listen_for(50ms);
    return !process.running();
  }));
  EXPECT_EQ(process.wait(), 0) << process.out() << process.err();
  const Json heard = Json::parse(process.out(), nullptr, false);
  ASSERT_FALSE(heard.is_discarded()) << process.out();
  EXPECT_TRUE(heard.at("bitrate").is_number()) << process.out();
  EXPECT_FALSE(shows("LISTEN-ONLY"));
  other.listen_for(200ms);
  EXPECT_EQ(other.count(), 0U) << "it only listened";
}

}  // namespace
}  // namespace berth::test
