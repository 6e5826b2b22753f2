// Devices of one LSS address on two buses (most have no serial number), and devices that are moved from one bus to
// another: an address is one device's within one network only, so each bus knows its own.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/harness/duplicate_watch.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;

namespace twins_tests {
namespace {

constexpr const char* first_bus = "backbone";
constexpr const char* second_bus = "second";

// One slot of one type on each of two buses: "s1" on the first, "second s1" or "second s2" on the other.
design::Machine two_buses(unsigned second_id = 1, const std::string& name = "rig") {
  design::Machine m = one_bus(125'000);
  m.name = name;
  design::Bus second = m.buses.front();
  second.name = second_bus;
  m.buses.push_back(second);
  add_slot(m, 1, type_b, first_bus);
  add_slot(m, second_id, type_b, second_bus);
  return m;
}

plant::PlantFile two_bus_plant() {
  auto p = one_bus_plant(1);
  p.buses.push_back({second_bus, 0});
  return p;
}

// A device as it is when it comes from elsewhere with this node-ID in its memory; on the shelf until it is plugged.
void add_from_elsewhere(plant::PlantFile& p, const std::string& name, std::uint32_t serial, const std::string& bus,
                        unsigned id) {
  auto& d = add_device(p, name, type_b, serial, bus);
  d.plugged = false;
  d.source = plant::NodeIdSource::nonvolatile;
  d.node_id = NodeId(static_cast<std::uint8_t>(id));
}

plant::PlantFile twins(std::uint32_t serial = 0) {
  auto p = two_bus_plant();
  add_device(p, "one", type_b, serial, first_bus);
  add_device(p, "two", type_b, serial, second_bus);
  return p;
}

LssAddress with_serial(std::uint32_t serial) { return {type_b.vendor, type_b.product, 0, serial}; }
// One without a serial number is known by the node-ID of its slot.
places::BusDevice on(const std::string& bus, std::uint32_t serial) {
  return {Identity(with_serial(serial)).with(NodeId(1)), {"rig", bus}};
}

operate::SlotReport slot(Rig& rig, std::size_t bus) { return rig.network(bus).report().front(); }
SlotState state(Rig& rig, std::size_t bus) { return slot(rig, bus).state; }

places::SlotRecord record(Rig& rig, const std::string& bus, const std::string& machine = "rig") {
  const auto records = rig.store().load(machine).value();
  const auto it = std::ranges::find_if(records, [&](const auto& r) { return r.name.bus == bus; });
  return it == records.end() ? places::SlotRecord() : *it;
}
// The serial number of the device that is bound to the slot of this bus, if it is and no intention is left.
std::optional<std::uint32_t> sits(Rig& rig, const std::string& bus) {
  const auto r = record(rig, bus);
  if (!r.confirmed || r.intended) return std::nullopt;
  return r.confirmed->device.address.serial;
}

std::vector<std::string> events_of(Rig& rig, const std::string& bus) {
  std::vector<std::string> events;
  const auto lines = rig.store().history(record(rig, bus).slot).value();
  for (const auto& line : lines) events.push_back(line.event);
  return events;
}

bool told(const Rig& rig, const std::string& words) { return rig.log().find(words) != std::string::npos; }

// How often a node-ID is told to a device (11h), and a frame resets one.
struct Told final : can::Tap {
  void frame(const can::Frame& f, rt::Time, int) noexcept override {
    node_ids += f.id == 0x7E5 && !f.extended && f.data[0] == 0x11 ? 1U : 0U;
  }
  unsigned node_ids = 0;
};

}  // namespace

// Serial number 0 on both buses.
TEST(Twins, BothAreSeatedAndStaySo) {
  Rig rig(two_buses(), twins());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(sits(rig, first_bus), 0U);
  EXPECT_EQ(sits(rig, second_bus), 0U);
  const std::vector<std::string> once{"declared", "asked", "confirmed"};
  EXPECT_EQ(events_of(rig, first_bus), once);
  EXPECT_EQ(events_of(rig, second_bus), once);
  for (const char* bus : {first_bus, second_bus}) {
    const auto lines = rig.store().history_of(on(bus, 0)).value();
    EXPECT_EQ(lines.size(), 2U) << bus;
    EXPECT_TRUE(std::ranges::all_of(lines, [&](const auto& line) { return line.on.bus == bus; })) << bus;
  }
  // The next start takes both from the store, and tells no node-ID to either.
  rig.kill();
  Told told;
  for (const char* bus : {first_bus, second_bus}) rig.world().bus(bus)->add_tap(told);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(told.node_ids, 0U);
  EXPECT_EQ(events_of(rig, first_bus), once);
  EXPECT_EQ(events_of(rig, second_bus), once);
  for (const char* bus : {first_bus, second_bus}) rig.world().bus(bus)->remove_tap(told);
}

// A twin that is replaced by a person leaves the other where it is.
TEST(Twins, OneIsReplacedAndTheOtherRunsOn) {
  auto p = twins();
  add_device(p, "spare", type_b, 7, second_bus).plugged = false;
  Rig rig(two_buses(), p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.device("two").unplug();
  rig.device("spare").plug();
  ASSERT_TRUE(rig.run_until([&] { return state(rig, 1) == SlotState::absent; }, 10s)) << rig.log();
  ASSERT_TRUE(rig.network(1).replace("second s1", with_serial(7)));
  ASSERT_TRUE(rig.run_until([&] { return state(rig, 1) == SlotState::operational; }, 30s)) << rig.log();
  EXPECT_EQ(sits(rig, first_bus), 0U);
  EXPECT_EQ(state(rig, 0), SlotState::operational);
  EXPECT_EQ(sits(rig, second_bus), 7U);
  // The replaced one is a device with a past on its own bus only.
  EXPECT_TRUE(places::former_seat(rig.store().history_of(on(second_bus, 0)).value()));
  EXPECT_FALSE(places::former_seat(rig.store().history_of(on(first_bus, 0)).value()));
}

// A device that sat on the second bus and was given away there has a twin, which comes to the first bus: it is new.
TEST(Twins, TheTwinOfAUsedDeviceIsNew) {
  auto p = two_bus_plant();
  add_device(p, "new", type_b, 0, first_bus);
  Rig rig(two_buses(), p);
  places::SlotStore& store = rig.store();
  const auto other = store.declare({"rig", second_bus, "second s1"}).value();
  ASSERT_TRUE(store.ask(other, {with_serial(0), NodeId(1)}, "x"));
  ASSERT_TRUE(store.confirm(other, {with_serial(0), NodeId(1)}, "x"));
  ASSERT_TRUE(store.clear(other, std::string(places::by_a_person)));
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return state(rig, 0) == SlotState::operational; }, 30s)) << rig.log();
  EXPECT_FALSE(told(rig, ": use it")) << rig.log();
  EXPECT_EQ(sits(rig, first_bus), 0U);
}

