// What a machine really publishes, as a reader sees it that shares no code: tests/sparkplug/reader.py.
#include <nlohmann/json.hpp>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <set>

#include "fleet_rig.hpp"

namespace berth::fleet::test {
namespace {

using Json = nlohmann::json;

int run_reader(const Folder& folder, const std::string& arguments) {
  const auto command = "PATH=/usr/bin:$PATH python3 '" + berth::test::source_dir() + "/tests/sparkplug/reader.py' " +
                       arguments + " <'" + folder.file("in") + "' >'" + folder.file("out") + "'";
  return WEXITSTATUS(std::system(command.c_str()));  // NOLINT(concurrency-mt-unsafe): nothing else changes it
}

std::string hex(const std::string& bytes) {
  std::string out;
  for (const char byte : bytes) out += fmt::format("{:02x}", static_cast<unsigned char>(byte));
  return out;
}

/// The machine by the other reader's words alone.
class OtherView {
 public:
  void take(MessageType type, const std::string& device, const Json& payload) {
    if (type == MessageType::nbirth) {
      EXPECT_EQ(payload.at("seq"), 0);
      next_ = 0;
      dead = false;
    }
    if (type == MessageType::ndeath) {
      EXPECT_EQ(payload.at("metrics").at(0).at("name"), "bdSeq");
      dead = true;
      return;
    }
    EXPECT_EQ(payload.at("seq"), next_) << "a number is missing";
    next_ = (next_ + 1) % 256;
    if (type == MessageType::ddeath) there.erase(device);
    if (type == MessageType::dbirth) there.insert(device);
    for (const auto& metric : payload.value("metrics", Json::array())) take(device, metric);
  }

  std::map<std::string, Json> values;  // "left/Slot/State"
  std::set<std::string> there;
  bool dead = false;

 private:
  void take(const std::string& device, const Json& metric) {
    std::string name = metric.value("name", "");
    if (metric.contains("alias")) {
      auto& known = names_[metric.at("alias")];
      if (!name.empty()) known = name;
      name = known;
    }
    ASSERT_NE(name, "") << metric.dump();
    if (metric.value("is_historical", false)) return;
    values[device + "/" + name] =
        metric.at("which").is_null() ? Json() : metric.at(metric.at("which").get<std::string>());
  }
  std::map<std::uint64_t, std::string> names_;
  unsigned next_ = 0;
};

}  // namespace

TEST(FleetReader, AnotherReaderSeesTheSameMachine) {
  NEEDS_BROKER();
  Folder folder;
  folder.write("in", "");
  if (run_reader(folder, "--check") != 0) GTEST_SKIP() << "needs mqtt: python3-protobuf is not installed";
  Broker broker;
  View view(broker);
  Rig rig(machine_text("", "publish = [\"Position value\", { object = \"Filter time\", poll = true }]\n"));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  rig.set_position(rig.device_in("left").name(), 70'000);
  ASSERT_TRUE(rig.until([&] { return view.is("left", "Signals/Position value", std::uint64_t{70'000}); }));
  ASSERT_TRUE(rig.until([&] { return view.is("left", "Signals/Filter time", std::uint64_t{10}); }));
  rig.device_in("right").unplug();
  ASSERT_TRUE(rig.until([&] { return view.is("", "Slots/right/State", std::string("absent")); }));
  ASSERT_TRUE(rig.until([&] { return view.count(MessageType::ddeath, "right") == 1; }));
  rig.fleet.reset();
  ASSERT_TRUE(rig.until([&] { return view.count(MessageType::ndeath) == 1; }));
  std::string input;
  for (const auto& each : view.said) input += hex(each.bytes) + "\n";
  folder.write("in", input);
  ASSERT_EQ(run_reader(folder, ""), 0);
  std::istringstream output(folder.read("out"));
  OtherView other;
  std::string line;
  for (const auto& each : view.said) {
    ASSERT_TRUE(std::getline(output, line));
    other.take(each.type, each.device, Json::parse(line));
  }
  EXPECT_EQ(other.there, std::set<std::string>{"left"});
  EXPECT_TRUE(other.dead);
  EXPECT_EQ(other.values["left/Signals/Position value"], 70'000);
  EXPECT_EQ(other.values["left/Signals/Filter time"], 10);
  EXPECT_EQ(other.values["left/Slot/State"], "operational");
  EXPECT_EQ(other.values["/Slots/right/State"], "absent");
  EXPECT_EQ(other.values["/Machine/Operational"], false);
  EXPECT_EQ(other.values["left/Device/Vendor ID"], 1);
}

}  // namespace berth::fleet::test
