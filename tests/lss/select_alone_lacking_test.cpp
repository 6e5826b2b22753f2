// One device in configuration that cannot say who it is, or which node-ID it has: services that a slave may lack
// (docs/limits.md, "LSS as far as a device has it").
#include <gtest/gtest.h>
#include <algorithm>
#include <optional>

#include "berth/lss/select_alone.hpp"
#include "lss_world.hpp"

namespace berth::lss::lacking_tests {
namespace {

using namespace berth::lss::test;

constexpr LssAddress a{0x0100'0001, 0x0000'0001, 0x0002'0003, 0x0000'0010};
constexpr LssAddress b{0x0100'0001, 0x0000'0001, 0x0002'0003, 0x0000'0011};
constexpr LssAddress other_type{0x0100'0001, 0x0000'0009, 0x0002'0003, 0x0000'0012};

Node& lacking(World& w, const LssAddress& address, LackSet lacks) {
  Node& node = w.add(address);
  node.overhears = [lacks](const can::Frame& f) {
    const auto service = lackable(command(f));
    return service && lacks.has(*service);
  };
  return node;
}
const LackSet inquiries{Lackable::inquire_identity, Lackable::inquire_node_id};

// So many requests of this command.
auto requests(const Record& record, const std::string& command) {
  return std::ranges::count_if(record.text, [&](const auto& t) { return t.starts_with("7E5#" + command); });
}

Selection select(World& w, const LssAddress& device) {
  const auto selected = w.run(select_alone(*w.master, device));
  return selected ? *selected : Selection::absent;
}

TEST(SelectAloneLacking, ADeviceThatDoesNotSayWhoItIsIsSelectedFromNobody) {
  World w;
  Node& mute = lacking(w, a, inquiries);
  w.add(b);
  EXPECT_EQ(select(w, a), Selection::alone);
  EXPECT_EQ(mute.slave.state(), State::configuration);
  EXPECT_TRUE(w.master->lacks().has(a, Lackable::inquire_identity));
  EXPECT_FALSE(w.master->lacks().has(b, Lackable::inquire_identity));
  const Record record(w.bus);
  EXPECT_EQ(select(w, a), Selection::alone);
  EXPECT_EQ(requests(record, "5"), 0) << "its time-outs were paid once";
  EXPECT_EQ(requests(record, "1180"), 1);
  EXPECT_EQ(select(w, b), Selection::alone) << "which says who it is";
}

TEST(SelectAloneLacking, AnotherOfItsTypeIsBelievedSooner) {
  World w;
  lacking(w, a, inquiries);
  lacking(w, b, inquiries);
  lacking(w, other_type, inquiries);
  const auto inquiries_for = [&](const LssAddress& device) {
    const Record record(w.bus);
    EXPECT_EQ(select(w, device), Selection::alone);
    return requests(record, "5");
  };
  EXPECT_EQ(inquiries_for(a), 4);
  EXPECT_EQ(inquiries_for(b), 1);
  EXPECT_EQ(inquiries_for(other_type), 4);
}

// Both answer alike, at one instant: their frames are one, and the silence that is asked for is broken all the same.
TEST(SelectAloneLacking, OneThatLostItsWaitingIsFoundWhateverItLacks) {
  World w;
  Node& stays = lacking(w, b, inquiries);
  lacking(w, a, inquiries);
  ASSERT_EQ(select(w, a), Selection::alone);
  ASSERT_EQ(select(w, b), Selection::alone);
  const auto lacks = stays.overhears;
  stays.overhears = [lacks](const can::Frame& f) { return lacks(f) || command(f) == Command::switch_global; };
  EXPECT_EQ(select(w, a), Selection::not_alone);
  EXPECT_TRUE(w.master->answer_times().lost);
  EXPECT_EQ(stays.slave.pending().node_id, NodeId()) << "the question has told it nothing";
  stays.overhears = lacks;
  EXPECT_EQ(select(w, a), Selection::alone);
}

TEST(SelectAloneLacking, OneThatFellSilentLacksNothing) {
  World w;
  Node& dies = w.add(a);
  dies.hears = [&](const can::Frame& f) { dies.dead = dies.dead || command(f) == Command::select_serial; };
  EXPECT_NE(select(w, a), Selection::alone);
  EXPECT_FALSE(w.master->lacks().has(a, Lackable::inquire_identity));
}

// One question lost is none that the device lacks.
TEST(SelectAloneLacking, OneThatLostAFewInquiriesLacksNothing) {
  World w;
  Node& node = w.add(a);
  unsigned lost = 0;
  node.overhears = [&lost](const can::Frame& f) {
    return lackable(command(f)) == Lackable::inquire_identity && lost++ < 3;
  };
  EXPECT_EQ(select(w, a), Selection::absent);
  EXPECT_FALSE(w.master->lacks().has(a, Lackable::inquire_identity));
  EXPECT_EQ(select(w, a), Selection::alone);
}

TEST(SelectAloneLacking, ANodeIdThatIsNotToldIsNone) {
  World w;
  lacking(w, a, {Lackable::inquire_node_id});
  w.add(b, {.node_id = NodeId(9)});
  const ServiceOptions service;
  ASSERT_EQ(select(w, a), Selection::alone);
  const auto told = w.run(ask_node_id(*w.master, a, service));
  ASSERT_TRUE(told);
  EXPECT_FALSE(told->has_value());
  const Record record(w.bus);
  EXPECT_TRUE(w.run(ask_node_id(*w.master, a, service)));
  EXPECT_TRUE(record.text.empty()) << "it was learnt";
  ASSERT_EQ(select(w, b), Selection::alone);
  const auto has = w.run(ask_node_id(*w.master, b, service));
  ASSERT_TRUE(has && *has);
  EXPECT_EQ((*has)->byte(), 9U);
}

TEST(SelectAloneLacking, WithoutAProofADoubtTakesTheNodeIdBack) {
  World w;
  Node& mute = lacking(w, a, inquiries);
  ASSERT_EQ(select(w, a), Selection::alone);
  const auto sure = w.run(configure_alone(*w.master, a, NodeId(5), true));
  ASSERT_TRUE(sure);
  EXPECT_EQ(sure->outcome, Given::Outcome::taken);
  EXPECT_TRUE(sure->stored);
  ASSERT_EQ(select(w, a), Selection::alone);
  mute.repeats = true;
  const auto doubtful = w.run(configure_alone(*w.master, a, NodeId(6), true));
  ASSERT_TRUE(doubtful);
  EXPECT_EQ(doubtful->outcome, Given::Outcome::not_alone);
  EXPECT_EQ(mute.slave.pending().node_id, NodeId());
}

}  // namespace
}  // namespace berth::lss::lacking_tests