// What is remembered of the twin on the other bus is the twin's: its node-ID is fixed, it shall be restored.
TEST(Twins, AMarkOfOneIsNotTheOthers) {
  Rig rig(two_buses(), twins());
  ASSERT_TRUE(rig.store().mark(places::Mark::fixed, on(second_bus, 0), NodeId(9), "11h refused"));
  ASSERT_TRUE(rig.store().mark(places::Mark::restore, on(second_bus, 0), NodeId(9), "used"));
  ASSERT_TRUE(rig.store().mark(places::Mark::looks_used, on(second_bus, 0), NodeId(9), "used"));
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return state(rig, 0) == SlotState::operational; }, 30s)) << rig.log();
  EXPECT_EQ(rig.store().marked(places::Mark::restore).value().size(), 1U) << "the other one did not get them\n"
                                                                          << rig.log();
}

// The other way round: it is the second bus that waits, and the first's mark stands.
TEST(Twins, AnUnfinishedBlankOfOneIsNotEndedByTheOther) {
  auto p = two_bus_plant();
  add_device(p, "one", type_b, 0, first_bus);
  Rig rig(two_buses(5), p);
  const places::UnfinishedBlank open{with_serial(0), "rig", second_bus, NodeId(5)};
  ASSERT_TRUE(rig.store().ask_blank(open, "it held a foreign node-ID"));
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return state(rig, 0) == SlotState::operational; }, 30s)) << rig.log();
  EXPECT_EQ(rig.store().unfinished_blanks().value(), std::vector{open}) << "its twin was bound on the first bus";
  EXPECT_FALSE(rig.network(0).planning().waits_for(with_serial(0)));
  EXPECT_TRUE(rig.network(1).planning().waits_for(with_serial(0)));
  EXPECT_EQ(rig.network(0).forget(with_serial(0)).error().code, Errc::not_found);
  ASSERT_TRUE(rig.network(1).forget(with_serial(0)));
  EXPECT_TRUE(rig.store().unfinished_blanks().value().empty());
}

