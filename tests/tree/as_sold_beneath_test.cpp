// Devices as shops sell them on a bus without a port of Berth's: the gateway's own master knows one without a serial
// number by its node-ID, and what a device does not say is unknown, which is not 0.
#include <chrono>
#include <set>
#include <string>

#include "../pch.hpp"
#include "berth/tree/gateway_master.hpp"
#include "berth/tree/network_list.hpp"
#include "objects.hpp"
#include "rig.hpp"
#include "tests/harness/description_of.hpp"
#include "tests/manager/fake_device.hpp"

namespace berth::tree_tests {
namespace {

using namespace std::chrono_literals;
using places::SlotState;

constexpr TypeCode valve{1, 7};

// One gateway (node-ID 3 of "top") with its own node 1 on "line", on which slots and devices are.
struct Line {
  std::string machine =
      "[machine]\nname = \"line\"\n[bus.top]\nport = \"sim\"\nbitrate = 250_000\n"
      "[bus.line]\nport = \"gateway\"\nbitrate = 250_000\nmaster_id = 1\ngateway = { bus = \"top\", slot = 3 }\n"
      "[[slot]]\nbus = \"top\"\nid = 3\nname = \"gateway\"\ntype = { vendor = 1, product = 88 }\n";
  std::string plant =
      "[plant]\nseed = 7\n[bus.top]\n[bus.line]\n"
      "[[device]]\nbus = \"top\"\nname = \"gateway\"\ntype = { vendor = 1, product = 88 }\nserial = 3\n"
      "[[device]]\nbus = \"line\"\nname = \"port\"\ntype = { vendor = 1, product = 89 }\nserial = 1\nnode_id = 1\n"
      "source = \"hard-coded\"\nmaster = { flying = false, most = 64 }\n"
      "[[gateway]]\nabove = \"gateway\"\nbeneath = [\"port\"]\n";

