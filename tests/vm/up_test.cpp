// The main job on a kernel's CAN: `berth up` with `berth device` processes as the devices, from blank to operational;
// one of them killed and another one put in its place; the interface down and up.
#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "../paths.hpp"
#include "interface.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using namespace std::chrono_literals;

const std::string machine = berth::test::source_dir() + "/examples/five-slaves.toml";
const std::string plant = berth::test::source_dir() + "/examples/five-slaves.plant.toml";

class Up : public testing::Test {
 protected:
  void SetUp() override {
    if (const auto why = no_interface("vcan0"); !why.empty()) GTEST_SKIP() << "needs vm: " << why;
    vcan.emplace("vt0");
    others.emplace(place, "others",
                   Words{"device", plant, "--port", "socketcan:vt0", "--device", "s1", "--device", "s3", "--device",
                         "s4", "--device", "s5", "--json"});
    second.emplace(place, "s2", Words{"device", plant, "--port", "socketcan:vt0", "--device", "s2", "--json"});
    up.emplace(place, "up",
               Words{"up", machine, "--port", "socketcan:vt0", "--yes", "--store", place.file("slots.db"), "--control",
                     place.file("control")});
  }
  void TearDown() override {
    if (!HasFailure()) return;
    for (const char* const name : {"up.out", "up.err", "others.out", "others.err", "s2.out", "s2.err", "new.out"}) {
      std::printf("---- %s\n%s", name, read_whole(place.file(name)).c_str());
    }
  }
  /// The node-ID that the device has in the last line about it, when it is operational there; else 0.
  static unsigned operational(const Running& process, const std::string& device) {
    std::istringstream lines(process.out());
    std::string line;
    unsigned id = 0;
    while (std::getline(lines, line)) {
      const auto json = nlohmann::json::parse(line, nullptr, false);
      if (json.is_discarded() || json.value("event", "") != "changed" || json.value("device", "") != device) continue;
      id = json.at("state") == "operational" ? json.at("node_id").get<unsigned>() : 0;
    }
    return id;
  }
  bool everybody() {
    return operational(*others, "s1") == 1 && operational(*others, "s3") == 3 && operational(*others, "s4") == 4 &&
           operational(*others, "s5") == 5;
  }
  /// What the running `berth up` reports: how many of the five slots are operational.
  long slots_operational() {
    Running status(place, "status", {"status", "--machine", machine, "--control", place.file("control"), "--json"});
    status.wait();
    const auto json = nlohmann::json::parse(status.out(), nullptr, false);
    if (json.is_discarded() || !json.contains("slots")) return -1;
    return std::ranges::count_if(json.at("slots"), [](const auto& slot) { return slot.at("state") == "operational"; });
  }

  using Words = std::vector<std::string>;
  std::optional<Vcan> vcan;
  Place place;
  std::optional<Running> others, second, up;
};

TEST_F(Up, FromBlankToOperationalAndAKilledDeviceIsReplaced) {
  ASSERT_TRUE(up->says("field  operational"));
  EXPECT_TRUE(everybody());
  EXPECT_EQ(operational(*second, "s2"), 2U);
  second->kill();
  Running replacement(place, "new", {"device", plant, "--port", "socketcan:vt0", "--device", "s2 new", "--json"});
  ASSERT_TRUE(eventually([&] { return operational(replacement, "s2 new") == 2; }));
  // Its heartbeats tell Berth so.
  ASSERT_TRUE(eventually([&] { return slots_operational() == 5; }));
  EXPECT_TRUE(everybody()) << "the others went on";
  up->signal(SIGTERM);
  EXPECT_EQ(up->wait(), 0);
}

TEST_F(Up, InterfaceDownAndUp) {
  ASSERT_TRUE(up->says("field  operational"));
  ASSERT_TRUE(eventually([&] { return slots_operational() == 5; }));
  vcan->down();
  EXPECT_TRUE(eventually([&] {
    const auto count = slots_operational();
    return count >= 0 && count < 5;
  })) << "it is noticed";
  vcan->up();
  EXPECT_TRUE(eventually([&] { return slots_operational() == 5; })) << "and all come back";
  EXPECT_TRUE(up->running());
}

// The network time arrives late, or a battery is empty. Berth's own time is the kernel's monotonic one.
TEST_F(Up, TheClockIsSetBackAndForth) {
  if (!std::filesystem::exists("/run/berth-vm/started")) GTEST_SKIP() << "needs vm: it sets the computer's clock";
  const auto set = [](std::chrono::hours by) {
    timespec now{};
    ::clock_gettime(CLOCK_REALTIME, &now);
    now.tv_sec += std::chrono::seconds(by).count();
    return ::clock_settime(CLOCK_REALTIME, &now) == 0;
  };
  ASSERT_TRUE(up->says("field  operational"));
  ASSERT_TRUE(set(-24h));
  second->kill();
  ASSERT_TRUE(eventually([&] { return slots_operational() == 4; })) << "its silence is noticed";
  Running replacement(place, "new", {"device", plant, "--port", "socketcan:vt0", "--device", "s2 new", "--json"});
  ASSERT_TRUE(eventually([&] { return operational(replacement, "s2 new") == 2; }));
  ASSERT_TRUE(set(72h));
  ASSERT_TRUE(eventually([&] { return slots_operational() == 5; }));
  replacement.kill();
  EXPECT_TRUE(eventually([&] { return slots_operational() == 4; }));
  EXPECT_TRUE(everybody()) << "nobody else was lost";
  EXPECT_TRUE(up->running());
}

}  // namespace
}  // namespace berth::test