TEST(Twins, ALoanOfOneIsNotEndedByTheOther) {
  places::MemoryStore store;
  operate::Loans first(store, {"rig", first_bus});
  operate::Loans second(store, {"rig", second_bus});
  ASSERT_TRUE(first.lend(with_serial(0), NodeId(126)));
  ASSERT_TRUE(second.lend(with_serial(0), NodeId(125)));
  ASSERT_TRUE(second.end(with_serial(0)));
  operate::Loans next(store, {"rig", first_bus});
  ASSERT_TRUE(next.load());
  ASSERT_NE(next.of(with_serial(0)), nullptr) << "whatever is lent is given to no other until it is back";
  EXPECT_EQ(next.of(with_serial(0))->id, NodeId(126));
  operate::Loans elsewhere(store, {"rig", second_bus});
  ASSERT_TRUE(elsewhere.load());
  EXPECT_TRUE(elsewhere.empty());
}

// Twins that a technician exchanges are no news to either bus: each gets the node-ID of the slot where it is now.
TEST(Twins, ThatAreExchangedAreEachTheSlotsDevice) {
  auto p = twins();
  add_from_elsewhere(p, "one moved", 0, second_bus, 1);
  add_from_elsewhere(p, "two moved", 0, first_bus, 2);
  const auto machine = two_buses(2);
  Rig rig(machine, p);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.device("one").unplug();
  rig.device("two").unplug();
  ASSERT_TRUE(
      rig.run_until([&] { return state(rig, 0) == SlotState::absent && state(rig, 1) == SlotState::absent; }, 20s))
      << rig.log();
  rig.device("one moved").plug();
  rig.device("two moved").plug();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.device("one moved").truth().persistent, NodeId(2));
  EXPECT_EQ(rig.device("two moved").truth().persistent, NodeId(1));
  EXPECT_EQ(sits(rig, first_bus), 0U);
  EXPECT_EQ(sits(rig, second_bus), 0U);
}

// Two machines with buses of one name in one store file.
TEST(Twins, OfTwoMachinesInOneStore) {
  places::MemoryStore store;
  for (const char* machine : {"rig", "another"}) {
    Rig rig(two_buses(1, machine), twins(), &store);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  }
  for (const char* machine : {"rig", "another"}) {
    const auto records = store.load(machine).value();
    EXPECT_EQ(records.size(), 2U);
    EXPECT_TRUE(std::ranges::all_of(records, [](const auto& r) { return r.confirmed.has_value(); })) << machine;
  }
}

// ---- devices that are moved between buses ----

namespace {

// "x" and "y" run on the first and the second bus; "x moved" and "y moved" are the same devices on the other bus, each
// with the node-ID that it had. With `second_id` 1 each comes with the node-ID of the slot that it gets.
struct Swap {
  explicit Swap(unsigned second_id) : machine(two_buses(second_id)), rig(automatic(), plant(second_id)) {}
  design::Machine automatic() {
    for (auto& s : machine.slots) s.spec.replacement = places::Replacement::automatic;
    return machine;
  }
  static plant::PlantFile plant(unsigned second_id) {
    auto p = two_bus_plant();
    add_device(p, "x", type_b, 1, first_bus);
    add_device(p, "y", type_b, 2, second_bus);
    add_from_elsewhere(p, "x moved", 1, second_bus, 1);
    add_from_elsewhere(p, "y moved", 2, first_bus, second_id);
    return p;
  }
  design::Machine machine;
  Rig rig;
};

class Swapped : public testing::TestWithParam<unsigned> {};
INSTANTIATE_TEST_SUITE_P(NodeIdOfTheSecond, Swapped, testing::Values(1U, 2U));

}  // namespace

