// `berth fleet`, its show and its roll-out, as a person runs them: against Mosquitto and machines in processes of their
// own.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "../mqtt/heard.hpp"
#include "../pch.hpp"
#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using Json = nlohmann::json;

/// Filter time (2000h) = 20.
std::string concise_dcf() { return std::string("\x01\0\0\0\x00\x20\0\x02\0\0\0\x14\0", 13); }

/// Machines with one sensor each, in slot "s", at one broker.
class Fleets : public ::testing::Test {
 protected:
  void SetUp() override {
    NEEDS_BROKER();
    broker.emplace();
  }
  /// Of its bus: the slots, and the plant's devices.
  void begin(const std::string& name, const std::string& slots, const std::string& devices,
             const std::string& commands = "\"configure\"") {
    const auto machine =
        folder.write(name + ".toml", fmt::format("[machine]\nname = \"{}\"\n[mqtt]\nbroker = \"{}\"\ngroup = \"hall\"\n"
                                                 "commands = [{}]\n[bus.field]\nport = \"sim\"\nbitrate = 250_000\n{}",
                                                 name, mqtt::to_string(broker->where()), commands, slots));
    const auto plant = folder.write(name + ".plant.toml", "[plant]\nseed = 3\n[bus.field]\n" + devices);
    machines.push_back(
        std::make_unique<Background>(Words{"up", machine, "--sim", plant, "--pace", "--store",
                                           folder.file(name + ".db"), "--control", folder.file(name + ".control")}));
  }
  static std::string slot(int id, const std::string& name) {
    return fmt::format("[[slot]]\nbus = \"field\"\nid = {}\nname = \"{}\"\neds = \"eds/sensor.eds\"\n", id, name);
  }
  static std::string device(int serial, const std::string& eds = "eds/sensor.eds") {
    return fmt::format("[[device]]\nbus = \"field\"\nname = \"d{}\"\neds = \"{}\"\nserial = {}\n", serial, eds, serial);
  }
  [[nodiscard]] std::string url() const { return mqtt::to_string(broker->where()); }
  [[nodiscard]] Json fleet(int status) const {
    const auto outcome = berth({"fleet", url(), "--json"});
    EXPECT_EQ(outcome.status, status) << outcome.out << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  }
  /// All of them are operational at the broker.
  [[nodiscard]] bool all_are_up(std::size_t count) const {
    return eventually([&] {
      const auto seen = Json::parse(berth({"fleet", url(), "--json"}).out, nullptr, false);
      if (!seen.is_object() || seen.at("machines").size() != count) return false;
      return std::ranges::all_of(seen.at("machines"), [](const Json& m) { return m.at("operational") == true; });
    });
  }

  std::optional<mqtt::test::Broker> broker;
  Folder folder;
  std::vector<std::unique_ptr<Background>> machines;
};

TEST_F(Fleets, ThreeMachinesOfWhichOneLostADrive) {
  static_cast<void>(folder.bring("eds/sensor.eds"));
  begin("press-1", slot(1, "left"), device(1));
  begin("press-2", slot(1, "left") + slot(2, "drive"),
        device(1) + device(2) +
            "[[event]]\nafter = \"operational\"\ndelay = \"1 s\"\naction = \"unplug\"\ndevice = \"d2\"\n");
  begin("press-3", slot(1, "left"), device(1));
  ASSERT_TRUE(eventually([&] {
    const auto text = berth({"fleet", url()}).out;
    return text.find("1 of 3 machines needs somebody") != std::string::npos &&
           text.find("slot drive: absent") != std::string::npos;
  })) << berth({"fleet", url()}).out;
  const auto seen = fleet(1);
  ASSERT_EQ(seen.at("machines").size(), 3U);
  EXPECT_EQ(seen["machines"][0]["needs_somebody"], false);
  EXPECT_EQ(seen["machines"][1]["machine"], "press-2");
  EXPECT_EQ(seen["machines"][1]["needs_somebody"], true);
  EXPECT_EQ(seen["machines"][2]["operational"], true);

  const auto shown = berth({"fleet", "show", "press-2", "--broker", url()});
  EXPECT_EQ(shown.status, 1);
  EXPECT_NE(shown.out.find("hall/press-2: not operational"), std::string::npos) << shown.out;
  EXPECT_NE(shown.out.find("slot left: operational"), std::string::npos);
  EXPECT_EQ(berth({"fleet", "show", "hall/press-3", "--broker", url()}).status, 0);
  const auto none = berth({"fleet", "show", "press-4", "--broker", url()});
  EXPECT_EQ(none.status, 1);
  EXPECT_NE(none.err.find("no machine press-4"), std::string::npos) << none.err;

  // What has changed since then: one machine ended.
  const auto before = folder.write("before.json", berth({"fleet", url(), "--json"}).out);
  machines[2]->signal(SIGTERM);
  static_cast<void>(machines[2]->end());
  const auto since = berth({"fleet", url(), "--since", before});
  EXPECT_NE(since.out.find("hall/press-3: not heard of now"), std::string::npos) << since.out;
}

