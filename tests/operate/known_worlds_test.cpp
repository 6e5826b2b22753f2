// Worlds of `./run faults` in which something went wrong once: each must end well. What a world does changes with the
// code, so what was found is, where it can be, a test of its own too; `./run mutants` says whether these still catch
// it.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <ostream>
#include <string>

#include "berth/harness/run_world.hpp"
#include "tests/harness/as_sold.hpp"

namespace berth::harness {
namespace {

struct Known {
  std::uint64_t seed;
  const char* what;  // docs/faults.md has more
  Draws draws = {.waits = false};
};
void PrintTo(const Known& known, std::ostream* out) { *out << known.seed << ": " << known.what; }

std::string name_of(const ::testing::TestParamInfo<Known>& world) { return "Seed" + std::to_string(world.param.seed); }

class KnownWorld : public ::testing::TestWithParam<Known> {};

TEST_P(KnownWorld, EndsWell) {
  const auto outcome = run_world(plan_world(GetParam().seed, GetParam().draws));
  EXPECT_EQ(outcome.failure, "") << GetParam().what;
}

INSTANTIATE_TEST_SUITE_P(
    Seeds, KnownWorld,
    ::testing::Values(
        Known{11275, "the reset that shows what a device stored came just after 04 00, and one receive buffer lost it"},
        Known{5622, "the answer to an earlier run's 17h is taken for that to the one behind it"},
        Known{12948, "a device that is configured while others are bound loses their 04 00, and takes their node-ID"},
        Known{13246, "a device that was deaf during the proof hears the repeated 11h"},
        Known{34057, "a device with one receive buffer loses each question behind the answers of its slot's device"},
        Known{23228, "one lost in configuration hears 11h again, and is deaf while what it stored is taken back"},
        Known{45130, "one of two devices with a slot's node-ID is deaf just when that node-ID is asked for"},
        Known{86557, "one lost in configuration hears 11h again"},
        Known{99792, "a silence before the device booted excuses the second answers of two that share a node-ID"},
        Known{141300, "the same, in the middle of a configuration"},
        Known{171681, "a slot is kept for an address that a search put together of two"},
        Known{179707, "a loan of one of two clones is taken back from the other"},
        Known{192384, "the last question beside a device that was put aside is answered late"},
        Known{209084, "one that gave back what it was lent misses the reset, and uses it on"},
        Known{249108, "a slot says two questions in turn"},
        Known{264865, "a device gets back the node-ID that another uses by now"},
        Known{287601, "a slot whose node-ID is lent is a clone's in turn"},
        Known{293790, "one lost in configuration answers 17h in the place of the one that is meant"},
        Known{313446, "a device comes under a node-ID that is just being lent"},
        Known{321406, "a device that was deaf when it was to be blanked is not asked again"},
        Known{348420, "the same, and it has the master's node-ID"},
        Known{360612, "a device that was lent the node-ID that it gave up waits for its power cycle for ever"},
        Known{392832, "a device resets between the reading back of its values and of their date"},
        Known{481048, "one that is storing wakes during the proof, and answers its last question as the other does"},
        Known{571092, "the judge: a memory write that a reset cut off had left what was there"},
        Known{599466, "a slot that failed is not tried again beside a search that two of one address keep alive"},
        Known{620764, "a device is bound again and again to the node-ID that it shares with two of one address"},
        Known{922706, "an address that a search put together leaves to a device the slot that another needs"},
        // Devices that take a node-ID at power-on only, cut cables.
        Known{1000003, "a device that returns waits for the search for one that waits", {}},
        Known{1000161, "the same, with one method", {}},
        Known{1000404, "a device that booted is lost by its old heartbeat", {}},
        Known{1001289, "told operational by its state from before its boot-up", {}},
        Known{1011078, "what comes back into an optional slot without a word is not seen", {}},
        Known{1019095, "a wake-up is lost behind another's 04 00", {}},
        Known{1039577, "a silent device in an optional slot that was given away", {}}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    Waits, KnownWorld,
    ::testing::Values(
        Known{
            2, "the slot of a device whose cable was cut stays empty, while its heartbeats are heard", {.waits = true}},
        Known{5, "a device that waits for its power cycle holds LSS, and the others wait", {.waits = true}},
        Known{13, "a slot says that no device was found, and an event has named it", {.waits = true}},
        Known{22, "a frame that came twice is told to be of two devices", {.waits = true}},
        Known{43, "beside one that waits for its power cycle a device that was switched on waits too", {.waits = true}},
        Known{1003846,
              "one SDO answer that CAN repeated, and the slot's device asked for another reason",
              {.waits = true}},
        Known{1015195, "the same", {.waits = true}},
        Known{1002339, "Fastscan finds one that waits for its power cycle, and none behind it", {.waits = true}},
        Known{
            1027169, "what a slot waited for ended behind the plan, and a device that fits is known", {.waits = true}},
        Known{1039403, "the same", {.waits = true}},
        Known{1103274, "one that was found and is deaf is told as nobody", {.waits = true}},
        Known{1109087, "a slot's own device waits for its power cycle, and the slot says nobody", {.waits = true}},
        Known{1112819, "a device that returned four times waits for a whole search", {.waits = true}},
        Known{1115129, "RAND's frames back to back are lost in small receive buffers", {.waits = true}},
        Known{1120635, "two devices answer 11h, and both store the node-ID", {.waits = true}},
        Known{1484984, "one that hears the last question before the 11h answers behind it", {.waits = true}},
        Known{1610243,
              "a device is confirmed that was told, with another, to have no node-ID since it was told its own",
              {.waits = true}},
        Known{1036651, "a device that gave its node-ID up is found by no search, and forgotten", {.waits = true}},
        Known{1623423, "the same, behind two of one address", {.waits = true}},
        Known{1477607, "a question about optional slots, and nobody looks further", {.waits = true}},
        Known{1727836, "two that wait for their power cycle are told again in one round", {.waits = true}},
        Known{1858024, "one that waits for its power cycle is told again by all tries", {.waits = true}},
        Known{1625347, "the same", {.waits = true}},
        Known{1798257, "answers to a Berth that died are second answers to the next one", {.waits = true}},
        Known{1302935, "one that is back in its slot is taken for the one that another slot misses", {.waits = true}},
        Known{1420464, "one that could not give up another slot's node-ID is told as nobody", {.waits = true}},
        Known{1436010,
              "Fastscan hears feedback, and the answer behind the window: it ends, and finds nobody",
              {.waits = true}}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    AsSold, KnownWorld,
    ::testing::Values(
        Known{5501682, "what one without a serial number has stored is not asked", {.waits = true, .as_sold = true}},
        Known{5504443,
              "one without LSS beside the slot's device, and the slot runs on",
              {.waits = true, .as_sold = true}},
        Known{5505220,
              "the judge: one with switches has the node-ID of one that waits",
              {.waits = true, .as_sold = true}},
        Known{5508962, "a question about devices whose node-IDs nothing changes", {.waits = true, .as_sold = true}},
        Known{5509982, "the same", {.waits = true, .as_sold = true}},
        Known{5510270,
              "taking away a node-ID that is not LSS's is begun again for ever",
              {.waits = true, .as_sold = true}},
        Known{7102804,
              "a second device that loses what comes behind answers holds the node-ID, unheard",
              {.waits = true, .as_sold = true}},
        Known{8002561,
              "a device out of LSS's reach is told to give its node-ID up for ever",
              {.waits = true, .as_sold = true}},
        Known{8012203, "one without a serial number is bound for ever where it sits", {.waits = true, .as_sold = true}},
        Known{8042642, "one whose slot was given away comes back without a word", {.waits = true, .as_sold = true}},
        Known{8057359, "one left in configuration takes the loan of the next one", {.waits = true, .as_sold = true}},
        Known{8211404,
              "a blank one that is none is to have the node-ID of one that runs, again and again",
              {.waits = true, .as_sold = true}},
        Known{8213505,
              "one that takes no node-ID is told to give up another's for ever",
              {.waits = true, .as_sold = true}},
        Known{8302595, "one that has not stored its node-ID is confirmed", {.waits = true, .as_sold = true}},
        Known{8430691,
              "one that kept its former node-ID behind a reset is said not to answer",
              {.waits = true, .as_sold = true}},
        Known{8476284, "one that LSS found is taken for its twin without LSS", {.waits = true, .as_sold = true}},
        Known{8510430, "a loan stands in a memory behind a binding in vain", {.waits = true, .as_sold = true}},
        Known{8517726,
              "one without LSS comes back silently to the slot that was given away",
              {.waits = true, .as_sold = true}},
        Known{8527859,
              "another device's serial number is taken for an oddity of the slot's own",
              {.waits = true, .as_sold = true}},
        Known{8531828,
              "one that booted unheard while it was started is told operational",
              {.waits = true, .as_sold = true}}),
    name_of);

// One of them was started, and the other was not, because its NMT start was lost. Whether that happens depends on each
// frame before it, so the world is run with several draws of its devices' response times.
TEST(KnownWorldOfTwoVoices, AreNotOneThatLeavesOperationalForEver) {
  std::size_t most = 0;
  for (std::uint64_t draw = 0; draw < 24; ++draw) {
    auto plan = plan_world(6040653, {.waits = true, .as_sold = true});
    plan.plant.seed += draw;
    const auto outcome = run_world(plan);
    std::size_t left = 0;
    for (auto at = outcome.log.find("it left operational"); at != std::string::npos;
         at = outcome.log.find("it left operational", at + 1)) {
      ++left;
    }
    EXPECT_LT(left, 12U) << "draw " << draw << '\n' << outcome.log;
    EXPECT_NE(outcome.log.find("s3: duplicate: two devices answer"), std::string::npos) << "draw " << draw;
    most = std::max(most, left);
  }
  EXPECT_GE(most, 3U) << "nobody left operational again and again: this world shows nothing any more";
}

}  // namespace
}  // namespace berth::harness