// replacement = "auto": each bus treats the device that came as any new one, and gives its slot to it.
TEST_P(Swapped, BothAreOperationalInTheirNewPlaces) {
  Swap s(GetParam());
  Rig& rig = s.rig;
  const DuplicateWatch watch(rig.world(), s.machine, &rig.store());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.device("x").unplug();
  rig.device("y").unplug();
  ASSERT_TRUE(
      rig.run_until([&] { return state(rig, 0) == SlotState::empty && state(rig, 1) == SlotState::empty; }, 20s))
      << rig.log();
  rig.device("x moved").plug();
  rig.device("y moved").plug();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(sits(rig, first_bus), 2U);
  EXPECT_EQ(sits(rig, second_bus), 1U);
  EXPECT_EQ(watch.failure(), "");
  EXPECT_FALSE(told(rig, ": use it")) << rig.log();
  const std::vector<std::string> both{"declared", "asked", "confirmed", "cleared", "asked", "confirmed"};
  EXPECT_EQ(events_of(rig, first_bus), both);
  EXPECT_EQ(events_of(rig, second_bus), both);
  // And after a restart.
  rig.kill();
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(events_of(rig, first_bus), both);
}

// The same while Berth does not run: the slots are their old devices' until these are known to be silent and as many
// new ones are there.
TEST_P(Swapped, WhileBerthDoesNotRun) {
  Swap s(GetParam());
  Rig& rig = s.rig;
  const DuplicateWatch watch(rig.world(), s.machine, &rig.store());
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.kill();
  rig.device("x").unplug();
  rig.device("y").unplug();
  rig.device("x moved").plug();
  rig.device("y moved").plug();
  rig.run_for(1s);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(sits(rig, first_bus), 2U);
  EXPECT_EQ(sits(rig, second_bus), 1U);
  EXPECT_EQ(watch.failure(), "");
}

namespace {

// "x" runs on the first bus, the second one's slot is empty; "x moved" is x on the second bus, "x back" x on the first
// with the node-ID of the second; "new" is another one for x's old slot.
plant::PlantFile moving() {
  auto p = two_bus_plant();
  add_device(p, "x", type_b, 1, first_bus);
  add_from_elsewhere(p, "x moved", 1, second_bus, 1);
  add_from_elsewhere(p, "x back", 1, first_bus, 2);
  add_device(p, "new", type_b, 3, first_bus).plugged = false;
  return p;
}

void move_to_the_second_bus(Rig& rig) {
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return state(rig, 0) == SlotState::operational && rig.idle(); }, 30s)) << rig.log();
  rig.device("x").unplug();
  rig.device("x moved").plug();
  ASSERT_TRUE(rig.run_until([&] { return state(rig, 1) == SlotState::operational && rig.idle(); }, 60s)) << rig.log();
}

}  // namespace

// It is new on the second bus; its old slot keeps it, and waits for it or for a person.
TEST(Moved, ToAnotherBusWhoseSlotIsEmpty) {
  Rig rig(two_buses(2), moving());
  move_to_the_second_bus(rig);
  if (HasFatalFailure()) return;
  EXPECT_EQ(state(rig, 0), SlotState::absent) << rig.log();
  EXPECT_EQ(sits(rig, first_bus), 1U) << "no person gave the slot away";
  EXPECT_EQ(sits(rig, second_bus), 1U);
  EXPECT_EQ(rig.device("x moved").truth().persistent, NodeId(2));
  EXPECT_FALSE(told(rig, ": use it")) << rig.log();
  // And back again: the first bus's slot has it still, and the second one's is absent.
  rig.device("x moved").unplug();
  rig.device("x back").plug();
  ASSERT_TRUE(rig.run_until([&] { return state(rig, 0) == SlotState::operational; }, 60s)) << rig.log();
  ASSERT_TRUE(rig.run_until([&] { return state(rig, 1) == SlotState::absent; }, 20s)) << rig.log();
  EXPECT_EQ(rig.device("x back").truth().persistent, NodeId(1));
  EXPECT_EQ(sits(rig, first_bus), 1U);
}