TEST_F(Fleets, ARollOutToTenStopsAtTheOneThatFailsAndGoesOn) {
  static_cast<void>(folder.bring("eds/sensor.eds"));
  // Its device takes no filter time above 15, though its slot's description says so.
  auto narrow = contents(example("eds/sensor.eds"));
  const auto limit = narrow.find("HighLimit=1000", narrow.find("[2000]"));
  ASSERT_NE(limit, std::string::npos);
  narrow.replace(limit, std::string("HighLimit=1000").size(), "HighLimit=15");
  folder.write("eds/narrow.eds", narrow);
  for (int i = 0; i < 10; ++i)
    begin(fmt::format("m{}", i), slot(1, "s"), device(1, i == 4 ? "eds/narrow.eds" : "eds/sensor.eds"));
  ASSERT_TRUE(all_are_up(10));
  const auto file = folder.write("new.cdcf", concise_dcf());
  Words words{"fleet", "roll-out",          file,        "--slot", "s",        "--group", "hall", "--at-most",
              "3",     "--stop-on-failure", "--timeout", "60 s",   "--broker", url()};
  const auto plan = berth(words);
  EXPECT_EQ(plan.status, 1) << "nobody confirmed it";
  EXPECT_NE(plan.err.find("--yes"), std::string::npos) << plan.err;
  words.push_back("--yes");
  const auto first = berth(words);
  EXPECT_EQ(first.status, 1) << first.out << first.err;
  EXPECT_NE(first.out.find("hall/m4: failed: "), std::string::npos) << first.out;
  EXPECT_NE(first.out.find("5 of 10 done, 1 failed, 4 not begun"), std::string::npos) << first.out;
  for (const int done : {0, 1, 2, 3, 5})
    EXPECT_NE(first.out.find(fmt::format("hall/m{}: done", done)), std::string::npos) << first.out;
  // It goes on; the one that fails does so again.
  std::erase(words, "--stop-on-failure");
  words.push_back("--json");
  const auto second = Json::parse(berth(words).out, nullptr, false);
  ASSERT_TRUE(second.is_object());
  EXPECT_EQ(second.at("done"), 9);
  EXPECT_EQ(second.at("failed"), 1);
  ASSERT_EQ(second.at("machines").size(), 5U) << "those that have it are left alone";
  EXPECT_EQ(second["machines"][0]["machine"], "m4");
  // What the device holds, by SDO.
  const auto held =
      berth({"sdo", "read", "s", "2000h", "--control", folder.file("m7.control"), "-m", folder.file("m7.toml")});
  EXPECT_NE(held.out.find("20"), std::string::npos) << held.out << held.err;
}

TEST(FleetCommand, WrongUse) {
  EXPECT_EQ(berth({"fleet", "localhost:1883"}).status, 2);
  const auto none = berth({"fleet"});
  EXPECT_EQ(none.status, 2);
  EXPECT_NE(none.err.find("BERTH_BROKER"), std::string::npos) << none.err;
  EXPECT_EQ(berth({"fleet", "mqtt://127.0.0.1:1"}).status, 3) << "nothing listens there";
  EXPECT_EQ(berth({"fleet", "mqtt://127.0.0.1:1", "--since", "/nowhere"}).status, 2);
  EXPECT_EQ(berth({"fleet", "roll-out", "/nowhere.dcf", "--slot", "s", "--broker", "mqtt://127.0.0.1:1"}).status, 2);
}

}  // namespace
}  // namespace berth::test
