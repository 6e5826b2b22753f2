// Fastscan of the master against slaves on the simulated bus, plain and with feedback (S4.4 to S4.13, HC3.3).
#include "berth/lss/fastscan.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <bit>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "berth/base/random.hpp"
#include "lss_world.hpp"

namespace berth::lss::test {
namespace {

constexpr LssAddress paper4{0x0135'5341, 0x0447'0003, 0x0002'0006, 0xFEED'F00D};

/// Gives node-IDs from 1 on, in the order of finding.
struct Owner final : FastscanOwner {
  NodeId assign(const FastscanDevice& device) noexcept override {
    asked.push_back(device.address);
    if (next > last) return {};
    return NodeId(static_cast<std::uint8_t>(next++));
  }
  void assigned(const FastscanDevice& device) noexcept override { given.push_back(device); }
  unsigned next = 1;
  unsigned last = 127;
  std::vector<LssAddress> asked;
  std::vector<FastscanDevice> given;
};

struct FastscanWorld : World {
  explicit FastscanWorld(std::uint64_t seed = 1) : World(125'000, seed) {
    master->set_options({.service = {.timeout = milliseconds(20), .retries = 1},
                         .store = {.timeout = milliseconds(500), .retries = 0},
                         .feedback_base = default_feedback_base});
  }
  Node& with(const LssAddress& address, Feedback feedback = Feedback::none, rt::Duration latency = milliseconds(1)) {
    return add_slave({.address = address, .feedback = feedback}, latency);
  }
  Result<std::optional<FastscanDevice>> scan(const FastscanOptions& o) {
    Fastscan fastscan(*master, o);
    return run(fastscan.scan(), seconds(600));
  }
  Result<FastscanReport> discover(const FastscanOptions& o) {
    Fastscan fastscan(*master, o);
    return run(fastscan.discover(owner), seconds(6000));
  }
  /// HC3.3: every address that was reported is one that is there, and its device has the node-ID that it was given.
  void expect_truth(const FastscanReport& report) const {
    for (const auto& found : report.found) {
      const auto is = [&](const auto& n) { return n->slave.address() == found.address; };
      const auto it = std::ranges::find_if(nodes, is);
      if (it == nodes.end()) {
        ADD_FAILURE() << "nobody has " << to_string(found.address);
        continue;
      }
      if (found.assigned.configured()) {
        EXPECT_EQ((*it)->slave.active().node_id, found.assigned);
      }
    }
  }
  Owner owner;
};

std::vector<std::string> requests(const Record& record) {
  std::vector<std::string> found;
  for (const auto& line : record.text) {
    if (line.starts_with("7E5#51")) found.push_back(line);
  }
  return found;
}

LssAddress any_address(Random& random) {
  const auto part = [&] { return static_cast<std::uint32_t>(random.below(std::uint64_t{1} << 32)); };
  const auto vendor = part();
  const auto product = part();
  const auto revision = part();
  return {vendor, product, revision, part()};
}

// --- one request -----------------------------------------------------------------------------------------------------

TEST(FastscanRequest, SilenceIsAnAnswer) {
  FastscanWorld w;
  w.add(paper4, Settings{NodeId(5), BitRateIndex::kbit_125});  // acknowledges
  const auto nobody = w.run(w.master->fastscan({}));
  ASSERT_TRUE(nobody);
  EXPECT_EQ(nobody->answers, 0U);
  EXPECT_EQ(nobody->attempts, 1U);
  EXPECT_EQ(w.run(w.master->fastscan({0, 32, 0, 0})).error().code, Errc::invalid);
  EXPECT_EQ(w.run(w.master->fastscan({0, 0, 4, 0})).error().code, Errc::invalid);
}

// S4.5: all answer with the same frame, whoever they are: at one instant it is one frame on the bus, at different ones
// several, and never an error. Compare: addresses (inquired of two at one instant) differ under one identifier.
TEST(FastscanRequest, S4_5_AnswersOfManyDoNotCollide) {
  Random random(5);
  for (const bool one_instant : {true, false}) {
    FastscanWorld w;
    for (unsigned i = 0; i < 30; ++i) {
      w.with(any_address(random), Feedback::none, one_instant ? milliseconds(1) : microseconds(500 + 331 * (i % 11)));
    }
    const Record record(w.bus);
    const auto reply = w.run(
        w.master->fastscan({}, lss::ServiceOptions{.timeout = milliseconds(60), .retries = 0, .full_window = true}));
    ASSERT_TRUE(reply);
    EXPECT_FALSE(reply->differ);
    const auto answers = static_cast<std::size_t>(std::ranges::count(record.text, "7E4#4F00000000000000"));
    EXPECT_EQ(answers + 1, record.text.size()) << "the request, and nothing else";
    if (one_instant) {
      EXPECT_EQ(answers, 1U);
    } else {
      EXPECT_GT(answers, 1U);
    }
    EXPECT_EQ(w.bus.statistics().collisions, 0U);
    EXPECT_EQ(w.bus.statistics().error_frames, 0U);
    EXPECT_EQ(w.port->errors().rec(), 0U);
  }
  FastscanWorld w;
  for (const auto serial : {1U, 2U}) w.with({1, 1, 0, serial});
  ASSERT_TRUE(w.run(w.master->switch_global(State::configuration)));
  (void)w.run(w.master->inquire(3));
  EXPECT_GT(w.bus.statistics().collisions, 0U);
  EXPECT_GT(w.port->errors().rec(), 0U);
}

TEST(FastscanRequest, TheWindowIsWholeOrEndsAtTheFirstAnswer) {
  FastscanWorld w;
  w.with({1, 1, 0, 1}, Feedback::none, milliseconds(1));
  w.with({1, 1, 0, 2}, Feedback::none, milliseconds(6));
  const auto whole = w.run(
      w.master->fastscan({}, lss::ServiceOptions{.timeout = milliseconds(20), .retries = 0, .full_window = true}));
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->answers, 2U);
  EXPECT_EQ(w.world.now() - whole->sent, milliseconds(20));
  EXPECT_GT(whole->last_at, whole->heard_at[0] + milliseconds(4));
  const auto first = w.run(
      w.master->fastscan({}, lss::ServiceOptions{.timeout = milliseconds(20), .retries = 0, .full_window = false}));
  ASSERT_TRUE(first);
  EXPECT_EQ(first->answers, 1U);
  EXPECT_LT(w.world.now() - first->sent, milliseconds(3));
}

// S4.13: different feedback arbitrates, equal merges; distinct values, ascending, those of both kinds.
TEST(FastscanRequest, S4_13_FeedbackOfManyIsCollected) {
  FastscanWorld w;
  w.with({0x0002'0000, 1, 0, 1}, Feedback::extended);
  w.with({0x0001'FFFF, 1, 0, 2}, Feedback::extended, milliseconds(3));
  w.with({0x0001'0000, 1, 0, 3}, Feedback::extended);
  w.with({0x7000'0000, 1, 0, 4}, Feedback::base);
  w.with({5, 1, 0, 5});
  const Record record(w.bus);
  const auto reply = w.run(w.master->fastscan({}));
  ASSERT_TRUE(reply);
  ASSERT_EQ(reply->feedback.size(), 3U);
  EXPECT_EQ(reply->feedback[0].feedback, (FeedbackValue{Feedback::extended, false, 1}));
  EXPECT_EQ(reply->feedback[1].feedback, (FeedbackValue{Feedback::extended, false, 2}));
  EXPECT_EQ(reply->feedback[2].feedback, (FeedbackValue{Feedback::base, false, 7}));
  EXPECT_EQ(reply->feedback[0].times, 2U);
  EXPECT_EQ(reply->feedback[1].times, 1U);
}

// S4.10, the trap: a slave's controller that sends by identifier would send the base frame first. The answer waits for
// its feedback; another's answer may stand between, and the master does not pair them.
TEST(FastscanRequest, S4_10_FeedbackIsSentBeforeTheAnswerOfTheSameSlave) {
  for (const auto order : {sim::TxOrder::in_order, sim::TxOrder::priority}) {
    FastscanWorld w;
    w.add_slave({.address = {0x0001'0000, 1, 0, 1}, .feedback = Feedback::extended}, milliseconds(1), {.queue = order});
    w.add_slave({.address = {0x0002'0000, 1, 0, 1}, .feedback = Feedback::extended}, milliseconds(1), {.queue = order});
    const Record record(w.bus);
    const auto reply = w.run(w.master->fastscan({}));
    ASSERT_TRUE(reply);
    const std::vector<std::string> expected{"7E5#5100000000800000", "1F900001#", "7E4#4F00000000000000", "1F900002#",
                                            "7E4#4F00000000000000"};
    EXPECT_EQ(record.text, expected);
    EXPECT_EQ(reply->answers, 2U);
    EXPECT_EQ(reply->feedback.size(), 2U);
  }
}

// What was heard before the request's own transmission belongs to the request before; without Fastscan, and without
// configured identifiers, it is nobody's.
TEST(FastscanRequest, FeedbackOutsideOfItsWindowIsNotTaken) {
  FastscanWorld w;
  auto& n = w.with(paper4);
  n.say(*can::parse_frame("1F900001#"));
  w.settle(milliseconds(1));
  auto reply = w.run(w.master->fastscan({}));
  ASSERT_TRUE(reply);
  EXPECT_TRUE(reply->feedback.empty());
  w.world.after(milliseconds(2), [&] { n.say(*can::parse_frame("1F900003#")); });
  reply = w.run(w.master->identify_non_configured());
  ASSERT_TRUE(reply);
  EXPECT_TRUE(reply->feedback.empty());
  w.world.after(milliseconds(2), [&] { n.say(*can::parse_frame("6D3#")); });
  reply = w.run(w.master->fastscan({}));
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->feedback.size(), 1U);
  w.master->set_options({});
  w.world.after(milliseconds(2), [&] { n.say(*can::parse_frame("6D3#")); });
  reply = w.run(w.master->fastscan({}));
  ASSERT_TRUE(reply);
  EXPECT_TRUE(reply->feedback.empty()) << "off unless configured (S4.11)";
}

TEST(FastscanRequest, FeedbackIsBoundedAndKeepsTheLowest) {
  FastscanWorld w;
  auto& n = w.with(paper4);
  for (unsigned i = 0; i < 300; ++i) {
    w.world.after(milliseconds(5 + i), [&n, i] {
      n.say(feedback_frame({Feedback::extended, false, static_cast<std::uint16_t>(1000 - i)}));
    });
  }
  const auto reply = w.run(
      w.master->fastscan({}, lss::ServiceOptions{.timeout = milliseconds(400), .retries = 0, .full_window = true}));
  ASSERT_TRUE(reply);
  ASSERT_EQ(reply->feedback.size(), Master::most_feedback);
  EXPECT_EQ(reply->feedback.front().feedback.value, 701);
  EXPECT_EQ(reply->feedback.back().feedback.value, 701 + 255);
}

// --- one device ------------------------------------------------------------------------------------------------------

// S4.4, S4.6: with all 128 bits any address is found, in 133 requests; merged in 129 and one more for each part whose
// bit 0 is 1.
RC_GTEST_PROP(FastscanProperty, S4_4_S4_6_AnyAddressIsFound, ()) {
  const auto part = [] {
    return *rc::gen::oneOf(rc::gen::arbitrary<std::uint32_t>(),
                           rc::gen::element<std::uint32_t>(0, 1, 0xFFFF'FFFF, 0x8000'0000, 0xFFFE'FFFE));
  };
  const LssAddress address{part(), part(), part(), part()};
  const auto form = *rc::gen::element(FastscanForm::standard, FastscanForm::merged, FastscanForm::literal);
  const auto feedback = *rc::gen::element(Feedback::none, Feedback::extended, Feedback::base);
  const auto slave = *rc::gen::element(Feedback::none, Feedback::extended, Feedback::base);
  FastscanWorld w;
  auto& n = w.with(address, slave);
  const Record record(w.bus);
  const auto found = w.scan({.form = form, .feedback = feedback});
  RC_ASSERT(found && *found);
  RC_ASSERT((*found)->address == address);
  RC_ASSERT(!(*found)->possible_clone);
  RC_ASSERT(n.slave.state() == State::configuration);
  const unsigned ones = (address.vendor & 1) + (address.product & 1) + (address.revision & 1) + (address.serial & 1);
  unsigned expected = form == FastscanForm::standard ? 133 : 129 + ones;
  if (feedback == slave && feedback == Feedback::extended) expected = 9;
  if (feedback == slave && feedback == Feedback::base) expected = 33;
  RC_ASSERT((*found)->requests == expected);
  RC_ASSERT(requests(record).size() == expected);
}

// HC3.3: the next request is never sent before the window of the one before is over, answered or not.
TEST(Fastscan, HC3_3_EveryStepWaitsItsWholeWindow) {
  for (const auto feedback : {Feedback::none, Feedback::extended}) {
    FastscanWorld w;
    w.with(paper4, feedback, microseconds(200));
    const Record record(w.bus);
    ASSERT_TRUE(w.scan({.feedback = feedback, .window = milliseconds(7)}));
    std::optional<rt::Time> before;
    for (std::size_t i = 0; i < record.text.size(); ++i) {
      if (!record.text[i].starts_with("7E5#51")) continue;
      if (before) {
        EXPECT_GE(record.times[i] - *before, milliseconds(7));
      }
      before = record.times[i];
    }
  }
}

// S2.3, S4.7: 128 bits at 10 ms are 1.28 s, not paper 4's 1.25 s; with the frames on the wire, 80h and the four
// confirmations 133 requests of 10 ms and one frame of 8 bytes (111 to 135 bits at 125 kbit/s) each.
TEST(Fastscan, S2_3_S4_7_OneDeviceAt10Milliseconds) {
  FastscanWorld w;
  w.with(paper4, Feedback::none, milliseconds(2));
  const auto began = w.world.now();
  ASSERT_TRUE(w.scan({.window = milliseconds(10), .confirm = false}));
  const auto took = w.world.now() - began;
  EXPECT_GT(took, 128 * milliseconds(10));
  EXPECT_GE(took, 133 * (milliseconds(10) + 111 * microseconds(8)));
  EXPECT_LE(took, 133 * (milliseconds(10) + 135 * microseconds(8)));
}

// S4.15: 04h only in the literal form.
TEST(Fastscan, S4_15_LssNext4OnlyInTheLiteralForm) {
  for (const auto form : {FastscanForm::standard, FastscanForm::merged, FastscanForm::literal}) {
    FastscanWorld w;
    w.with(paper4);
    const Record record(w.bus);
    ASSERT_TRUE(w.scan({.form = form}));
    const auto sent = requests(record);
    EXPECT_EQ(sent.back(), form == FastscanForm::literal ? "7E5#510DF0EDFE000304" : "7E5#510DF0EDFE000300");
    for (const auto& line : sent) {
      if (form != FastscanForm::literal) {
        EXPECT_LE(line.back(), '3') << line;
      }
    }
  }
}

// HU.6, S4.21: who has a node-ID is not found.
TEST(Fastscan, HU_6_S4_21_AConfiguredDeviceIsNotFound) {
  FastscanWorld w;
  w.add(paper4, Settings{NodeId(5), BitRateIndex::kbit_125});
  const auto found = w.scan({});
  ASSERT_TRUE(found);
  EXPECT_FALSE(*found);
}

// --- all devices -----------------------------------------------------------------------------------------------------

class FastscanAll : public ::testing::TestWithParam<Feedback> {};
INSTANTIATE_TEST_SUITE_P(, FastscanAll, ::testing::Values(Feedback::none, Feedback::extended, Feedback::base));

// S4.13: the lowest first, with feedback as without.
TEST_P(FastscanAll, AreFoundInAscendingOrderAndGetTheirNodeIds) {
  FastscanWorld w(7);
  Random random(7);
  std::vector<LssAddress> all{{1, 2, 3, 4}, {1, 2, 3, 5}, {1, 2, 3, 0x8000'0004}, {1, 2, 4, 4}, {2, 2, 3, 4}};
  for (unsigned i = 0; i < 5; ++i) all.push_back(any_address(random));
  for (const auto& a : all) w.with(a, GetParam(), microseconds(200 + 10 * random.below(150)));
  const auto report = w.discover({.feedback = GetParam(), .store = true});
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, FastscanReport::End::complete);
  EXPECT_EQ(report->restarts, 0U);
  ASSERT_EQ(report->found.size(), all.size());
  std::ranges::sort(all);
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(report->found[i].address, all[i]);
    EXPECT_EQ(report->found[i].assigned, NodeId(static_cast<std::uint8_t>(i + 1)));
    EXPECT_TRUE(report->found[i].stored);
    EXPECT_FALSE(report->found[i].possible_clone);
  }
  w.expect_truth(*report);
  for (const auto& n : w.nodes) EXPECT_EQ(n->memory.node_id, n->slave.active().node_id);
  const unsigned each = GetParam() == Feedback::none ? 133 : GetParam() == Feedback::extended ? 9 : 33;
  EXPECT_EQ(report->requests, each * all.size() + 1) << "and the 80h that nobody answers";
}

// S4.13: feedback tells only of those who have it: they come first, then the others, bit by bit.
TEST(Fastscan, S4_13_WithAndWithoutFeedbackMixed) {
  FastscanWorld w;
  w.with({1, 1, 1, 9});
  w.with({1, 1, 1, 2}, Feedback::extended);
  w.with({1, 1, 1, 1});
  w.with({1, 1, 1, 7}, Feedback::extended);
  w.with({1, 1, 1, 3}, Feedback::base);
  const auto report = w.discover({.feedback = Feedback::extended});
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, FastscanReport::End::complete);
  std::vector<std::uint32_t> serials;
  for (const auto& f : report->found) serials.push_back(f.address.serial);
  EXPECT_EQ(serials, (std::vector<std::uint32_t>{2, 7, 1, 3, 9}));
  EXPECT_EQ(report->restarts, 0U);
  EXPECT_EQ(report->requests, 2 * 9 + 3 * 133 + 1U);
  w.expect_truth(*report);
}

// The one whose feedback was followed is gone; another without feedback had answered all the while: bit by bit from
// where they are.
TEST(Fastscan, S4_13_FeedbackEndsInTheMiddleOfAScan) {
  FastscanWorld w;
  auto& speaks = w.with({0x0001'0001, 1, 1, 1}, Feedback::extended);
  w.with({0x0001'0002, 1, 1, 1});
  unsigned heard = 0;
  speaks.hears = [&](const can::Frame&) { speaks.dead = ++heard == 1; };
  const auto found = w.scan({.feedback = Feedback::extended});
  ASSERT_TRUE(found && *found);
  EXPECT_EQ((*found)->address, (LssAddress{0x0001'0002, 1, 1, 1}));
}

// S4.12: the 29-bit form loads the bus more than the one shared answer: of 16 slaves that answer at once 80h brings one
// frame, with feedback one more for each. 16 nodes, in use today, are found in order all the same.
TEST(Fastscan, S4_12_SixteenNodesWithFeedback) {
  const auto frames = [](Feedback feedback) {
    FastscanWorld w;
    for (std::uint32_t i = 0; i < 16; ++i) w.with({i << 16 | 1, 1, 1, 1}, feedback);
    const Record record(w.bus);
    EXPECT_TRUE(w.run(w.master->fastscan({})));
    w.settle();
    return record.text.size();
  };
  EXPECT_EQ(frames(Feedback::none), 2U);
  EXPECT_GE(frames(Feedback::extended), 2U + 16);

  FastscanWorld w(16);
  Random random(16);
  for (std::uint32_t i = 0; i < 16; ++i) {
    const LssAddress address{0x0135'5341, 0x0447'0003, 0x0002'0006, static_cast<std::uint32_t>(random.next())};
    w.with(address, Feedback::extended, microseconds(200 + random.below(1800)));
  }
  const auto report = w.discover({.feedback = Feedback::extended, .window = milliseconds(20)});
  ASSERT_TRUE(report);
  EXPECT_EQ(report->found.size(), 16U);
  EXPECT_EQ(report->restarts, 0U);
  EXPECT_EQ(report->requests, 16 * 9 + 1U);
  EXPECT_TRUE(std::ranges::is_sorted(report->found, {}, &FastscanDevice::address));
  w.expect_truth(*report);
}

// Feedback that nobody sent, lower than all: it is asked for, nobody answers, and the next is asked for. Behind the
// last device the closing question is asked twice.
TEST(Fastscan, ForgedFeedbackCostsARequestAndNothingElse) {
  FastscanWorld w;
  auto& n = w.with(paper4, Feedback::extended);
  auto& forger = w.add_slave({.address = {9, 9, 9, 9}, .fastscan = false});
  n.hears = [&](const can::Frame& f) {
    if (f.data[0] == 0x51) forger.say(*can::parse_frame(f.data[5] == 16 ? "1F910000#" : "1F900000#"));
  };
  const auto report = w.discover({.feedback = Feedback::extended});
  ASSERT_TRUE(report);
  ASSERT_EQ(report->found.size(), 1U);
  EXPECT_EQ(report->found[0].address, paper4);
  EXPECT_EQ(report->requests, 9 + 8 + 2U);
}

// The feedback comes in the window, and the answer behind it does not: the bus is not taken for empty.
TEST(Fastscan, FeedbackWhoseAnswerIsLateIsNotNobody) {
  FastscanWorld w;
  auto& n = w.with(paper4, Feedback::base);
  bool first = true;
  n.own_latency = [&]() -> rt::Duration { return std::exchange(first, false) ? microseconds(9'300) : milliseconds(1); };
  const auto report = w.discover({.feedback = Feedback::base});
  ASSERT_TRUE(report);
  ASSERT_EQ(report->found.size(), 1U);
  EXPECT_EQ(report->found[0].address, paper4);
}

TEST(Fastscan, TheOwnerMayGiveNobodyAnId) {
  FastscanWorld w;
  w.with({1, 1, 1, 1});
  w.with({1, 1, 1, 2});
  w.owner.last = 1;
  const auto report = w.discover({});
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, FastscanReport::End::held);
  ASSERT_EQ(report->found.size(), 2U);
  EXPECT_FALSE(report->found[1].assigned.configured());
  EXPECT_EQ(w.nodes[1]->slave.state(), State::waiting) << "it is left as it was found";
  EXPECT_EQ(w.owner.given.size(), 1U);
}

TEST(Fastscan, AsManyAsAreWanted) {
  FastscanWorld w;
  for (std::uint32_t i = 1; i <= 3; ++i) w.with({1, 1, 1, i});
  const auto report = w.discover({.most_devices = 2});
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, FastscanReport::End::limit);
  EXPECT_EQ(report->found.size(), 2U);
}

// A master that began anew: the device its last scan selected is in configuration and would answer no 80h.
TEST(Fastscan, AScanBrokenOffLeavesNobodyOut) {
  FastscanWorld w;
  auto& n = w.with(paper4);
  ASSERT_TRUE(w.scan({}));
  ASSERT_EQ(n.slave.state(), State::configuration);
  const auto report = w.discover({});
  ASSERT_TRUE(report);
  EXPECT_EQ(report->found.size(), 1U);
}

// --- bad luck --------------------------------------------------------------------------------------------------------

// HC3.3: a device that is always later than the window: its answers belong to no request. It is not found, and nobody
// else for it.
TEST(Fastscan, HC3_3_ADeviceSlowerThanTheWindow) {
  for (const int late : {8, 11, 13, 18, 25, 31}) {
    FastscanWorld w;
    w.with(paper4, Feedback::none, milliseconds(late));
    w.with({1, 1, 1, 1});
    const auto report = w.discover({.window = milliseconds(10)});
    ASSERT_TRUE(report);
    w.expect_truth(*report);
    if (late < 10) {
      EXPECT_EQ(report->found.size(), 2U) << late;
    }
  }
}

// HC3.3: a late 4Fh in the window of the very last request: without the confirmation a wrong serial number.
TEST(Fastscan, HC3_3_ALateAnswerAtTheEndIsNoConfirmation) {
  FastscanWorld w;
  auto& n = w.with({1, 1, 1, 0xF4});
  // The answer to bit 1 of the serial number comes in the window of the confirmation of 0xF7.
  unsigned wrong = 0;
  n.hears = [&](const can::Frame& f) {
    const auto r = decode_fastscan(f);
    n.latency = r && r->sub == 3 && r->bit_checked == 1 && wrong++ == 0 ? milliseconds(26) : milliseconds(1);
  };
  const auto unconfirmed = w.scan({.form = FastscanForm::standard, .confirm = false});
  ASSERT_TRUE(unconfirmed && *unconfirmed);
  EXPECT_EQ((*unconfirmed)->address.serial, 0xF7U) << "what the published procedure would report";
  wrong = 0;
  const auto confirmed = w.scan({.form = FastscanForm::standard});
  ASSERT_TRUE(confirmed && *confirmed);
  EXPECT_EQ((*confirmed)->address.serial, 0xF4U);
  wrong = 0;
  const auto report = w.discover({.form = FastscanForm::standard});
  ASSERT_TRUE(report);
  ASSERT_EQ(report->found.size(), 1U);
  EXPECT_EQ(report->found[0].address.serial, 0xF4U);
  EXPECT_EQ(report->restarts, 1U);
}

// The last answer comes too late: the device is in configuration and would answer no 80h any more. It is told to wait,
// and found.
TEST(Fastscan, ADeviceThatWasSelectedUnheardIsFoundAgain) {
  for (const auto feedback : {Feedback::none, Feedback::extended, Feedback::base}) {
    FastscanWorld w;
    auto& n = w.with(paper4, feedback);
    unsigned times = 0;
    n.hears = [&](const can::Frame& f) {
      const auto r = decode_fastscan(f);
      const bool last = r && r->sub == 3 && r->bit_checked == 0 && r->next == 0;
      n.latency = last && times++ == 0 ? milliseconds(15) : milliseconds(1);
    };
    const auto report = w.discover({.feedback = feedback, .confirm = false});
    ASSERT_TRUE(report);
    ASSERT_EQ(report->found.size(), 1U);
    EXPECT_EQ(report->found[0].address, paper4);
    EXPECT_EQ(report->restarts, 1U);
  }
}

// During the scan they change nothing. A device that says everything twice to the end cannot be told from two with one
// address: it gets no node-ID, which both would take.
TEST(Fastscan, DoubledAnswersChangeNothing) {
  for (const bool to_the_end : {false, true}) {
    for (const auto feedback : {Feedback::none, Feedback::extended}) {
      FastscanWorld w;
      for (const LssAddress& address : {paper4, LssAddress{1, 1, 1, 1}}) {
        auto& n = w.with(address, feedback);
        n.hears = [&n, to_the_end](const can::Frame& f) { n.repeats = to_the_end || command(f) == Command::fastscan; };
      }
      const auto report = w.discover({.feedback = feedback});
      ASSERT_TRUE(report);
      EXPECT_EQ(report->found.size(), to_the_end ? 1U : 2U);
      EXPECT_EQ(report->restarts, 0U);
      if (to_the_end) {
        EXPECT_EQ(report->end, FastscanReport::End::held);
        EXPECT_TRUE(report->found[0].possible_clone);
        EXPECT_FALSE(report->found[0].assigned.configured());
      } else {
        w.expect_truth(*report);
      }
    }
  }
}

// Two with one LSS address are selected together and answer twice, unless their frames fall into one.
TEST(Fastscan, TwoWithOneAddressAreAPossibleClone) {
  for (const auto feedback : {Feedback::none, Feedback::extended, Feedback::base}) {
    for (const bool confirm : {false, true}) {
      FastscanWorld w;
      w.with(paper4, feedback, milliseconds(1));
      w.with(paper4, feedback, milliseconds(3));
      const auto report = w.discover({.feedback = feedback, .confirm = confirm});
      ASSERT_TRUE(report);
      ASSERT_EQ(report->found.size(), 1U);
      EXPECT_EQ(report->found[0].address, paper4);
      EXPECT_TRUE(report->found[0].possible_clone);
    }
  }
}

// Half of the protocol: it says 4Fh to whatever is asked, and is never selected.
class FastscanLiar : public ::testing::TestWithParam<Feedback> {};
INSTANTIATE_TEST_SUITE_P(, FastscanLiar, ::testing::Values(Feedback::none, Feedback::extended, Feedback::base));
TEST_P(FastscanLiar, WhoAnswersEverythingSpoilsTheScanAndIsNotReported) {
  FastscanWorld w;
  w.with({1, 1, 1, 5}, GetParam());
  auto& liar = w.add_slave({.address = {7, 7, 7, 7}, .fastscan = false});
  liar.hears = [&](const can::Frame& f) {
    if (f.data[0] == 0x51) liar.say(answer(Command::identified));
  };
  const auto report = w.discover({.feedback = GetParam(), .retries = 2});
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, FastscanReport::End::gave_up);
  EXPECT_LE(report->found.size(), 1U);
  w.expect_truth(*report);
}

// It answers 80h and nothing else.
TEST(Fastscan, WhoAnswersOnlyTheBeginningIsGivenUp) {
  FastscanWorld w;
  auto& n = w.with(paper4);
  n.overhears = [](const can::Frame& f) { return f.data[0] == 0x51 && f.data[5] != 0x80; };
  const auto report = w.discover({.retries = 2});
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, FastscanReport::End::gave_up);
  EXPECT_EQ(report->restarts, 3U);
  EXPECT_TRUE(report->found.empty());
}

// Any step at which it drops out, for good or for one request, while another device is there.
TEST(Fastscan, ADeviceThatDropsOutAtAnyStep) {
  for (const auto feedback : {Feedback::none, Feedback::extended, Feedback::base}) {
    const unsigned steps = feedback == Feedback::none ? 133 : feedback == Feedback::base ? 33 : 9;
    for (const bool for_good : {false, true}) {
      for (unsigned step = 0; step < steps; step += feedback == Feedback::none ? 7 : 1) {
        FastscanWorld w;
        auto& n = w.with({1, 0x8001'0000, 2, 0x55}, feedback);
        w.with({1, 0x8001'0000, 2, 0x56}, feedback);
        unsigned heard = 0;
        n.overhears = [&](const can::Frame& f) {
          if (f.data[0] != 0x51) return false;
          const auto i = heard++;
          return for_good ? i >= step : i == step;
        };
        const auto report = w.discover({.feedback = feedback});
        ASSERT_TRUE(report);
        EXPECT_EQ(report->end, FastscanReport::End::complete) << step;
        w.expect_truth(*report);
        EXPECT_EQ(report->found.size(), for_good ? 1U : 2U) << step << ' ' << for_good;
      }
    }
  }
}

// A device that is plugged in at any step of a scan: the scan finds what was there, and the next finds it.
TEST(Fastscan, ADeviceThatJoinsInTheMiddleOfAScan) {
  for (const auto feedback : {Feedback::none, Feedback::extended, Feedback::base}) {
    const unsigned steps = feedback == Feedback::none ? 133 : feedback == Feedback::base ? 33 : 9;
    for (const bool lower : {true, false}) {
      for (unsigned step = 0; step < steps; step += feedback == Feedback::none ? 11 : 1) {
        FastscanWorld w;
        auto& there = w.with({1, 0x8001'0000, 2, 0x55}, feedback);
        auto& joins = w.with({1, lower ? 0x7001'0000U : 0x8001'0000U, 2, 0x56}, feedback);
        joins.dead = true;
        unsigned heard = 0;
        there.hears = [&](const can::Frame& f) {
          if (f.data[0] == 0x51 && heard++ == step) joins.dead = false;
        };
        const auto report = w.discover({.feedback = feedback});
        ASSERT_TRUE(report);
        EXPECT_EQ(report->end, FastscanReport::End::complete);
        w.expect_truth(*report);
        EXPECT_EQ(report->found.size(), 2U) << step;
      }
    }
  }
}

// Everything at once: answers late and doubled, requests unheard. Whoever is reported is there. Without
// late answers all are found; with them not always, as the windows are the published ones.
RC_GTEST_PROP(FastscanProperty, NoWrongAddressIsEverReported, ()) {
  const auto seed = *rc::gen::inRange<std::uint64_t>(1, 1'000'000);
  const auto feedback = *rc::gen::element(Feedback::none, Feedback::extended, Feedback::base);
  const auto form = *rc::gen::element(FastscanForm::standard, FastscanForm::merged, FastscanForm::literal);
  const auto outliers = *rc::gen::element<unsigned>(0, 1, 5, 20);  // per hundred
  Random random(seed);
  FastscanWorld w(seed);
  const auto devices = 1 + random.below(3);
  bool doubles = false;
  for (unsigned i = 0; i < devices; ++i) {
    const bool near = random.below(2) == 0;
    const LssAddress address = near ? LssAddress{1, 1, 1, static_cast<std::uint32_t>(100 + i)} : any_address(random);
    auto& n = w.with(address, random.below(4) == 0 ? Feedback::none : feedback);
    n.repeats = random.below(4) == 0;
    doubles = doubles || n.repeats;
    n.own_latency = [&random, outliers] {
      const bool late = random.below(100) < outliers;
      return rt::Duration(late ? milliseconds(5 + random.below(40)) : microseconds(200 + random.below(1800)));
    };
    n.overhears = [&random, outliers](const can::Frame&) { return random.below(400) < outliers; };
  }
  const auto report = w.discover({.form = form, .feedback = feedback, .retries = 8});
  RC_ASSERT(report.has_value());
  for (const auto& found : report->found) {
    const auto is = [&](const auto& n) { return n->slave.address() == found.address; };
    RC_ASSERT(std::ranges::any_of(w.nodes, is));
  }
  if (outliers == 0 && !doubles) {  // one that says everything twice may be two, and gets no node-ID
    RC_ASSERT(report->found.size() == devices);
  }
}

}  // namespace
}  // namespace berth::lss::test