// It comes back to the first bus when its slot there is another's: that one stays, and the device is named.
TEST(Moved, AndBackWhenAnotherHasItsOldSlot) {
  const auto machine = two_buses(2);
  Rig rig(machine, moving());
  DuplicateWatch watch(rig.world(), machine, &rig.store());
  move_to_the_second_bus(rig);
  if (HasFatalFailure()) return;
  watch.replaced_by_a_person("x");
  ASSERT_TRUE(rig.network(0).replace("s1", std::nullopt));
  rig.device("new").plug();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(sits(rig, first_bus), 3U);
  EXPECT_EQ(sits(rig, second_bus), 1U) << "its new place is not given away with its old one";
  rig.device("x moved").unplug();
  rig.device("x back").plug();
  const std::string back = "the device that sat in slot s1 until";
  ASSERT_TRUE(rig.run_until([&] { return told(rig, back); }, 60s)) << rig.log();
  ASSERT_TRUE(rig.run_until([&] { return rig.idle(); }, 30s)) << rig.log();
  EXPECT_EQ(state(rig, 0), SlotState::operational) << rig.log();
  EXPECT_EQ(sits(rig, first_bus), 3U);
  EXPECT_EQ(state(rig, 1), SlotState::absent) << rig.log();
  EXPECT_EQ(sits(rig, second_bus), 1U);
  EXPECT_EQ(watch.failure(), "");
}

// ---- one device, one slot of a bus ----

// A slot was given another name, and the store has its device under the old one.
TEST(SeatedTwice, ARefusedIntentionSaysWhichSlotHasTheDevice) {
  auto p = two_bus_plant();
  add_device(p, "one", type_b, 5, first_bus);
  Rig rig(two_buses(), p);
  const auto old = rig.store().declare({"rig", first_bus, "old name"}).value();
  ASSERT_TRUE(rig.store().ask(old, {with_serial(5), NodeId(1)}, "x"));
  ASSERT_TRUE(rig.store().confirm(old, {with_serial(5), NodeId(1)}, "x"));
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return state(rig, 0) == SlotState::failed; }, 30s)) << rig.log();
  const std::string reason = slot(rig, 0).reason;
  EXPECT_NE(reason.find("slot old name of bus backbone"), std::string::npos) << reason;
  EXPECT_NE(reason.find("`berth replace \"backbone/old name\"`"), std::string::npos) << reason;
  EXPECT_FALSE(told(rig, "be written:")) << rig.log();
  EXPECT_FALSE(rig.device("one").truth().persistent.configured()) << "nothing was told to it";
}

// A person names a device for a slot that sits in another: refused before anything is given away.
TEST(SeatedTwice, APersonIsRefusedBeforeAnythingIsChanged) {
  auto m = two_buses();
  add_slot(m, 3, type_b, first_bus);
  auto p = two_bus_plant();
  add_device(p, "one", type_b, 5, first_bus);
  add_device(p, "three", type_b, 6, first_bus);
  Rig rig(m, p);
  rig.begin();
  ASSERT_TRUE(rig.run_until(
      [&] { return rig.state(1) == SlotState::operational && rig.state(3) == SlotState::operational; }, 30s))
      << rig.log();
  rig.device("three").unplug();
  ASSERT_TRUE(rig.run_until([&] { return rig.state(3) == SlotState::absent; }, 10s)) << rig.log();
  const auto before = rig.store().history(std::nullopt).value().size();
  const auto refused = rig.network().replace("s3", with_serial(5));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::duplicate);
  EXPECT_NE(std::string(refused.error().text).find("slot s1"), std::string::npos) << refused.error().text;
  EXPECT_EQ(rig.store().history(std::nullopt).value().size(), before);
  EXPECT_EQ(rig.state(3), SlotState::absent);
}

}  // namespace twins_tests
