// What devices tell of themselves by EMCY: events, the history, a slot's last error; repeated ones are counted.
#include "berth/operate/emergencies.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;

namespace {

constexpr std::uint32_t drive = 0x0002'0192;  // 1000h: CiA 402

design::Machine slot_three(std::uint32_t device_type = 0) {
  auto machine = one_bus(125'000);
  add_slot(machine, 3, type_b);
  machine.slots.front().spec.device_type = device_type;
  // Under this one's node-ID any node can speak: a device that hears its own identifiers answers by an EMCY 8150h.
  add_slot(machine, 4, type_c);
  machine.slots.back().spec.optional = true;
  return machine;
}

plant::PlantFile its_device() {
  auto plant = one_bus_plant(1);
  add_device(plant, "a", type_b, 7);
  return plant;
}

class Emcy : public testing::Test {
 protected:
  Emcy() : rig(slot_three(), its_device()) {
    other_ = rig.world().attach_master("backbone");
    rig.begin();
    EXPECT_TRUE(rig.run_until([&] { return rig.state(3) == places::SlotState::operational; }, 20s)) << rig.log();
  }
  // A frame that any device could have sent.
  void emcy(unsigned node, std::uint16_t code, std::array<std::uint8_t, 5> info = {}, std::uint8_t reg = 0x01) {
    const auto low = static_cast<std::uint8_t>(code);
    const auto high = static_cast<std::uint8_t>(code >> 8U);
    other_->send(can::Frame::base(0x080 + node, {low, high, reg, info[0], info[1], info[2], info[3], info[4]}), 0);
    rig.run_for(5ms);
  }
  [[nodiscard]] std::vector<operate::Event> events() const {
    std::vector<operate::Event> told;
    for (const auto& event : rig.events()) {
      if (event.kind == operate::EventKind::emcy) told.push_back(event);
    }
    return told;
  }
  [[nodiscard]] std::vector<places::HistoryEntry> history() {
    std::vector<places::HistoryEntry> lines;
    const auto all = rig.store().history(std::nullopt);
    for (const auto& line : *all) {
      if (line.event == "EMCY") lines.push_back(line);
    }
    return lines;
  }
  [[nodiscard]] std::optional<operate::EmcyReport> shown() { return rig.network().report().back().emcy; }

  Rig rig;

 private:
  std::unique_ptr<sim::Controller> other_;
};

}  // namespace

TEST_F(Emcy, IsAnEventALineOfTheHistoryAndTheSlotsLastError) {
  emcy(4, 0x2310, {1, 2, 0, 0, 0}, 0x03);
  const std::string text =
      "EMCY 2310h output current too high (overload); register: generic, current; info 01 02 00 00 00";
  ASSERT_EQ(events().size(), 1U) << rig.log();
  EXPECT_EQ(events().front().slot, "s4");
  EXPECT_EQ(events().front().text, text);
  EXPECT_NE(operate::to_json(events().front()).find(R"("kind":"emcy")"), std::string::npos);
  ASSERT_EQ(history().size(), 1U);
  EXPECT_EQ(history().front().reason, text);
  EXPECT_TRUE(history().front().slot.has_value());
  EXPECT_EQ(history().front().id, NodeId(4));
  ASSERT_TRUE(shown());
  EXPECT_EQ(shown()->code, 0x2310);
  EXPECT_EQ(shown()->error_register, 0x03);
  EXPECT_EQ(shown()->count, 1U);
  const auto json = operate::to_json(rig.network().report().back());
  EXPECT_NE(json.find(R"("code":"0x2310")"), std::string::npos) << json;
  const auto running = operate::to_json(rig.network().report().front());
  EXPECT_NE(running.find(R"("nmt":"operational")"), std::string::npos) << running;
}

TEST_F(Emcy, AnErrorThatIsGoneIsToldAndShownNoMore) {
  emcy(4, 0x4210);
  emcy(4, 0x0000, {}, 0);
  ASSERT_EQ(events().size(), 2U) << rig.log();
  EXPECT_TRUE(events()[1].text.starts_with("EMCY 0000h ")) << events()[1].text;
  EXPECT_FALSE(shown());
  emcy(4, 0x0000, {}, 0);
  EXPECT_EQ(events().size(), 2U) << "no error was there";
}

TEST_F(Emcy, ABootUpEndsIt) {
  ASSERT_TRUE(rig.device("a").device().errors().raise(0x4210, co::error_register::temperature));
  rig.run_for(100ms);
  ASSERT_TRUE(rig.network().report().front().emcy);
  rig.device("a").power(false);
  rig.run_for(5s);
  rig.device("a").power(true);
  ASSERT_TRUE(rig.run_until([&] { return rig.state(3) == places::SlotState::operational; }, 30s)) << rig.log();
  EXPECT_FALSE(rig.network().report().front().emcy);
}

// Node-IDs and codes that somebody invents: the store gets so many lines a minute, and the rest is told as a number.
TEST_F(Emcy, AFloodOfNodesAndCodesIsBounded) {
  for (unsigned i = 0; i < 12'000; ++i) emcy(20 + i % 90, static_cast<std::uint16_t>(0x1000U + i % 1000));
  const auto told = events().size();
  EXPECT_LE(told, 2 * (operate::Emergencies::most_lines + 1)) << "of about a minute";
  EXPECT_GE(told, operate::Emergencies::most_lines);
  rig.run_for(65s);
  const auto all = events();
  EXPECT_TRUE(std::ranges::any_of(all, [](const auto& event) {
    return event.text.find("more EMCYs were heard in a minute, and are not reported") != std::string::npos;
  })) << rig.log();
}

TEST_F(Emcy, OfANodeThatHasNoSlotIsToldByItsNodeId) {
  emcy(9, 0x8110);
  ASSERT_EQ(events().size(), 1U) << rig.log();
  EXPECT_EQ(events().front().slot, "");
  EXPECT_TRUE(events().front().text.starts_with("node 9: EMCY 8110h")) << events().front().text;
  ASSERT_EQ(history().size(), 1U);
  EXPECT_FALSE(history().front().slot);
  EXPECT_EQ(history().front().on.bus, "backbone");
}

// 400 in two seconds: one line, then one with their number, then fewer and fewer.
TEST_F(Emcy, RepeatedOnesAreCounted) {
  for (int i = 0; i < 400; ++i) emcy(4, 0x8110);
  ASSERT_EQ(events().size(), 1U) << rig.log();
  EXPECT_EQ(shown()->count, 400U);
  rig.run_for(15s);
  ASSERT_EQ(events().size(), 2U) << rig.log();
  EXPECT_NE(events()[1].text.find("EMCY 8110h"), std::string::npos);
  EXPECT_NE(events()[1].text.find(": 399 times more in 1"), std::string::npos) << events()[1].text;
  EXPECT_EQ(history().size(), 2U);
  // Behind the double pause it is as new.
  rig.run_for(25s);
  emcy(4, 0x8110);
  ASSERT_EQ(events().size(), 3U) << rig.log();
  EXPECT_TRUE(events()[2].text.starts_with("EMCY 8110h")) << events()[2].text;
  EXPECT_EQ(events()[2].text.find("more"), std::string::npos) << events()[2].text;
}

// One that comes and goes a hundred times a second for ten minutes.
TEST_F(Emcy, OneThatComesAndGoesForLongIsToldSeldom) {
  for (int i = 0; i < 600; ++i) {
    emcy(4, 0x8110);
    emcy(4, 0x0000, {}, 0);
    rig.run_for(990ms);
  }
  // 10, 20, 40 ... 640 s: at most seven lines of each of the two, and the first.
  EXPECT_LE(events().size(), 16U) << rig.log();
  EXPECT_GE(events().size(), 8U) << rig.log();
}

TEST_F(Emcy, AnotherErrorIsToldAtOnceBesideARepeatedOne) {
  for (int i = 0; i < 10; ++i) emcy(4, 0x8110);
  emcy(4, 0x4210);
  ASSERT_EQ(events().size(), 2U) << rig.log();
  EXPECT_TRUE(events()[1].text.starts_with("EMCY 4210h")) << events()[1].text;
}

// A device that makes up codes fills neither memory nor the store.
TEST_F(Emcy, ManyCodesOfOneNodeAreCountedTogether) {
  for (unsigned code = 0; code < 2000; ++code) emcy(4, static_cast<std::uint16_t>(0x1000U + code));
  EXPECT_EQ(events().size(), operate::Emergencies::most_codes + 1) << "and the first of the others";
  rig.run_for(12s);
  EXPECT_EQ(events().size(), operate::Emergencies::most_codes + 2) << rig.log();
  EXPECT_NE(events().back().text.find("EMCYs of other codes: "), std::string::npos) << events().back().text;
}

// 3210h: CiA 402 has words of its own for it.
TEST(EmcyOfADrive, InTheWordsOfItsProfile) {
  for (const std::uint32_t type : {std::uint32_t{0}, drive}) {
    auto machine = slot_three(type);
    auto plant = its_device();
    Rig rig(machine, plant);
    rig.begin();
    rig.run_for(5s);
    ASSERT_TRUE(rig.device("a").device().errors().raise(0x3210, co::error_register::voltage));
    rig.run_for(100ms);
    const auto emcy = rig.network().report().front().emcy;
    ASSERT_TRUE(emcy) << rig.log();
    EXPECT_EQ(emcy->text, type == drive ? "DC link over-voltage" : "internal voltage too high");
  }
}
