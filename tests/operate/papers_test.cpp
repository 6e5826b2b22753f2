// What the papers ask of the main job as a whole, read from the bus and from the devices, never from Berth's own words.
#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;
using plant::Speaks;
using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;

namespace papers_tests {
namespace {

const Seats table_2{{1, 0x0A}, {2, 5}, {3, 8}, {4, 6}, {5, 7}};

// Every frame of the bus as text, as long as it lives.
class Trace final : public can::Tap {
 public:
  explicit Trace(Rig& rig) : bus_(*rig.world().bus("backbone")) { bus_.add_tap(*this); }
  ~Trace() { bus_.remove_tap(*this); }
  Trace(const Trace&) = delete;
  Trace& operator=(const Trace&) = delete;
  [[nodiscard]] std::size_t count(std::string_view start) const {
    return static_cast<std::size_t>(
        std::ranges::count_if(lines, [&](const std::string& line) { return line.starts_with(start); }));
  }
  /// Where the first frame with this beginning is, from `from` on; the number of frames: nowhere.
  [[nodiscard]] std::size_t first(std::string_view start, std::size_t from = 0) const {
    while (from < lines.size() && !lines[from].starts_with(start)) ++from;
    return from;
  }
  std::vector<std::string> lines;
  std::vector<rt::Time> times;
  std::vector<unsigned> bits;

 private:
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    lines.push_back(can::to_string(frame));
    times.push_back(at);
    bits.push_back((frame.extended ? 80U : 55U) + 10U * frame.size);
  }
  sim::Bus& bus_;
};

// S1.2: phase one, no slave connected: the master holds which type belongs to which node-ID, and binds nobody. Phase
// two begins by itself with the slaves.
TEST(PapersMainJob, S1_2_FirstThePlanThenTheSlavesByThemselves) {
  auto plant = five_slaves();
  for (auto& device : plant.devices) device.plugged = false;
  Rig rig(five_slots(), plant);
  const Trace trace(rig);
  rig.begin();
  rig.run_for(30s);
  std::map<unsigned, TypeCode> planned;
  for (const auto& slot : rig.network().report()) {
    planned[slot.id.value()] = slot.type;
    EXPECT_FALSE(slot.device) << slot.name;
  }
  EXPECT_EQ(planned, (std::map<unsigned, TypeCode>{{1, type_a}, {2, type_b}, {3, type_c}, {4, type_b}, {5, type_b}}));
  EXPECT_TRUE(rig.seats().empty());
  EXPECT_EQ(trace.count("7E5#11"), 0U) << "no node-ID is given while nobody is there";
  for (const char* name : {"d1", "d2", "d3", "d4", "d5"}) rig.device(name).plug();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.seats(), table_2) << rig.log();
  for (const auto& truth : rig.world().truth()) EXPECT_EQ(truth.state, NmtState::operational) << truth.name;
}

