// Machines for a reader that wants only what is new.
#include "berth/fleet/machine_list.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "berth/fleet/machines_json.hpp"

namespace berth::fleet::test {
namespace {

MachineView line(const std::string& name, const std::string& version = "1") {
  return {.id = {"hall", name}, .online = true, .is_berth = true, .operational = true, .version = version};
}

std::vector<std::string> names_in(const MachineList::Part& part) {
  std::vector<std::string> names;
  if (part.machines.empty()) return names;
  for (const auto& each : nlohmann::json::parse(part.machines)) names.push_back(each.at("machine"));
  return names;
}

using Names = std::vector<std::string>;

}  // namespace

TEST(FleetMachineList, GivesAllAtFirstAndThenWhatChanged) {
  MachineLister lister;
  const auto first = lister.take({line("a"), line("b")});
  const auto all = first->since(0);
  EXPECT_TRUE(all.whole);
  EXPECT_FALSE(all.more);
  EXPECT_EQ(names_in(all), (Names{"a", "b"}));
  EXPECT_TRUE(first->since(all.changes).machines.empty());
  EXPECT_EQ(lister.take({line("a"), line("b")}), nullptr) << "nothing differs";
  const auto second = lister.take({line("a"), line("b", "2"), line("c")});
  const auto news = second->since(all.changes);
  EXPECT_FALSE(news.whole);
  EXPECT_EQ(names_in(news), (Names{"b", "c"}));
  EXPECT_TRUE(second->since(news.changes).machines.empty());
  EXPECT_EQ(second->since(news.changes).changes, news.changes);
  EXPECT_EQ(names_in(first->since(0)), (Names{"a", "b"})) << "an earlier list stays as it was";
}

// A part is bounded, and the next begins where it ended.
TEST(FleetMachineList, GivesALongListInParts) {
  MachineLister lister;
  std::vector<MachineView> machines;
  for (int i = 0; i < 9; ++i) machines.push_back(line(std::to_string(i)));
  const auto list = lister.take(machines);
  const std::size_t one = list->since(0, 1).machines.size();
  Names seen;
  std::uint64_t number = 0;
  int parts = 0;
  for (bool more = true; more; ++parts) {
    const auto part = list->since(number, 4 * one);
    EXPECT_LE(part.machines.size(), 4 * one);
    EXPECT_EQ(part.whole, parts == 0);
    const auto names = names_in(part);
    ASSERT_FALSE(names.empty()) << "at least one";
    seen.insert(seen.end(), names.begin(), names.end());
    number = part.changes;
    more = part.more;
  }
  EXPECT_EQ(seen, (Names{"0", "1", "2", "3", "4", "5", "6", "7", "8"}));
  EXPECT_EQ(parts, 3);
  EXPECT_EQ(names_in(list->since(0, 1)), Names{"0"}) << "one that is larger than the bound comes by itself";
}

TEST(FleetMachineList, BeginsAnewWhenAMachineHasGone) {
  MachineLister lister;
  const auto before = lister.take({line("a"), line("b")})->since(0);
  const auto list = lister.take({line("a")});
  ASSERT_NE(list, nullptr);
  const auto part = list->since(before.changes);
  EXPECT_TRUE(part.whole);
  EXPECT_EQ(names_in(part), Names{"a"});
  const auto none = lister.forget()->since(part.changes);
  EXPECT_TRUE(none.whole);
  EXPECT_EQ(none.machines, "[]");
  EXPECT_NE(none.changes, part.changes);
  EXPECT_TRUE(lister.forget()->since(none.changes).whole);
}

TEST(FleetMachineList, GivesAllToAReaderOfAnotherList) {
  MachineLister lister;
  const auto list = lister.take({line("a")});
  const auto part = list->since(4711);
  EXPECT_TRUE(part.whole);
  EXPECT_EQ(names_in(part), Names{"a"});
  EXPECT_TRUE(MachineList().since(0).machines.empty());
  EXPECT_EQ(MachineList().since(4711).machines, "[]");
}

TEST(FleetMachineList, HasTheJsonOfTheCommand) {
  auto machine = line("a");
  machine.slots.push_back({.name = "drive", .state = "absent", .reason = "no heartbeat", .needs = true});
  machine.operational = false;
  machine.studio = "http://10.0.0.1:8302/";
  machine.bus_trouble = {"bus field is bus-off"};
  machine.since.ms = 1'767'225'600'000;
  const auto json = nlohmann::ordered_json::parse(MachineLister().take({machine})->since(0).machines).at(0);
  EXPECT_EQ(json, machine_json(machine));
  EXPECT_EQ(machine_of_json(json), machine);
  EXPECT_EQ(json.at("reason"), "bus field is bus-off; slot drive: absent, no heartbeat");
}

}  // namespace berth::fleet::test
