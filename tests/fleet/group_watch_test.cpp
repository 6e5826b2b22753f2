// What the Studio of a machine learns of the other machines of its group.
#include "berth/fleet/group_watch.hpp"

#include <nlohmann/json.hpp>

#include "fleet_rig.hpp"

namespace berth::fleet::test {
namespace {

using Json = nlohmann::json;

GroupWatch::Options group_options(const Broker& broker, std::chrono::milliseconds idle = 60s) {
  return {.connection = mqtt::test::quick(broker.where(), "overwritten"), .id = {"berth", "line"}, .idle = idle};
}

// As a page does: asks with the number of the last answer, and keeps what it got.
class PageOf {
 public:
  explicit PageOf(GroupWatch& watch) : watch_(&watch) {}
  void ask() {
    answer = Json::parse(watch_->answer(changes));
    changes = answer.at("changes");
    if (!answer.contains("machines")) return;
    if (answer.at("whole")) machines.clear();
    for (const auto& each : answer.at("machines")) machines[each.at("machine")] = each;
  }
  bool operational(const std::string& machine) {
    ask();
    return machines.contains(machine) && machines[machine].at("operational") == true;
  }

  Json answer;
  std::uint64_t changes = 0;
  std::map<std::string, Json> machines;

 private:
  GroupWatch* watch_;
};

}  // namespace

TEST(FleetGroupWatch, SeesTheMachinesOfItsOwnGroup) {
  NEEDS_BROKER();
  Broker broker;
  Rig line(machine_text("", ""));
  auto with_studio = to(broker);
  with_studio.studio = "http://10.0.0.1:8302/";
  ASSERT_EQ(line.publish(with_studio), "");
  Rig other(machine_text("[mqtt]\nbroker = \"mqtt://127.0.0.1\"\ngroup = \"hall-9\"\n", "", "elsewhere"));
  ASSERT_EQ(other.publish(to(broker)), "");
  ASSERT_TRUE(other.up());
  GroupWatch watch(group_options(broker), Random(3));
  PageOf reader(watch);
  reader.ask();
  EXPECT_EQ(reader.answer.at("changes"), 0) << "it only begins";
  EXPECT_FALSE(reader.answer.contains("machines"));
  ASSERT_TRUE(line.until([&] { return reader.operational("line"); }));
  other.run(100ms);
  EXPECT_EQ(reader.machines.size(), 1U) << "the other is in another group";
  const auto& seen = reader.machines["line"];
  EXPECT_EQ(seen.at("group"), "berth");
  EXPECT_EQ(seen.at("version"), "test");
  EXPECT_EQ(seen.at("studio"), "http://10.0.0.1:8302/");
  EXPECT_EQ(seen.at("slots").size(), 2U);
  EXPECT_EQ(reader.answer.at("connected"), true);
  // Nothing is new until something is.
  line.device_in("left").unplug();
  ASSERT_TRUE(line.until([&] { return !reader.operational("line"); }));
  EXPECT_EQ(reader.machines["line"].at("needs_somebody"), true);
  EXPECT_NE(reader.machines["line"].at("reason").get<std::string>().find("slot left: absent"), std::string::npos);
  EXPECT_EQ(reader.answer.at("whole"), false) << "only what changed";
  ASSERT_TRUE(line.until([&] {
    reader.ask();
    return !reader.answer.contains("machines");
  }));
}

// It is at the broker only while somebody asks.
TEST(FleetGroupWatch, EndsWhenNobodyAsksAndComesBack) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig line(machine_text("", ""));
  ASSERT_EQ(line.publish(to(broker)), "");
  GroupWatch watch(group_options(broker, 1500ms), Random(3));
  PageOf reader(watch);
  ASSERT_TRUE(line.until([&] { return reader.operational("line"); }));
  const auto states = [&] {
    std::vector<std::string> told;
    for (const auto& message : view.station().heard.story().messages) {
      if (message.topic == "spBv1.0/STATE/berth-studio-berth-line") told.push_back(message.payload);
    }
    return told;
  };
  ASSERT_TRUE(line.until([&] { return !states().empty() && states().back().find("false") != std::string::npos; }));
  ASSERT_TRUE(line.until(
      [&] { return broker.log().find("Client berth-studio-berth-line disconnected") != std::string::npos; }));
  const auto before = reader.changes;
  const auto since = reader.machines["line"].at("since_ms");
  ASSERT_TRUE(line.until([&] { return reader.operational("line") && reader.answer.at("connected") == true; }));
  EXPECT_GT(reader.changes, before);
  EXPECT_EQ(reader.machines["line"].at("since_ms"), since) << "a birth for another host is no change";
}

// A broker that is not there, and a login that is not right, are said in words.
TEST(FleetGroupWatch, SaysWhyItIsNotConnected) {
  NEEDS_BROKER();
  const mqtt::Where nobody{false, "127.0.0.1", mqtt::test::free_port()};
  GroupWatch alone({.connection = mqtt::test::quick(nobody, "x"), .id = {"berth", "line"}}, Random(3));
  PageOf reader(alone);
  const auto told = [](PageOf& of) {
    const auto end = std::chrono::steady_clock::now() + mqtt::test::patience;
    do {
      of.ask();
      std::this_thread::sleep_for(20ms);
    } while (of.answer.at("trouble") == "" && std::chrono::steady_clock::now() < end);
    return of.answer.at("trouble").get<std::string>();
  };
  EXPECT_NE(told(reader).find("127.0.0.1"), std::string::npos) << reader.answer;
  EXPECT_EQ(reader.answer.at("connected"), false);
  const Folder folder;
  auto options = GroupWatch::Options{.connection = mqtt::test::quick(nobody, "x"), .id = {"berth", "line"}};
  options.connection.login_file = folder.file("none");
  GroupWatch without(options, Random(3));
  PageOf other(without);
  EXPECT_NE(told(other).find(folder.file("none")), std::string::npos) << other.answer;
}

}  // namespace berth::fleet::test