// S1.31: everybody is told to be unknown before the first question, each device that sits in its slot is told to be
// identified, and the questions end with one that nobody answers. s2 was exchanged, and comes from another plant where
// it was identified.
TEST(PapersMainJob, S1_31_UnknownThenTheRegisteredOnesThenQuestions) {
  auto machine = five_slots();
  machine.buses.front().discovery = "rand";
  machine.slots[1].spec.replacement = places::Replacement::automatic;
  auto plant = five_slaves();
  auto spare = plant.devices[1];
  spare.name = "spare";
  spare.address.serial = 0x15;
  spare.plugged = false;
  plant.devices.push_back(spare);
  Rig rig(machine, plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  rig.kill();
  rig.device("d2").unplug();
  rig.device("spare").plug();
  rig.run_for(1s);
  rig.begin();
  const Trace trace(rig);
  ASSERT_TRUE(rig.run_until([&] { return trace.count("1F940000#8001") > 0; }, 60s)) << rig.log();
  const auto unknown = trace.first("1F940000#81000000");
  const auto phase_1 = trace.first("1F940000#8001");
  std::size_t begin = phase_1;  // phase 0 of the search that finds somebody
  while (begin > 0 && !trace.lines[begin].starts_with("1F940000#8000")) --begin;
  ASSERT_LT(unknown, begin);
  EXPECT_EQ(trace.first("1F940000#8000"), trace.first("1F940000#8000", unknown)) << "no question before it";
  // Vendor, product, revision and serial of s1, s3, s4 and s5; not of s2, who is not there.
  for (const auto& [serial, product, vendor] :
       {std::tuple("0000000A", "00000001", "01000001"), std::tuple("00000008", "00000005", "00000001"),
        std::tuple("00000006", "00000001", "00000001"), std::tuple("00000007", "00000001", "00000001")}) {
    bool told = false;
    for (std::size_t i = unknown; i + 3 < begin; ++i) {
      told = told || (trace.lines[i] == std::string("1F940000#82000000") + vendor &&
                      trace.lines[i + 1] == std::string("1F940000#83000000") + product &&
                      trace.lines[i + 2] == "1F940000#8400000000000000" &&
                      trace.lines[i + 3] == std::string("1F940000#85000000") + serial);
    }
    EXPECT_TRUE(told) << serial;
  }
  EXPECT_EQ(trace.count("1F940000#8500000000000005"), 0U);
  EXPECT_EQ(trace.count("7E5#0401"), 0U) << "running devices stay out of LSS configuration";
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_EQ(rig.seats(), (Seats{{1, 0x0A}, {2, 0x15}, {3, 8}, {4, 6}, {5, 7}})) << rig.log();
  // Nobody but the new one answered, with chunk(7) = 0015 (54 after the shift by two), and the last phase 0 is silent.
  EXPECT_EQ(trace.count("1F90"), 1U);
  EXPECT_EQ(trace.count("1F900054#"), 1U);
}

// S1.33 (c): a slot is told as taken only when its device has the node-ID, and not while it is being configured.
TEST(PapersMainJob, S1_33_OnlineOnlyWhenTheDeviceHasItsNodeId) {
  Rig rig(five_slots(), five_slaves());
  rig.begin();
  const std::map<unsigned, std::string> owner{{1, "d1"}, {2, "d2"}, {3, "d3"}, {4, "d4"}, {5, "d5"}};
  std::vector<std::string> early;
  const auto all = [&] {
    bool operational = true;
    for (const auto& slot : rig.network().report()) {
      const bool online = slot.state == SlotState::present || slot.state == SlotState::configuring ||
                          slot.state == SlotState::operational;
      const auto truth = rig.device(owner.at(slot.id.value())).truth();
      if (online && truth.active != slot.id) early.push_back(slot.name);
      operational = operational && slot.state == SlotState::operational;
    }
    return operational;
  };
  ASSERT_TRUE(rig.run_until(all, 60s)) << rig.log();
  EXPECT_TRUE(early.empty()) << early.front() << " is online before its device has the node-ID";
}

// S1.33 (c): a device that leaves before it has confirmed its node-ID never makes its slot online.
TEST(PapersMainJob, S1_33_NotOnlineWithoutItsConfirmation) {
  Rig rig(five_slots(), five_slaves());
  const Trace trace(rig);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return trace.count("7E5#1103") > 0; }, 60s)) << rig.log();
  rig.device("d3").unplug();
  bool online = false;
  rig.run_until(
      [&] {
        const auto state = rig.state(3);
        online = online || state == SlotState::present || state == SlotState::operational;
        return online;
      },
      20s);
  EXPECT_FALSE(online) << rig.log();
}

// S1.37: who speaks when, while five blank slaves are bound: the master selects one, it confirms, the master configures
// it, it confirms; and no service begins before the last one was confirmed. Inquiries (5Eh) and store (17h), which the
// paper leaves out, are Berth's own; the node-ID becomes active with `04 00` and is seen by the boot-up message.
TEST(PapersMainJob, S1_37_TheSequenceBetweenMasterAndSlaves) {
  Rig rig(five_slots(), five_slaves());
  const Trace trace(rig);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
  const auto select = [](const std::string& vendor, const std::string& product, const std::string& serial) {
    return std::vector<std::string>{"7E5#40" + vendor + "000000", "7E5#41" + product + "000000", "7E5#4200000000000000",
                                    "7E5#43" + serial + "000000", "7E4#4400000000000000"};
  };
  const std::vector<std::vector<std::string>> slaves{
      select("01000001", "01000000", "0A000000"), select("01000000", "01000000", "05000000"),
      select("01000000", "05000000", "08000000"), select("01000000", "01000000", "06000000"),
      select("01000000", "01000000", "07000000")};
  std::size_t at = 0;
  for (unsigned slot = 1; slot <= 5; ++slot) {
    auto expected = slaves[slot - 1];
    const std::string id = "0" + std::to_string(slot);
    for (const auto& line :
         {"7E5#11" + id + "000000000000", std::string("7E4#1100000000000000"), std::string("7E5#1700000000000000"),
          std::string("7E4#1700000000000000"), std::string("7E5#0400000000000000")}) {
      expected.push_back(line);
    }
    at = trace.first(expected.front().substr(0, 14), at);
    std::vector<std::string> found;
    for (; at < trace.lines.size() && found.size() < expected.size(); ++at) {
      const auto& line = trace.lines[at];
      const bool lss = line.starts_with("7E4#") || line.starts_with("7E5#");
      const bool inquiry = lss && line.substr(4, 2) >= "5A" && line.substr(4, 2) <= "5E";
      const bool again = !found.empty() && found.back() == line;  // `04 00` said twice
      if (lss && !inquiry && !again) found.push_back(line);
    }
    EXPECT_EQ(found, expected) << "slot " << slot;
    // It boots while the next slave is told its node-ID.
    const auto boot_up = std::find(trace.lines.begin(), trace.lines.end(), "70" + std::to_string(slot) + "#00");
    ASSERT_NE(boot_up, trace.lines.end()) << "slot " << slot;
    EXPECT_GT(boot_up - trace.lines.begin(), std::ptrdiff_t(at) - 1) << "slot " << slot;
  }
}

