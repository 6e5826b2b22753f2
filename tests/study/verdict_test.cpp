// The judge of the figures: told of every device that is not what a run was to make of it.
#include "berth/study/verdict.hpp"

#include <gtest/gtest.h>
#include <chrono>
#include <vector>

#include "berth/lss/master.hpp"
#include "berth/study/commissioning.hpp"

namespace berth::study {
namespace {

using namespace std::chrono_literals;

Cast blank(unsigned devices) { return {.devices = devices, .speaks = {plant::Speaks::lss}}; }

// What `berth reproduce` once printed as Berth's binding: nobody is sent back to waiting, so whoever is selected stays
// in configuration and hears every later node-ID.
rt::Task<void> without_waiting(Stage& stage, std::vector<places::Assignment> seats) {
  lss::Master lss(stage.master());
  for (const auto& seat : seats) {
    const auto selected = co_await lss.switch_selective(seat.device.address);
    const auto configured = co_await lss.configure_node_id(seat.id);
    EXPECT_TRUE(selected.has_value() && configured.has_value());
  }
}

// S1.29
TEST(Verdict, ABindingWithoutWaitingIsNone) {
  Stage stage(plant_of(blank(3)), 125'000);
  stage.settle();
  const auto seats = seats_from(stage, 1);
  ASSERT_TRUE(stage.run(without_waiting(stage, seats), 1min));
  const auto lines = differences(stage, seats, Hold::pending);
  ASSERT_EQ(lines.size(), 2U) << "all three have 3 pending, which only d3 was given";
  EXPECT_EQ(lines[0], "d1: no node-ID in use, node-ID 3 pending, no node-ID stored; node-ID 1 was given");
  EXPECT_EQ(differences(stage, seats, Hold::active).size(), 3U);
}

// S1.29, S1.53
TEST(Verdict, BerthsBindingIsStoredAndInUse) {
  Stage stage(plant_of(blank(3)), 125'000);
  Commissioning berth(stage);
  stage.settle();
  const auto seats = seats_from(stage, 7);
  ASSERT_TRUE(stage.run(berth.bind(seats), 1min));
  EXPECT_EQ(berth.bound(), 3U);
  EXPECT_TRUE(differences(stage, seats, Hold::stored).empty());
  auto others = seats;
  others.pop_back();
  const auto lines = differences(stage, others, Hold::stored);
  ASSERT_EQ(lines.size(), 1U) << "d3 has one and was given none";
  EXPECT_TRUE(lines[0].ends_with("no node-ID was given")) << lines[0];
  others.push_back(others.front());
  EXPECT_EQ(differences(stage, others, Hold::stored).size(), 2U) << "and a seat that was given twice";
}

TEST(Verdict, WhoWasFoundIsComparedByAddress) {
  Stage stage(plant_of(blank(2)), 125'000);
  const auto seats = seats_from(stage, 1);
  const LssAddress one = seats[0].device.address;
  const LssAddress two = seats[1].device.address;
  EXPECT_TRUE(differences(stage, {two, one}).empty());
  EXPECT_EQ(differences(stage, {one, one}).size(), 2U) << "one twice, the other not";
  EXPECT_EQ(differences(stage, {one, two, LssAddress{1, 2, 3, 4}}).size(), 1U);
}

}  // namespace
}  // namespace berth::study
