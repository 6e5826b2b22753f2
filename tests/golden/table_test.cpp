// The table that Berth reports and the one that the frames on the bus tell are the same.
#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tests/golden/example.hpp"
#include "tests/golden/trace_reader.hpp"

using namespace berth;
using namespace berth::golden;
using namespace std::chrono_literals;
using places::SlotState;

namespace {

void compare(const std::map<unsigned, TraceReader::Place>& seen, const std::vector<operate::SlotReport>& told) {
  std::set<unsigned> slots;
  for (const auto& slot : told) {
    const unsigned id = slot.id.value();
    slots.insert(id);
    ASSERT_TRUE(seen.contains(id)) << "nothing was heard of node-ID " << id;
    const auto& place = seen.at(id);
    EXPECT_EQ(place.operational, slot.state == SlotState::operational) << "node-ID " << id;
    ASSERT_TRUE(place.device && slot.device) << "node-ID " << id;
    const Address device{slot.device->address.vendor, slot.device->address.product, slot.device->address.revision,
                         slot.device->address.serial};
    EXPECT_EQ(*place.device, device) << "node-ID " << id;
  }
  for (const auto& [id, place] : seen) {
    EXPECT_TRUE(slots.contains(id) || !place.device) << "node-ID " << id << " was given away and is no slot's";
  }
}

void operational_as_heard(const std::string& name, std::size_t slots, std::uint32_t bit_rate = 0) {
  Example example(name, bit_rate);
  ASSERT_TRUE(example.ready());
  const Hearing<TraceReader> trace(example.bus());
  example.start();
  ASSERT_TRUE(example.run_until([&] { return example.session().operational(); }, 5min));
  const auto report = example.session().report();
  ASSERT_EQ(report.slots.size(), slots);
  for (const auto& slot : report.slots) EXPECT_EQ(slot.state, SlotState::operational) << slot.name;
  for (const auto& event : report.events) EXPECT_FALSE(event.text.starts_with("failed")) << to_line(event);
  compare(trace.ear.table(), report.slots);
}

// S1.28, S1.38
// HU.9, HU.35: no hardware, and the one who judges shares no code with the one who is judged.
TEST(TableFromFrames, FiveSlaves) { operational_as_heard("five-slaves", 5); }
TEST(TableFromFrames, ByEds) { operational_as_heard("by-eds", 5); }
// S1.48: the paper's emulation, one master and 120 slaves, all found and bound.
TEST(TableFromFrames, S1_48_HundredTwenty) { operational_as_heard("hundred-twenty", 120); }
// At this rate a hundred NMT starts come faster than a slow device empties its receive buffer; they are said again.
TEST(TableFromFrames, S1_48_HundredTwentyAtOneMegabit) { operational_as_heard("hundred-twenty", 120, 1'000'000); }
TEST(TableFromFrames, S1_48_HundredTwentyAtFiftyKilobit) { operational_as_heard("hundred-twenty", 120, 50'000); }

// S1.51, S1.38: the same after the replacement story.
TEST(TableFromFrames, S1_51_FiveSlavesReplaced) {
  Example example("five-slaves");
  ASSERT_TRUE(example.ready());
  const Hearing<TraceReader> trace(example.bus());
  example.start();
  const auto runs = [&](const char* name) {
    return example.world().find(name)->truth().state == NmtState::operational;
  };
  ASSERT_TRUE(example.run_until([&] { return example.session().operational(); }, 5min));
  ASSERT_TRUE(
      example.run_until([&] { return runs("s2 new") && runs("s4 new") && example.session().operational(); }, 5min));
  const auto report = example.session().report();
  compare(trace.ear.table(), report.slots);
  std::vector<std::uint32_t> serials;
  for (const auto& slot : report.slots) serials.push_back(slot.device ? slot.device->address.serial : 0);
  EXPECT_EQ(serials, (std::vector<std::uint32_t>{0x0A, 0x15, 0x08, 0x18, 0x07}));
}

// The reader itself: what it must not take for operational.
TEST(TraceReader, NeedsBootUpStartAndHeartbeat) {
  const auto operational = [](std::initializer_list<const char*> frames) {
    TraceReader reader;
    for (const auto* text : frames) reader.frame(*can::parse_frame(text), {}, 0);
    return reader.table().contains(5) && reader.table().at(5).operational;
  };
  EXPECT_TRUE(operational({"705#00", "000#0105", "705#05"}));
  EXPECT_TRUE(operational({"705#00", "000#0100", "705#05"}));
  EXPECT_FALSE(operational({"000#0105", "705#05"}));
  EXPECT_FALSE(operational({"705#00", "705#05"}));
  EXPECT_FALSE(operational({"705#00", "000#0106", "705#05"}));
  EXPECT_FALSE(operational({"705#00", "000#0105"}));
  EXPECT_FALSE(operational({"705#00", "000#0105", "705#05", "705#7F"}));
  EXPECT_FALSE(operational({"705#00", "000#0105", "705#05", "705#00"}));
  EXPECT_FALSE(operational({"705#00", "000#0105", "705#05", "000#0205"}));
}

TEST(TraceReader, GivenIsWhoWasSelectedAndConfirmed) {
  TraceReader reader;
  const auto hear = [&](std::initializer_list<const char*> frames) {
    for (const auto* text : frames) reader.frame(*can::parse_frame(text), {}, 0);
  };
  hear({"7E5#4001000001000000", "7E5#4101000000000000", "7E5#4200000000000000", "7E5#430A000000000000"});
  hear({"7E5#1105000000000000", "7E4#1100000000000000", "705#00"});
  EXPECT_FALSE(reader.table().at(5).device) << "nobody answered 44h";
  hear({"7E4#4400000000000000", "7E5#1105000000000000", "7E4#1101000000000000", "705#00"});
  EXPECT_FALSE(reader.table().at(5).device) << "the node-ID was refused";
  hear({"7E4#1100000000000000", "705#00"});
  EXPECT_EQ(reader.table().at(5).device, (Address{0x01000001, 1, 0, 0x0A}));
}

}  // namespace