// S1.54: asked by RAND alone, a slave that does not speak it says nothing to it; its slot is told as without a device,
// and the others run. Left to LSS as well (the default) it is found.
TEST(PapersMainJob, S1_54_ASlaveWithoutRandIsSilentAndMissing) {
  for (const char* discovery : {"rand", "auto"}) {
    auto machine = five_slots();
    machine.buses.front().discovery = discovery;
    auto plant = five_slaves();
    plant.devices[2].speaks.remove(Speaks::rand);
    Rig rig(machine, plant);
    const Trace trace(rig);
    rig.begin();
    const auto others = [&] {
      return std::ranges::all_of(std::array{1U, 2U, 4U, 5U},
                                 [&](unsigned id) { return rig.state(id) == SlotState::operational; });
    };
    ASSERT_TRUE(rig.run_until(others, 60s)) << rig.log();
    rig.run_for(30s);
    // chunk(3) of s3 is 0005, of all others 0001: 5 << 2. In DIS it would be 0008.
    EXPECT_EQ(trace.count("1F900020#"), 0U) << "s3 answers RAND";
    const bool found = std::string_view(discovery) == "auto";
    EXPECT_EQ(rig.state(3), found ? SlotState::operational : SlotState::empty) << discovery << "\n" << rig.log();
    EXPECT_EQ(rig.device("d3").truth().active, found ? NodeId(3) : NodeId()) << discovery;
    EXPECT_EQ(rig.seats(), found ? table_2 : (Seats{{1, 0x0A}, {2, 5}, {4, 6}, {5, 7}})) << discovery;
  }
}

// S4.20: a device may come at any time: one question goes out every `probe_period`, and a device that has booted is
// identified with the next. What that costs is one frame of 120 bits at most (and LSS 4Ch and Fastscan's first
// question, 135 bits each, every eighth time).
TEST(PapersMainJob, S4_20_APollEveryPeriodAndItsLoad) {
  for (const rt::Duration period : {rt::Duration(100ms), rt::Duration(1s), rt::Duration(4s)}) {
    auto machine = five_slots();
    machine.buses.front().timing.probe_period = period;
    auto plant = five_slaves();
    add_device(plant, "late", type_c, 0x99).plugged = false;
    Rig rig(machine, plant);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    rig.run_for(20s);
    {
      const Trace trace(rig);
      const unsigned periods = 40;
      rig.run_for(periods * period);
      std::size_t polls = 0;
      unsigned bits = 0;
      for (std::size_t i = 0; i < trace.lines.size(); ++i) {
        const bool rand = trace.lines[i].starts_with("1F940000#80");
        if (!rand && !trace.lines[i].starts_with("7E5#")) continue;
        polls += rand ? 1U : 0U;
        bits += trace.bits[i];
      }
      EXPECT_LE(polls, periods + 1U);
      EXPECT_GE(polls, periods * 7U / 10U) << "each question has its window of up to 20 ms behind it";
      const double load = bits / (std::chrono::duration<double>(periods * period).count() * 50'000);
      const double most = (120 + 2 * 135 / 8.0) / (std::chrono::duration<double>(period).count() * 50'000);
      EXPECT_LE(load, 1.3 * most) << "4Ch at every look would be 1.9";
      EXPECT_GE(load, 0.5 * most);
    }
    rig.run_for(37 * period / 100);
    const Trace trace(rig);
    rig.device("late").plug();
    ASSERT_TRUE(rig.run_until([&] { return !rig.device("late").truth().booting; }, 5s));
    const auto booted = rig.now();
    ASSERT_TRUE(rig.run_until([&] { return trace.count("1F50") > 0; }, 60s)) << rig.log();
    EXPECT_LE(rig.now() - booted, period + 100ms);
    EXPECT_TRUE(rig.run_until([&] { return trace.count("1F900264#") > 0; }, 5s)) << "chunk(7) 0099: identified";
  }
}

}  // namespace
}  // namespace papers_tests
