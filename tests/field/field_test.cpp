// Devices as their makers' pages and users' reports describe them (kinds.cpp), mixed into machines of 2 to 60 from
// seeds: the main job, a replacement, a configuration, and the doctor. More seeds: BERTH_FIELD_FROM, BERTH_FIELD_COUNT.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <set>
#include <string>
#include <vector>

#include "berth/doctor/diagnose.hpp"
#include "tests/field/mixture.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::field;
using namespace berth::harness;
using places::SlotState;

namespace field_tests {
namespace {

std::uint64_t from_environment(const char* name, std::uint64_t otherwise) {
  const char* const text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

// The seeds of a test: its own, or what the environment says.
std::vector<std::uint64_t> seeds(std::uint64_t own_count) {
  const auto first = from_environment("BERTH_FIELD_FROM", 1);
  const auto count = from_environment("BERTH_FIELD_COUNT", own_count);
  std::vector<std::uint64_t> all;
  for (std::uint64_t i = 0; i < count; ++i) all.push_back(first + i);
  return all;
}

// Machines of all sizes, most of them small: a quarter has up to 60 devices.
Wishes wishes_of(std::uint64_t seed) {
  Wishes wishes;
  wishes.seed = seed;
  wishes.most = seed % 4 == 0 ? 60 : 16;
  return wishes;
}

design::Machine with_replacement(design::Machine machine, places::Replacement how) {
  for (auto& slot : machine.slots) slot.spec.replacement = how;
  return machine;
}

SlotState state(Rig& rig, const Member& member) { return rig.state(member.id.value()); }

bool until(Rig& rig, const Member& member, SlotState wanted, rt::Duration limit) {
  return rig.run_until([&] { return state(rig, member) == wanted; }, limit);
}

// Which device has the slot's node-ID: of several equal ones any may. Empty: none, or two.
std::string device_at(Rig& rig, const Member& member) {
  std::string name;
  for (const auto& truth : rig.world().truth()) {
    if (!truth.powered || truth.active != member.id) continue;
    if (!name.empty()) return {};
    name = truth.name;
  }
  return name;
}

// One device is where each slot says, of the slot's kind, runs, and stays there.
void expect_truth(Rig& rig, const Mixture& mixture) {
  for (const Member& m : mixture.members()) {
    const std::string name = device_at(rig, m);
    EXPECT_TRUE(name.starts_with(m.kind->name)) << name << " in slot " << static_cast<int>(m.id.value());
    if (name.empty()) continue;
    const auto truth = rig.device(name).truth();
    EXPECT_EQ(truth.state, NmtState::operational) << name;
    const bool stores = m.kind->from == From::lss && !m.kind->lss.refuses_store;
    if (stores) {
      EXPECT_EQ(truth.persistent, m.id) << name;
    }
  }
}

std::vector<doctor::Diagnosis> examine(Rig& rig, const Mixture& mixture, rt::Duration listening) {
  const design::Bus& bus = mixture.machine().buses.front();
  const auto port = rig.world().attach_master(bus.name);
  can::Dispatcher dispatcher(rig.world().executor(), *port);
  doctor::Ear ear(dispatcher);
  rig.run_for(listening);
  doctor::Expected expected;
  expected.slots = mixture.machine().specs(bus.name);
  expected.master = bus.master;
  expected.heartbeat_period = bus.timing.heartbeat_period;
  expected.heartbeat_timeout = bus.timing.heartbeat_timeout;
  expected.bit_rate = bus.bitrate;
  return doctor::diagnose(ear.heard(), expected);
}

std::string words(const std::vector<doctor::Diagnosis>& all) {
  std::string text;
  for (const auto& d : all) {
    text += std::string(doctor::name(d.kind)) + " (" + name(d.certainty) + "): " + d.what + "\n";
    for (const auto& line : d.evidence) text += "    " + line + "\n";
  }
  return text;
}

bool tells(const std::vector<doctor::Diagnosis>& all, doctor::Kind kind, NodeId node) {
  return std::ranges::any_of(all, [&](const auto& d) {
    return d.kind == kind && d.node == node && d.certainty != doctor::Certainty::possible;
  });
}

}  // namespace

TEST(Field, EveryKindHasItsSourceAndAName) {
  std::set<std::string_view> names;
  for (const Kind& k : kinds()) {
    EXPECT_TRUE(names.insert(k.name).second) << k.name;
    EXPECT_GE(k.source.size(), 60U) << k.name;
    EXPECT_EQ(k.source.find("http"), std::string_view::npos) << k.name << ": in words";
    EXPECT_EQ(k.serial == Serial::absent, k.parts < 4) << k.name;
    EXPECT_EQ(kind(k.name), &k);
  }
  EXPECT_GE(names.size(), 20U);
}

// Each alone, and two of it where a machine may have two.
TEST(Field, MainJobOfEachKind) {
  std::uint64_t seed = 1;
  for (const Kind& k : kinds()) {
    Wishes wishes;
    wishes.seed = ++seed;
    wishes.least = wishes.most = std::min(2U, k.most);
    wishes.only = {k.name};
    const Mixture mixture(wishes);
    ASSERT_EQ(mixture.members().size(), wishes.least) << k.name;
    Rig rig(mixture.machine(), mixture.plant());
    rig.begin();
    EXPECT_TRUE(rig.until_operational(5min)) << mixture.words() << "\n" << rig.log();
    expect_truth(rig, mixture);
  }
}

TEST(Field, MainJobOfMixtures) {
  std::set<std::string_view> met;
  for (const auto seed : seeds(40)) {
    const Mixture mixture(wishes_of(seed));
    Rig rig(mixture.machine(), mixture.plant());
    rig.begin();
    ASSERT_TRUE(rig.until_operational(30min)) << "seed " << seed << ": " << mixture.words() << "\n" << rig.log();
    expect_truth(rig, mixture);
    for (const Member& m : mixture.members()) met.insert(m.kind->name);
    if (HasFailure()) return;
  }
  EXPECT_GE(met.size(), 20U) << "the seeds mix too few kinds";
}

// The slot is operational again by itself where the machine file says so, and where nobody can tell the new device from
// the old one; else after `berth replace`.
TEST(Field, AReplacementOfEachKind) {
  std::uint64_t seed = 100;
  for (const Kind& k : kinds()) {
    ++seed;
    const bool by_hand = seed % 2 == 0;
    Wishes wishes;
    wishes.seed = seed;
    wishes.least = wishes.most = 1;
    wishes.only = {k.name};
    wishes.with_spares = true;
    const Mixture mixture(wishes);
    const auto how = by_hand ? places::Replacement::ask : places::Replacement::automatic;
    Rig rig(with_replacement(mixture.machine(), how), mixture.plant());
    rig.begin();
    const Member& m = mixture.members().front();
    ASSERT_TRUE(rig.until_operational(5min)) << mixture.words() << "\n" << rig.log();
    rig.device(m.device).unplug();
    ASSERT_TRUE(rig.run_until([&] { return state(rig, m) != SlotState::operational; }, 2min))
        << k.name << ": its loss goes unseen\n"
        << rig.log();
    rig.run_for(15s);
    rig.device(m.spare).plug();
    const bool asks = by_hand && k.serial == Serial::own;
    if (asks) {
      EXPECT_FALSE(until(rig, m, SlotState::operational, 30s)) << k.name << ": nobody was asked\n" << rig.log();
      ASSERT_TRUE(rig.network().replace("slot " + std::to_string(m.id.value()), std::nullopt)) << rig.log();
    }
    EXPECT_TRUE(until(rig, m, SlotState::operational, 3min)) << mixture.words() << "\n" << rig.log();
    EXPECT_EQ(rig.device(m.spare).truth().active, m.id) << k.name;
  }
}

TEST(Field, AReplacementAmongOthers) {
  for (const auto seed : seeds(24)) {
    Wishes wishes = wishes_of(seed + 1000);
    wishes.with_spares = true;
    const Mixture mixture(wishes);
    Rig rig(with_replacement(mixture.machine(), places::Replacement::automatic), mixture.plant());
    rig.begin();
    ASSERT_TRUE(rig.until_operational(30min)) << "seed " << seed << ": " << mixture.words() << "\n" << rig.log();
    const Member& m = mixture.members()[seed % mixture.members().size()];
    const std::string leaves = device_at(rig, m);
    ASSERT_FALSE(leaves.empty()) << rig.log();
    rig.device(leaves).unplug();
    ASSERT_TRUE(rig.run_until([&] { return state(rig, m) != SlotState::operational; }, 2min)) << rig.log();
    rig.run_for(15s);
    rig.device(m.spare).plug();
    EXPECT_TRUE(rig.until_operational(5min)) << "seed " << seed << ", " << m.device << ": " << mixture.words() << "\n"
                                             << rig.log();
    EXPECT_EQ(rig.device(m.spare).truth().active, m.id) << m.spare;
  }
}

namespace {

void expect_settings(Rig& rig, const Mixture& mixture, const char* when) {
  for (const Member& m : mixture.members()) {
    const std::string name = m.wanted > 0 ? device_at(rig, m) : std::string();
    if (name.empty()) continue;
    const auto has = rig.device(name).device().values().get_or<std::uint16_t>({0x2100, 0}, 0);
    EXPECT_EQ(has, m.wanted) << when << ", " << name;
  }
}

}  // namespace

// What `config =` wants stands in each device, and again after the power was off everywhere.
TEST(Field, ConfigurationsStand) {
  for (const auto seed : seeds(12)) {
    SCOPED_TRACE(seed);
    Wishes wishes = wishes_of(seed + 2000);
    wishes.configured = true;
    const Mixture mixture(wishes);
    Rig rig(mixture.machine(), mixture.plant());
    rig.begin();
    ASSERT_TRUE(rig.until_operational(30min)) << mixture.words() << "\n" << rig.log();
    expect_truth(rig, mixture);
    expect_settings(rig, mixture, "operational");
    rig.kill();
    for (const Member& m : mixture.members()) rig.device(m.device).power(false);
    rig.run_for(5s);
    for (const Member& m : mixture.members()) rig.device(m.device).power(true);
    rig.run_for(15s);
    expect_settings(rig, mixture, "after the power was off");
    if (HasFailure()) return;
  }
}

TEST(Field, TheDoctorFindsAHealthyBusHealthy) {
  for (const auto seed : seeds(24)) {
    const Mixture mixture(wishes_of(seed + 3000));
    Rig rig(mixture.machine(), mixture.plant());
    rig.begin();
    ASSERT_TRUE(rig.until_operational(30min)) << "seed " << seed << ": " << mixture.words() << "\n" << rig.log();
    rig.run_for(10s);
    const auto found = examine(rig, mixture, 30s);
    for (const auto& d : found) {
      if (d.kind == doctor::Kind::short_lss_answer) continue;  // it is so
      EXPECT_NE(d.certainty, doctor::Certainty::certain) << "seed " << seed << ": " << mixture.words() << "\n"
                                                         << words(found);
    }
    EXPECT_FALSE(std::ranges::any_of(found, [](const auto& d) { return d.kind == doctor::Kind::duplicate_node_id; }))
        << "seed " << seed << ": " << mixture.words() << "\n"
        << words(found);
  }
}

// A second device on the switches' node-ID, and a device that has lost its power.
TEST(Field, TheDoctorNamesWhatIsPlanted) {
  for (const auto seed : seeds(16)) {
    Wishes wishes = wishes_of(seed + 4000);
    wishes.most = 12;
    wishes.with_spares = true;
    wishes.only = {"wheel drive", "pump motor", "track sensor", "charger", "vehicle I/O", "battery"};
    const Mixture mixture(wishes);
    Rig rig(mixture.machine(), mixture.plant());
    rig.begin();
    ASSERT_TRUE(rig.until_operational(10min)) << "seed " << seed << ": " << mixture.words() << "\n" << rig.log();
    const Member& lost = mixture.members().front();
    const Member& doubled = mixture.members().back();
    rig.kill();  // the plant runs on without its master
    rig.device(lost.device).power(false);
    rig.device(doubled.spare).plug();
    rig.run_for(10s);
    const auto found = examine(rig, mixture, 30s);
    EXPECT_TRUE(tells(found, doctor::Kind::missing_heartbeat, lost.id))
        << "seed " << seed << ", " << lost.device << "\n"
        << words(found);
    const bool beats = doubled.kind->watched.period > 0;
    if (beats) {
      EXPECT_TRUE(tells(found, doctor::Kind::duplicate_node_id, doubled.id))
          << "seed " << seed << ", " << doubled.device << "\n"
          << words(found);
    }
  }
}

}  // namespace field_tests