  void slot(unsigned id, const std::string& more = {}, const std::string& type = "{ vendor = 1, product = 7 }") {
    machine += "[[slot]]\nbus = \"line\"\nid = " + std::to_string(id) + "\nname = \"s" + std::to_string(id) +
               "\"\ntype = " + type + "\n" + more;
  }
  void device(const std::string& name, const std::string& more, unsigned product = 7) {
    plant += "[[device]]\nbus = \"line\"\nname = \"" + name +
             "\"\ntype = { vendor = 1, product = " + std::to_string(product) + " }\n" + more;
  }
  void switched(unsigned id, const std::string& more = {}, const std::string& name = {}) {
    device(name.empty() ? "d" + std::to_string(id) : name,
           "source = \"switches\"\nnode_id = " + std::to_string(id) + "\n" + more);
  }
};

const std::string fixed = "assign = \"fixed\"\n";
const std::string no_lss = "speaks = []\n";

std::string says(unsigned parts) { return "eds = \"" + harness::description_of(valve, parts) + "\"\n"; }

const std::string by_fastscan = "speaks = [\"fastscan\"]\n";
const std::string by_fastscan_and_rand = "speaks = [\"fastscan\", \"rand\"]\n";

unsigned run(const Rig& rig, std::initializer_list<const char*> slots) {
  unsigned count = 0;
  for (const char* const name : slots) count += rig.state(name) == SlotState::operational ? 1U : 0U;
  return count;
}

NodeId active(Rig& rig, const std::string& name) { return rig.device(name).truth().active; }

// Nothing is said that is not so.
void expect_no_false_word(const Rig& rig) {
  for (const char* const word :
       {"duplicate", "two devices", "another device", "does not belong", "no place here", "00000000h"})
    EXPECT_EQ(rig.log().find(word), std::string::npos) << word << "\n" << rig.log();
}

void expect_all_run(Rig& rig, unsigned first, unsigned last) {
  for (unsigned id = first; id <= last; ++id)
    EXPECT_EQ(rig.state("s" + std::to_string(id)), SlotState::operational) << id << rig.log();
}

// 5F0Bh of the gateway's own master: nothing to tell of these node-IDs, and nobody without a place.
void expect_no_trouble(Rig& rig, unsigned first, unsigned last) {
  Objects objects(rig);
  std::vector<ObjectRef> asked{{0x5F0B, 0x80}, {0x5F0B, 0x81}};
  for (unsigned id = first; id <= last; ++id) asked.push_back({0x5F0B, static_cast<std::uint8_t>(id)});
  EXPECT_EQ(objects.read("3/1", asked), std::vector<std::uint32_t>(asked.size(), 0));
}

// What the gateway's own master remembers.
std::optional<Identity> row(Rig& rig, unsigned id) {
  manager::ListStore store(list_memory(rig.device("port")));
  places::SlotStore& rows = store;
  return rows.load(manager::ListStore::slot_of(NodeId(static_cast<std::uint8_t>(id)))).value().device();
}

// 40h to 43h on the gateway's bus.
struct Selections final : can::Tap {
  explicit Selections(Rig& rig) : bus(*rig.world().bus("line")) { bus.add_tap(*this); }
  ~Selections() { bus.remove_tap(*this); }
  void frame(const can::Frame& frame, rt::Time, int) noexcept override {
    count += frame.key() == lss::master_cob_id && frame.data[0] == 0x43 ? 1U : 0U;
  }
  sim::Bus& bus;
  unsigned count = 0;
};

rt::Task<void> bring(tree::GatewayMaster& master, const manager::Wanted& list, Result<void>& done) {
  bool changed = false;
  done = co_await master.bring(list, changed);
}

}  // namespace

// With `assign` left as it is their LSS, where they have it, refuses another node-ID.
TEST(AsSoldBeneath, EqualOnesWithSwitchesHaveTheirSlotsWithoutAWordAboutThem) {
  for (const std::string& speaks : {no_lss, std::string(), by_fastscan}) {
    SCOPED_TRACE(speaks);
    Line line;
    for (unsigned id = 5; id <= 8; ++id) {
      line.slot(id);
      line.switched(id, speaks);
    }
    Rig rig(line.machine, line.plant);
    ASSERT_TRUE(rig.up()) << rig.log();
    rig.run_for(40s);
    expect_all_run(rig, 5, 8);
    expect_no_false_word(rig);
    expect_no_trouble(rig, 5, 8);
  }
}

// A gateway's master that gives nobody a node-ID need not have 5F05h: its list is brought in without.
TEST(AsSoldBeneath, AMasterWithoutFixedNodeIdsTakesTheRestOfItsList) {
  for (const bool has : {true, false}) {
    Line line;
    line.slot(5, fixed);
    line.slot(37, fixed);
    const auto machine = design::read_machine(line.machine, "machine.toml", {}).machine;
    const auto& bus = *machine->bus("line");
    Findings findings;
    const auto list = tree::network_list(bus, machine->specs("line"), {}, {}, findings);
    manager::test::FakeDevice fake;
    for (const auto& entry : list.entries) {
      const bool there = has || entry.object.index != 0x5F05;
      if (there) fake.add(entry.object, manager::test::Bytes(entry.bytes.size(), 0));
      if (entry.type == od::DataType::domain) fake.domains.insert(entry.object);
    }
    fake.with_date();
    fake.with_store();
    tree::GatewayMaster master(fake, NodeId(1));
    rt::Executor executor;
    Result<void> done = fail(Errc::timeout, "");
    rt::Scope scope(executor);
    scope.spawn(bring(master, list, done));
    while (scope.running() > 0 && executor.next()) executor.advance(*executor.next());
    EXPECT_TRUE(done) << describe(done.error());
    EXPECT_EQ(manager::test::number(fake.value({0x1F81, 37})), 5U);
    EXPECT_EQ(manager::test::number(fake.value({0x5F05, 1})), has ? 1U << 5U : 0U);
    EXPECT_EQ(manager::test::number(fake.value({0x5F05, 2})), has ? 1U << 5U : 0U);
    EXPECT_EQ(manager::test::number(fake.value({0x1020, 1})), list.date.days);
  }
}

TEST(AsSoldBeneath, EqualOnesWithSwitchesHaveTheirSlots) {
  for (const unsigned last : {5U, 7U, 25U}) {
    for (const std::string& speaks : {no_lss, std::string()}) {
      SCOPED_TRACE(std::to_string(last) + speaks);
      Line line;
      for (unsigned id = 5; id <= last; ++id) {
        line.slot(id, fixed);
        line.switched(id, speaks);
      }
      Rig rig(line.machine, line.plant);
      ASSERT_TRUE(rig.up()) << rig.log();
      rig.run_for(40s);
      EXPECT_TRUE(rig.session().operational()) << rig.log();
      expect_all_run(rig, 5, last);
      expect_no_false_word(rig);
      expect_no_trouble(rig, 5, last);
      for (unsigned id = 5; id <= last; ++id) {
        const NodeId node(static_cast<std::uint8_t>(id));
        EXPECT_EQ(active(rig, "d" + std::to_string(id)), node);
        EXPECT_EQ(rig.slot("s" + std::to_string(id)).device, Identity(1, 7, 0, 0).with(node));
        EXPECT_EQ(row(rig, id), Identity(1, 7, 0, 0).with(node));
      }
    }
  }
}

TEST(AsSoldBeneath, WhatADeviceDoesNotSayIsNotCompared) {
  for (const unsigned parts : {1U, 2U, 3U}) {
    SCOPED_TRACE(parts);
    Line line;
    for (unsigned id = 5; id <= 8; ++id) {
      line.slot(id, fixed);
      line.switched(id, no_lss + says(parts));
    }
    Rig rig(line.machine, line.plant);
    ASSERT_TRUE(rig.up()) << rig.log();
    rig.run_for(40s);
    expect_all_run(rig, 5, 8);
    expect_no_false_word(rig);
    expect_no_trouble(rig, 5, 8);
    Identity named(1, parts > 1 ? 7 : 0, 0, 0);
    named.unknown = static_cast<std::uint8_t>(Identity::all_unknown << parts & Identity::all_unknown);
    EXPECT_EQ(rig.slot("s6").device, named.with(NodeId(6)));
    EXPECT_EQ(row(rig, 6), named.with(NodeId(6)));
  }
}

// The next one at the node-ID of a fixed slot is its replacement: an equal one, and one that says more or less.
TEST(AsSoldBeneath, ANewOneAtTheNodeIdOfAFixedSlotIsItsReplacement) {
  for (const std::string& next : {std::string(), std::string("serial = 77\n"), says(1), says(3)}) {
    for (const std::string& speaks : {no_lss, std::string()}) {
      SCOPED_TRACE(next + speaks);
      Line line;
      for (unsigned id = 5; id <= 7; ++id) {
        line.slot(id, fixed);
        line.switched(id, speaks);
      }
      line.switched(6, speaks + next + "plugged = false\n", "next");
      Rig rig(line.machine, line.plant);
      ASSERT_TRUE(rig.up()) << rig.log();
      rig.run_for(10s);
      rig.device("d6").unplug();
      ASSERT_TRUE(rig.run_until([&] { return rig.state("s6") == SlotState::absent; }, 20s)) << rig.log();
      rig.run_for(5s);
      rig.device("next").plug();
      ASSERT_TRUE(rig.up(30s)) << rig.log();
      rig.run_for(40s);
      expect_all_run(rig, 5, 7);
      expect_no_false_word(rig);
      EXPECT_EQ(row(rig, 6).value_or(Identity()).has_serial(), next.starts_with("serial"));
      // And back again.
      rig.device("next").unplug();
      ASSERT_TRUE(rig.run_until([&] { return rig.state("s6") == SlotState::absent; }, 20s)) << rig.log();
      rig.run_for(5s);
      rig.device("d6").plug();
      ASSERT_TRUE(rig.up(30s)) << rig.log();
      rig.run_for(20s);
      expect_all_run(rig, 5, 7);
      expect_no_false_word(rig);
      EXPECT_FALSE(row(rig, 6).value_or(Identity(1, 7, 0, 1)).has_serial());
    }
  }
}

// It says its maker alone, and so each device of that maker may seem to be it.
TEST(AsSoldBeneath, WhatCameWithTheNodeIdOfOneThatSaysLittleIsAnother) {
  Line line;
  line.slot(5, fixed);
  line.slot(6, "", "{ vendor = 1, product = 8 }");
  line.switched(5, no_lss + says(1));
  line.device("guest", "serial = 9\nsource = \"nonvolatile\"\nnode_id = 5\nplugged = false\n", 8);
  Rig rig(line.machine, line.plant);
  ASSERT_TRUE(rig.run_until([&] { return run(rig, {"s5"}) == 1; }, 60s)) << rig.log();
  rig.run_for(5s);
  rig.device("guest").plug();
  ASSERT_TRUE(rig.up(3min)) << rig.log();
  EXPECT_EQ(active(rig, "guest"), NodeId(6));
  EXPECT_EQ(active(rig, "d5"), NodeId(5));
}

// With LSS, and their slots not said to be fixed: a search for the one that is missing hears all of them.
TEST(AsSoldBeneath, WhoHasANodeIdDoesNotWaitForOne) {
  Line line;
  for (unsigned id = 5; id <= 8; ++id) {
    line.slot(id);
    line.switched(id, says(1) + "response = \"" + std::to_string(id * 700 - 3000) + " us\"\n");
  }
  Rig rig(line.machine, line.plant);
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(5s);
  rig.device("d6").unplug();
  rig.run_for(40s);
  EXPECT_EQ(rig.state("s6"), SlotState::absent) << rig.log();
  EXPECT_EQ(rig.log().find("one at a time"), std::string::npos) << rig.log();
  expect_no_false_word(rig);
  rig.device("d6").plug();
  ASSERT_TRUE(rig.up()) << rig.log();
}

TEST(AsSoldBeneath, TheyAreSeatedAgainAfterAPowerFailureOfTheGateway) {
  Line line;
  for (unsigned id = 5; id <= 9; ++id) {
    line.slot(id, fixed);
    line.switched(id, id < 7 ? no_lss : says(2));
  }
  Rig rig(line.machine, line.plant);
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(5s);
  for (int time = 0; time < 2; ++time) {
    rig.device("gateway").power(false);
    if (time == 1) rig.device("d6").power(false);
    rig.run_for(5s);
    rig.device("gateway").power(true);
    rig.device("d6").power(true);
    ASSERT_TRUE(rig.up()) << rig.log();
    rig.run_for(20s);
    expect_all_run(rig, 5, 9);
    expect_no_false_word(rig);
  }
}

// Its device may be switched on at any time: a blank one of its type does not get its node-ID, whatever it speaks.
TEST(AsSoldBeneath, TheNodeIdOfAFixedSlotIsGivenToNobody) {
  for (const std::string& serial : {std::string(), std::string("serial = 9\n")}) {
    SCOPED_TRACE(serial);
    Line line;
    for (unsigned id = 5; id <= 7; ++id) line.slot(id, fixed);
    line.switched(5, no_lss + serial);
    line.switched(6, no_lss);
    line.switched(7, no_lss + "plugged = false\n");
    line.device("blank", "plugged = false\n" + by_fastscan_and_rand + (serial.empty() ? "" : "serial = 10\n"));
    Rig rig(line.machine, line.plant);
    ASSERT_TRUE(rig.run_until([&] { return run(rig, {"s5", "s6"}) == 2; }, 60s)) << rig.log();
    rig.device("d5").unplug();
    rig.run_for(10s);
    rig.device("blank").plug();
    rig.run_for(60s);
    EXPECT_FALSE(active(rig, "blank").configured()) << rig.log();
    EXPECT_EQ(run(rig, {"s6"}), 1U) << rig.log();
    EXPECT_EQ(rig.state("s5"), SlotState::absent);
    EXPECT_EQ(rig.state("s7"), SlotState::empty);
    EXPECT_NE(rig.slot("s7").reason.find("no device answers under node-ID 7: set its switches"), std::string::npos)
        << rig.slot("s7").reason;
    EXPECT_NE(rig.log().find("is for one with its own node-ID"), std::string::npos) << rig.log();
    rig.device("blank").unplug();
    rig.device("d5").plug();
    rig.device("d7").plug();
    ASSERT_TRUE(rig.up()) << rig.log();
    EXPECT_EQ(run(rig, {"s5", "s6", "s7"}), 3U);
  }
}

TEST(AsSoldBeneath, BlankOnesWithoutSerialNumbersComeOneAtATime) {
  for (const std::string& speaks : {by_fastscan, by_fastscan_and_rand}) {
    SCOPED_TRACE(speaks);
    Line line;
    for (unsigned id = 5; id <= 7; ++id) line.slot(id);
    line.device("d1", speaks);
    line.device("d2", speaks + "plugged = false\n");
    line.device("d3", speaks + "plugged = false\n");
    Rig rig(line.machine, line.plant);
    const auto seated = [&](unsigned count) {
      return rig.run_until([&] { return run(rig, {"s5", "s6", "s7"}) == count; }, 60s);
    };
    ASSERT_TRUE(seated(1)) << rig.log();
    const Selections selections(rig);
    rig.device("d2").plug();
    ASSERT_TRUE(seated(2)) << rig.log();
    rig.device("d3").plug();
    ASSERT_TRUE(seated(3)) << rig.log();
    rig.run_for(40s);
    EXPECT_EQ(selections.count, 0U) << "40h to 43h select all equal ones";
    EXPECT_EQ(run(rig, {"s5", "s6", "s7"}), 3U) << rig.log();
    expect_no_false_word(rig);
    std::set<NodeId> ids;
    for (const char* const name : {"d1", "d2", "d3"}) {
      EXPECT_EQ(active(rig, name), rig.device(name).truth().persistent);
      ids.insert(active(rig, name));
    }
    EXPECT_EQ(ids, (std::set{NodeId(5), NodeId(6), NodeId(7)}));
  }
}

// A device that comes without its node-ID is the one of its kind that is missing, or one put in its place.
TEST(AsSoldBeneath, ABlankOneTakesThePlaceOfAnEqualThatIsMissing) {
  for (const std::string& speaks : {by_fastscan, by_fastscan_and_rand}) {
    SCOPED_TRACE(speaks);
    Line line;
    line.slot(5);
    line.slot(6);
    line.device("d1", speaks);
    line.device("d2", speaks + "plugged = false\n");
    line.device("d3", speaks + "plugged = false\n");
    Rig rig(line.machine, line.plant);
    ASSERT_TRUE(rig.run_until([&] { return run(rig, {"s5", "s6"}) == 1; }, 60s)) << rig.log();
    rig.device("d2").plug();
    ASSERT_TRUE(rig.up()) << rig.log();
    rig.run_for(10s);
    const NodeId had = active(rig, "d1");
    rig.device("d1").unplug();
    rig.run_for(10s);
    rig.device("d3").plug();
    ASSERT_TRUE(rig.up()) << rig.log();
    rig.run_for(20s);
    EXPECT_EQ(active(rig, "d3"), had);
    manager::ListStore store(list_memory(rig.device("port")));
    EXPECT_TRUE(store.unfinished_blanks().value().empty()) << "it is the device of its row, and no former one";
    EXPECT_EQ(run(rig, {"s5", "s6"}), 2U) << rig.log();
    expect_no_false_word(rig);
  }
}

// 40h to 43h would select its equals with it: it stays as it is, and so do they (docs/limits.md).
TEST(AsSoldBeneath, ABlankOneWithoutFastscanBesideEqualsStaysBlank) {
  Line line;
  line.slot(5);
  line.slot(6);
  line.device("d1", "");
  line.device("d2", "plugged = false\n");
  Rig rig(line.machine, line.plant);
  ASSERT_TRUE(rig.run_until([&] { return run(rig, {"s5", "s6"}) == 1; }, 60s)) << rig.log();
  rig.device("d2").plug();
  rig.run_for(60s);
  EXPECT_FALSE(active(rig, "d2").configured());
  EXPECT_EQ(active(rig, "d1"), NodeId(5));
  EXPECT_EQ(rig.state("s5"), SlotState::operational) << rig.log();
  EXPECT_EQ(rig.state("s6"), SlotState::empty) << rig.log();
}

// They answer at different instants: both are named, none is told anything, and one after the other both are seated.
TEST(AsSoldBeneath, TwoBlankOnesAtOnceAreNamedForWhatTheyAre) {
  for (const std::string& speaks : {by_fastscan, by_fastscan_and_rand}) {
    SCOPED_TRACE(speaks);
    Line line;
    line.slot(5);
    line.slot(6);
    line.device("d1", speaks + "response = \"500 us\"\n");
    line.device("d2", speaks + "response = \"3 ms\"\n");
    Rig rig(line.machine, line.plant);
    rig.run_for(60s);
    EXPECT_FALSE(active(rig, "d1").configured());
    EXPECT_FALSE(active(rig, "d2").configured());
    for (const char* const slot : {"s5", "s6"}) {
      EXPECT_EQ(rig.state(slot), SlotState::empty);
      const std::string reason = rig.slot(slot).reason;
      EXPECT_NE(reason.find("several devices of its type without serial numbers"), std::string::npos) << reason;
      EXPECT_NE(reason.find("one at a time"), std::string::npos) << reason;
    }
    expect_no_false_word(rig);
    rig.device("d2").unplug();
    ASSERT_TRUE(rig.run_until([&] { return rig.state("s5") == SlotState::operational; }, 60s)) << rig.log();
    rig.device("d2").plug();
    ASSERT_TRUE(rig.up(60s)) << rig.log();
    EXPECT_EQ(active(rig, "d1"), NodeId(5));
    EXPECT_EQ(active(rig, "d2"), NodeId(6));
  }
}

// ---- LSS as far as a device has it (docs/limits.md)

namespace {

struct Subset {
  const char* name;
  const char* keys;
  bool seated = true;
};

// Each with a serial number of its own, blank, two of them and one whole device of their type.
constexpr Subset subsets[] = {
    {"no Fastscan, no RAND", "speaks = [\"lss\"]\n"},
    {"no identify, Fastscan", "speaks = [\"fastscan\"]\nlss_without = [\"identify\"]\n"},
    {"no identify, RAND", "speaks = [\"lss\", \"rand\"]\nlss_without = [\"identify\"]\n"},
    {"neither identify nor Fastscan nor RAND", "speaks = [\"lss\"]\nlss_without = [\"identify\"]\n", false},
    {"no selection by address", "speaks = [\"fastscan\"]\nlss_without = [\"select\"]\n"},
    {"no identity inquiries", "speaks = [\"lss\"]\nlss_without = [\"inquire-identity\"]\n"},
    {"no node-ID inquiry", "speaks = [\"lss\"]\nlss_without = [\"inquire-node-id\"]\n"},
    {"no inquiries", "speaks = [\"lss\"]\nlss_without = [\"inquire-identity\", \"inquire-node-id\"]\n"},
    {"no inquiries, RAND", "speaks = [\"lss\", \"rand\"]\nlss_without = [\"inquire-identity\", \"inquire-node-id\"]\n"},
    {"no inquiries, Fastscan", "speaks = [\"fastscan\"]\nlss_without = [\"inquire-identity\", \"inquire-node-id\"]\n"},
    {"Fastscan and selection alone",
     "speaks = [\"fastscan\"]\nlss_without = [\"inquire-identity\", \"inquire-node-id\", \"identify\", "
     "\"bit-timing\", \"activate\"]\n"},
    {"no bit timing", "lss_without = [\"bit-timing\", \"activate\"]\n"},
    {"stores nothing", "lss_store = \"refused\"\n"},
    {"stores nothing, by LSS alone", "speaks = [\"lss\"]\nlss_store = \"refused\"\n"},
    {"short answers", "short_answers = true\n"},
    {"short answers, by LSS alone", "speaks = [\"lss\"]\nshort_answers = true\n"},
};

}  // namespace

TEST(AsSoldBeneath, WhatOneProcedureOfLssCanSeatIsSeated) {
  for (const Subset& subset : subsets) {
    SCOPED_TRACE(subset.name);
    Line line;
    for (unsigned id = 5; id <= 7; ++id) line.slot(id);
    line.device("d1", std::string("serial = 1000\n") + subset.keys);
    line.device("d2", std::string("serial = 2000\n") + subset.keys);
    line.device("whole", "serial = 7\n");
    Rig rig(line.machine, line.plant);
    if (!subset.seated) {
      rig.run_for(60s);
      EXPECT_FALSE(active(rig, "d1").configured() || active(rig, "d2").configured());
      EXPECT_TRUE(active(rig, "whole").configured());
      unsigned empty = 0;
      for (const char* const name : {"s5", "s6", "s7"}) {
        if (rig.state(name) != SlotState::empty) continue;
        ++empty;
        EXPECT_EQ(rig.slot(name).reason, "no device of its type was found");
      }
      EXPECT_EQ(empty, 2U) << rig.log();
      continue;
    }
    EXPECT_TRUE(rig.up()) << rig.log();
    rig.run_for(10s);
    expect_all_run(rig, 5, 7);
    expect_no_false_word(rig);
    std::set<NodeId> ids;
    for (const char* const name : {"d1", "d2", "whole"}) ids.insert(active(rig, name));
    EXPECT_EQ(ids, (std::set{NodeId(5), NodeId(6), NodeId(7)}));
  }
}

// At each power-on it is found and told anew.
TEST(AsSoldBeneath, ADeviceThatCannotStoreIsSeatedAtEachPowerOn) {
  Line line;
  line.slot(5);
  line.slot(6);
  line.device("d1", "serial = 1000\nlss_store = \"refused\"\n");
  line.device("d2", "serial = 2000\nlss_store = \"refused\"\n");
  Rig rig(line.machine, line.plant);
  ASSERT_TRUE(rig.up()) << rig.log();
  rig.run_for(5s);
  const NodeId had = active(rig, "d1");
  for (int time = 0; time < 2; ++time) {
    rig.device("d1").power(false);
    rig.run_for(10s);
    EXPECT_FALSE(rig.session().operational());
    rig.device("d1").power(true);
    ASSERT_TRUE(rig.up(90s)) << rig.log();
    EXPECT_EQ(active(rig, "d1"), had);
    rig.run_for(10s);
    expect_no_false_word(rig);
  }
}

// It came from another machine: what LSS it has is enough to give it its slot's.
TEST(AsSoldBeneath, WhoHasANodeIdOfNoSlotGetsItsSlots) {
  for (const Subset& subset : subsets) {
    const std::string name = subset.name;
    // Fastscan, which alone would select it, is for devices without a node-ID. Who does not answer a search is asked by
    // SDO when it boots.
    const bool stays = name == "no selection by address";
    SCOPED_TRACE(name);
    Line line;
    line.slot(5);
    line.slot(6);
    line.device("d1", std::string("serial = 1000\nsource = \"nonvolatile\"\nnode_id = 40\n") + subset.keys);
    line.device("whole", "serial = 7\n");
    Rig rig(line.machine, line.plant);
    EXPECT_EQ(rig.up(90s), !stays) << rig.log();
    rig.run_for(10s);
    EXPECT_EQ(active(rig, "d1") == NodeId(40), stays) << rig.log();
    EXPECT_EQ(run(rig, {"s5", "s6"}), stays ? 1U : 2U) << rig.log();
  }
}

// Without a serial number it does while it is alone of its kind; beside its equals LSS would tell all of them.
TEST(AsSoldBeneath, WithoutASerialNumberOnlyWhenItIsAloneOfItsKind) {
  for (const bool alone : {true, false}) {
    SCOPED_TRACE(alone);
    Line line;
    line.slot(5);
    line.slot(6);
    line.device("d1", by_fastscan_and_rand + "source = \"nonvolatile\"\nnode_id = 40\n");
    if (!alone) line.device("d2", by_fastscan_and_rand + "source = \"nonvolatile\"\nnode_id = 5\n");
    Rig rig(line.machine, line.plant);
    rig.run_for(60s);
    EXPECT_EQ(active(rig, "d1"), alone ? NodeId(5) : NodeId(40)) << rig.log();
    EXPECT_TRUE(alone || active(rig, "d2") == NodeId(5)) << rig.log();
    EXPECT_EQ(run(rig, {"s5", "s6"}), 1U) << rig.log();
    EXPECT_EQ(rig.log().find("duplicate"), std::string::npos) << rig.log();
  }
}

}  // namespace berth::tree_tests
