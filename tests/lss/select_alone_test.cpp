// One device in configuration, proven: what every path shares that configures by LSS (docs/protocols/cia305.md §State
// table, §Frames).
#include "berth/lss/select_alone.hpp"

#include <gtest/gtest.h>
#include <algorithm>
#include <array>
#include <functional>
#include <memory>
#include <span>

#include "lss_world.hpp"

namespace berth::lss {
namespace {

using namespace test;

constexpr LssAddress a{0x0100'0001, 0x0000'0001, 0x0002'0003, 0x0000'0010};
constexpr LssAddress b{0x0100'0001, 0x0000'0001, 0x0002'0003, 0x0000'0011};
constexpr LssAddress same_serial{0x0100'0001, 0x0000'0002, 0x0002'0003, 0x0000'0010};

// Loses every `04 00`, so that once selected it stays in configuration.
void loses_waiting(Node& node) {
  node.overhears = [](const can::Frame& f) { return command(f) == Command::switch_global && f.data[1] == 0; };
}
void in_configuration(World& w, Node& node) {
  ASSERT_TRUE(w.run(w.master->switch_selective(node.slave.address())));
  ASSERT_EQ(node.slave.state(), State::configuration);
}

TEST(SelectAlone, SelectsTheOneAndAsksAllItsParts) {
  World w;
  Node& one = w.add(a);
  w.add(b);
  const Record record(w.bus);
  const auto alone = w.run(select_alone(*w.master, a));
  ASSERT_TRUE(alone);
  EXPECT_EQ(*alone, Selection::alone);
  EXPECT_EQ(one.slave.state(), State::configuration);
  ASSERT_FALSE(record.text.empty());
  EXPECT_EQ(record.text[0], "7E5#0400000000000000");
  for (const char* part : {"7E5#5D00000000000000", "7E5#5A00000000000000", "7E5#5B00000000000000"}) {
    EXPECT_EQ(std::ranges::count(record.text, part), 1) << part;
  }
}

// Equal devices without serial numbers: 40h to 43h would select all of them.
TEST(SelectAlone, TheOneWithoutANodeIdAmongItsEquals) {
  constexpr LssAddress unnumbered{0x0100'0001, 0x0000'0001, 0x0002'0003, 0};
  World w;
  Node& seated = w.add(unnumbered, {.node_id = NodeId(5)});
  EXPECT_EQ(w.run(any_without_node_id(*w.master, unnumbered)), false);
  Node& blank = w.add(unnumbered);
  EXPECT_EQ(w.run(any_without_node_id(*w.master, unnumbered)), true);
  EXPECT_EQ(blank.slave.state(), State::waiting);
  EXPECT_EQ(w.run(any_without_node_id(*w.master, b)), false);
  const AloneOptions options{.without_node_id = true};
  const auto alone = w.run(select_alone(*w.master, unnumbered, options));
  ASSERT_TRUE(alone);
  EXPECT_EQ(*alone, Selection::alone);
  EXPECT_EQ(blank.slave.state(), State::configuration);
  EXPECT_EQ(seated.slave.state(), State::waiting);
}

// CiA 305: switch selective is served in waiting only, so a device that is in configuration already needs `04 00`.
TEST(SelectAlone, WhoIsInConfigurationAlreadyIsSelectedToo) {
  World w;
  Node& one = w.add(a);
  in_configuration(w, one);
  const auto alone = w.run(select_alone(*w.master, a));
  ASSERT_TRUE(alone);
  EXPECT_EQ(*alone, Selection::alone);
}

TEST(SelectAlone, AnotherThatLostItsWaitingIsHeardAndNobodyIsChanged) {
  for (const rt::Duration slow : {rt::Duration(microseconds(300)), rt::Duration(milliseconds(60))}) {
    World w;
    Node& left = w.add(a, {}, slow);
    in_configuration(w, left);
    loses_waiting(left);
    Node& one = w.add(b);
    w.master = std::make_unique<Master>(w.dispatcher);  // a new master knows nothing of it
    const auto alone = w.run(select_alone(*w.master, b));
    ASSERT_TRUE(alone);
    EXPECT_EQ(*alone, Selection::not_alone) << slow.count();
    w.settle();
    EXPECT_EQ(one.slave.state(), State::waiting);
    EXPECT_FALSE(one.slave.pending().node_id.configured());
    EXPECT_FALSE(left.slave.pending().node_id.configured());
  }
}

// Both answer at one instant with one content: one frame. Only another part tells them apart.
TEST(SelectAlone, EqualSerialNumbersFallIntoOneFrame) {
  World w;
  Node& left = w.add(same_serial);
  in_configuration(w, left);
  loses_waiting(left);
  w.add(a);
  w.run(select_alone(*w.master, b));
  w.master->no_strangers();  // else all parts are asked
  const AloneOptions serial_only{.parts = serial_part};
  const auto blind = w.run(select_alone(*w.master, a, serial_only));
  ASSERT_TRUE(blind);
  ASSERT_EQ(*blind, Selection::alone) << "the two answers are one frame here, or this tests nothing";
  const std::array others{same_serial, b};
  const AloneOptions told{.parts = parts_to_ask(a, others)};
  const auto alone = w.run(select_alone(*w.master, a, told));
  ASSERT_TRUE(alone);
  EXPECT_NE(*alone, Selection::alone);
  const auto all = w.run(select_alone(*w.master, a));
  ASSERT_TRUE(all);
  EXPECT_NE(*all, Selection::alone);
}

TEST(SelectAlone, PartsToAsk) {
  EXPECT_EQ(parts_to_ask(a, {}), 0x8);
  EXPECT_EQ(parts_to_ask(a, std::array{a, b}), 0x8) << "itself, and one of another serial number";
  EXPECT_EQ(parts_to_ask(a, std::array{same_serial}), 0xA) << "the product tells them apart";
  const LssAddress other_revision{a.vendor, a.product, 7, a.serial};
  const LssAddress both_differ{a.vendor, 9, 7, a.serial};
  EXPECT_EQ(parts_to_ask(a, std::array{other_revision, both_differ}), 0xC);
}

TEST(SelectAlone, NobodyIsAbsent) {
  World w;
  w.add(a);
  const auto alone = w.run(select_alone(*w.master, b));
  ASSERT_TRUE(alone);
  EXPECT_EQ(*alone, Selection::absent);
}

// 44h was lost and 40h to 43h stay unheard in configuration: the second attempt begins with `04 00`.
TEST(SelectAlone, ALostAnswerCostsAnAttempt) {
  World w;
  Node& one = w.add(a);
  bool first = true;
  one.hears = [&](const can::Frame& f) {
    one.latency = command(f) == Command::select_serial && first ? seconds(5) : milliseconds(1);
    first = first && command(f) != Command::select_serial;
  };
  const auto alone = w.run(select_alone(*w.master, a));
  ASSERT_TRUE(alone);
  EXPECT_EQ(*alone, Selection::alone);
  EXPECT_EQ(one.slave.state(), State::configuration);
}

TEST(SelectAlone, S1_22_TwoWithOneAddressAreClones) {
  World w;
  w.add(a, {}, microseconds(300));
  w.add(a, {}, milliseconds(4));
  const auto alone = w.run(select_alone(*w.master, a));
  ASSERT_TRUE(alone);
  EXPECT_EQ(*alone, Selection::clones);
  w.settle();
  for (const auto& n : w.nodes) EXPECT_EQ(n->slave.state(), State::waiting);
}

// A serial number that is told twice is not an address that two devices have: that is told when every part is (seed
// 800230 of `planner-fastscan`: two of one address stood, unheard, at the serial number of another type).
TEST(SelectAlone, TwoWithOneSerialNumberOfAnotherTypeAreNoClones) {
  for (const bool one_is_meant : {false, true}) {
    for (const PartMask parts : {parts_to_ask(a, std::array{same_serial}), all_parts}) {
      World w;
      Node& first = w.add(one_is_meant ? a : same_serial, {}, microseconds(300));
      Node& second = w.add(same_serial, {}, milliseconds(4));
      for (Node* const node : {&first, &second}) {
        if (node->slave.state() == State::waiting) in_configuration(w, *node);
        node->overhears = [](const can::Frame& f) { return command(f) == Command::switch_global; };
      }
      w.master->no_strangers();
      const auto alone = w.run(prove_alone(*w.master, a, {.parts = parts}));
      ASSERT_TRUE(alone);
      EXPECT_EQ(*alone, Selection::not_alone) << one_is_meant << ", parts " << int{parts};
    }
  }
}

TEST(SelectAlone, OneFrameThatCameTwiceIsNoClone) {
  World w;
  Node& one = w.add(a);
  unsigned asked = 0;
  one.hears = [&](const can::Frame& f) { one.repeats = command(f) == Command::inquire_serial && ++asked == 1; };
  const auto alone = w.run(select_alone(*w.master, a));
  ASSERT_TRUE(alone);
  EXPECT_EQ(*alone, Selection::alone);
  EXPECT_EQ(asked, 3U) << "again, and with all other parts";
}

// One that was told to store, and is deaf as long as it does, is in configuration beside the next. Its late answer to
// 17h says so: it did not hear the questions before, and to those behind both may answer in one frame.
TEST(SelectAlone, S1_53_OneThatWakesDuringTheProofIsAskedForEveryPart) {
  for (const int wakes_after_ms : {20, 60, 120, 180, 220, 280, 320, 360, 400}) {
    World w;
    Node& left = w.add(a);
    in_configuration(w, left);
    left.store_time = milliseconds(wakes_after_ms);
    left.deaf_while_storing = true;
    w.add(b);
    ASSERT_FALSE(w.run(w.master->store(ServiceOptions{.timeout = milliseconds(1), .retries = 0})));
    w.master = std::make_unique<Master>(w.dispatcher);  // a new master knows nothing of it
    const auto alone = w.run(select_alone(*w.master, b));
    ASSERT_TRUE(alone);
    ASSERT_FALSE(left.slave.storing()) << "or the proof was over before";
    EXPECT_EQ(*alone, Selection::not_alone) << wakes_after_ms << " ms";
  }
}

// Where no frame came uninvited for as long as four questions take, the serial number's window is that of the others
// too.
TEST(SelectAlone, OnACalmBusTheFirstProofTakesOneWindow) {
  World w;
  w.add(a);
  const auto timed = [&] {
    w.master->suspect_strangers();
    w.settle(milliseconds(400));
    const Record record(w.bus);
    const rt::Time before = w.master->now();
    const auto alone = w.run(select_alone(*w.master, a));
    EXPECT_TRUE(alone && *alone == Selection::alone);
    for (const char* part : {"7E5#5A0", "7E5#5B0", "7E5#5C0", "7E5#5D0"}) {
      EXPECT_EQ(std::ranges::count_if(record.text, [&](const auto& t) { return t.starts_with(part); }), 1) << part;
    }
    return w.master->now() - before;
  };
  const auto calm = timed();
  EXPECT_GT(calm, milliseconds(100));
  EXPECT_LT(calm, milliseconds(130));
  const auto after_a_stray_answer = [&](bool to_another_request) {
    w.master->suspect_strangers();
    w.settle(milliseconds(400));
    w.world.after(milliseconds(5), [&] { w.nodes[0]->say(answer(Command::store)); });
    if (to_another_request) w.run(w.master->identify_non_configured());
    w.settle(milliseconds(200));
    const rt::Time before = w.master->now();
    EXPECT_TRUE(w.run(select_alone(*w.master, a)));
    return w.master->now() - before;
  };
  EXPECT_GT(after_a_stray_answer(false), milliseconds(400)) << "each part has a whole window";
  EXPECT_GT(after_a_stray_answer(true), milliseconds(400));
}

/// A port that reads two frames at once where one came.
class Doubling final : public can::Port, private can::Listener {
 public:
  explicit Doubling(can::Port& inner) : inner_(&inner) {}
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override { return inner_->send(frame, tag); }
  void withdraw(std::uint32_t tag) noexcept override { inner_->withdraw(tag); }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    inner_->listen(listener != nullptr ? this : nullptr, accept);
  }
  can::Status status() const noexcept override { return inner_->status(); }
  bool restart(std::uint32_t bit_rate) noexcept override { return inner_->restart(bit_rate); }
  std::function<bool(const can::Frame&)> doubles;

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override {
    listener_->received(frame, at);
    if (doubles && doubles(frame)) listener_->received(frame, at);
  }
  void sent(std::uint32_t tag, rt::Time at) noexcept override { listener_->sent(tag, at); }
  void changed(const can::Status& status, rt::Time at) noexcept override { listener_->changed(status, at); }
  can::Port* inner_;
  can::Listener* listener_ = nullptr;
};

// Two answers that were read at once: when the second is delivered, the first has ended its question.
TEST(SelectAlone, OnACalmBusAnAnswerRightBehindAnotherCounts) {
  World w;
  w.add(a);
  const auto controller = w.bus.attach();
  Doubling port(*controller);
  can::Dispatcher dispatcher(w.world.executor(), port);
  w.master = std::make_unique<Master>(dispatcher);
  w.settle(milliseconds(500));
  unsigned answers = 0;
  port.doubles = [&](const can::Frame& f) { return command(f) == Command::inquire_product && ++answers == 1; };
  const auto alone = w.run(select_alone(*w.master, a));
  ASSERT_TRUE(alone);
  EXPECT_EQ(*alone, Selection::alone);
  EXPECT_EQ(w.master->answer_times().unexpected, 1U);
  EXPECT_EQ(answers, 2U) << "all parts are asked once more";
  w.master.reset();
}

// Whatever another has in common with the one that is meant, and however late its answers are.
TEST(SelectAlone, S1_53_OnACalmBusASlowOneInConfigurationIsHeard) {
  for (unsigned differs = 0; differs < 4; ++differs) {
    for (const int late_us : {300, 900, 1'100, 2'000, 3'500, 7'000, 30'000, 90'000}) {
      World w;
      LssAddress other = a;
      std::array parts{&other.vendor, &other.product, &other.revision, &other.serial};
      *parts[differs] += 1;
      Node& left = w.add(other, {}, microseconds(late_us));
      in_configuration(w, left);
      loses_waiting(left);
      w.add(a);
      w.master = std::make_unique<Master>(w.dispatcher);
      w.settle(milliseconds(500));
      const auto alone = w.run(select_alone(*w.master, a));
      ASSERT_TRUE(alone);
      EXPECT_NE(*alone, Selection::alone) << "part " << differs << ", " << late_us << " us";
    }
  }
}

// Its answer to 17h breaks the calm when it hears again: before the proof, in it, or after it, to the questions one by
// one.
TEST(SelectAlone, S1_53_OnACalmBusOneThatWakesIsAskedForEveryPart) {
  for (const int begins_ms : {350, 400, 450, 500}) {
    for (const int wakes_after_ms : {20, 200, 390, 405, 415, 430, 460, 490, 510}) {
      if (wakes_after_ms > begins_ms + 100) continue;  // deaf for longer than it was listened for
      World w;
      Node& left = w.add(a);
      in_configuration(w, left);
      left.store_time = milliseconds(wakes_after_ms);
      left.deaf_while_storing = true;
      w.add(b);
      ASSERT_FALSE(w.run(w.master->store(ServiceOptions{.timeout = milliseconds(1), .retries = 0})));
      w.master = std::make_unique<Master>(w.dispatcher);
      loses_waiting(left);
      w.settle(milliseconds(begins_ms));
      const auto alone = w.run(select_alone(*w.master, b));
      ASSERT_TRUE(alone);
      EXPECT_EQ(*alone, Selection::not_alone) << "begins " << begins_ms << " ms, wakes " << wakes_after_ms << " ms";
    }
  }
}

// After Fastscan's last match the device is in configuration: it answers 5Dh there.
TEST(SelectAlone, ProvesWhomFastscanSelected) {
  World w;
  Node& one = w.add(a);
  in_configuration(w, one);
  const auto alone = w.run(prove_alone(*w.master, a));
  ASSERT_TRUE(alone);
  EXPECT_EQ(*alone, Selection::alone);
  const auto wrong = w.run(prove_alone(*w.master, b));
  ASSERT_TRUE(wrong);
  EXPECT_EQ(*wrong, Selection::not_alone);
  EXPECT_EQ(one.slave.state(), State::waiting);
}

TEST(SelectAlone, WindowsAreLearntAndADoubtMakesThemLongAgain) {
  World w;
  w.add(a);
  const auto timed = [&] {
    const rt::Time before = w.master->now();
    const auto alone = w.run(select_alone(*w.master, a));
    EXPECT_TRUE(alone && *alone == Selection::alone);
    return w.master->now() - before;
  };
  const auto first = timed();
  const auto learnt = timed();
  EXPECT_GT(first, milliseconds(100));
  EXPECT_LT(learnt, milliseconds(60)) << "four windows of some 6 ms, and 13 frames";
  w.master->suspect_strangers();
  EXPECT_GT(timed(), milliseconds(100));
}

// A device that hears nothing while the proof is asked, and answers late. `from`: the 11h that it hears again, 1 the
// first.
void deaf_until_11h(Node& node, int from) {
  node.overhears = [from, seen = 0](const can::Frame& f) mutable {
    const bool gives = command(f) == Command::configure_node_id;
    if (gives) ++seen;
    return !gives || seen < from;
  };
}

// Every device answers within 1 ms: afterwards a window is far shorter than 30 ms.
void learn_windows(World& w, const LssAddress& device) {
  for (int i = 0; i < 2; ++i) {
    const auto alone = w.run(select_alone(*w.master, device));
    ASSERT_TRUE(alone && *alone == Selection::alone);
  }
  ASSERT_LT(window_of(*w.master, {}), milliseconds(20));
}

// The first 11h is lost in the one that is meant. Its repetition is heard by another too, whose answer comes behind.
TEST(ConfigureAlone, S1_53_WhatHadToBeSaidTwiceIsProvenOnceMore) {
  World w;
  Node& left = w.add(a);
  in_configuration(w, left);
  deaf_until_11h(left, 2);
  left.latency = milliseconds(30);  // beyond the learnt window
  Node& one = w.add(b);
  learn_windows(w, b);
  one.overhears = [lost = false](const can::Frame& f) mutable {
    return command(f) == Command::configure_node_id && !std::exchange(lost, true);
  };
  bool hears = false;
  left.hears = [&](const can::Frame& f) {
    if (command(f) != Command::configure_node_id || std::exchange(hears, true)) return;
    left.overhears = nullptr;
  };
  const bool store = false;
  const auto given = w.run(configure_alone(*w.master, b, NodeId(5), store));
  ASSERT_TRUE(given);
  EXPECT_TRUE(hears);
  EXPECT_EQ(given->outcome, Given::Outcome::not_alone);
  for (const Node* node : {&left, &one}) EXPECT_FALSE(node->slave.active().node_id.configured());
}

// Another hears the first 11h, and its answer comes behind that of the device which is meant.
TEST(ConfigureAlone, S1_53_AnAnswerBehindTheFirstIsWaitedFor) {
  for (const int late_us : {1'500, 2'000, 4'000}) {
    World w;
    Node& left = w.add(a, {}, microseconds(late_us));
    in_configuration(w, left);
    deaf_until_11h(left, 1);
    Node& one = w.add(b);
    learn_windows(w, b);
    left.hears = [&](const can::Frame&) { left.overhears = nullptr; };
    const bool store = false;
    const auto given = w.run(configure_alone(*w.master, b, NodeId(5), store));
    ASSERT_TRUE(given);
    EXPECT_EQ(given->outcome, Given::Outcome::not_alone) << late_us;
    for (const Node* node : {&left, &one}) EXPECT_FALSE(node->slave.active().node_id.configured()) << late_us;
  }
}

// One that was selected and stopped answering is in configuration somewhere: who answers 11h is heard to the end.
TEST(ConfigureAlone, S1_53_WhereADeviceWasLostEveryAnswerIsWaitedFor) {
  World w;
  Node& left = w.add(a);
  left.overhears = [](const can::Frame& f) {
    const bool asks = static_cast<std::uint8_t>(command(f)) >= 0x5A && static_cast<std::uint8_t>(command(f)) <= 0x5E;
    return asks || command(f) == Command::configure_node_id || (f.data[0] == 0x04 && f.data[1] == 0x00);
  };
  const auto lost = w.run(select_alone(*w.master, a));
  ASSERT_TRUE(lost);
  ASSERT_EQ(*lost, Selection::absent);
  ASSERT_EQ(left.slave.state(), State::configuration);
  EXPECT_TRUE(w.master->answer_times().lost);
  Node& one = w.add(b);
  learn_windows(w, b);
  left.overhears = nullptr;
  left.latency = milliseconds(30);
  const bool store = false;
  const auto given = w.run(configure_alone(*w.master, b, NodeId(5), store));
  ASSERT_TRUE(given);
  EXPECT_EQ(given->outcome, Given::Outcome::not_alone);
  for (const Node* node : {&left, &one}) EXPECT_FALSE(node->slave.active().node_id.configured());
}

// A device came under the node-ID between the question for it and the `04 00` that brings it into use.
TEST(ConfigureAlone, S1_53_ANodeIdThatIsTakenMeanwhileIsTakenBack) {
  struct Taken final : Vacancy {
    [[nodiscard]] bool still_vacant(NodeId) const noexcept override { return false; }
  };
  World w;
  Node& one = w.add(a);
  ASSERT_TRUE(w.run(select_alone(*w.master, a)));
  const Taken taken;
  for (const bool store : {false, true}) {
    const auto given = w.run(configure_alone(*w.master, a, NodeId(5), store, {.vacancy = &taken}));
    ASSERT_TRUE(given);
    EXPECT_EQ(given->outcome, Given::Outcome::occupied);
    EXPECT_FALSE(one.slave.active().node_id.configured());
    EXPECT_EQ(one.stores, 0U);
    ASSERT_TRUE(w.run(select_alone(*w.master, a)));
  }
}

TEST(SelectAlone, TheBusIsAnError) {
  World w;
  w.add(a);
  w.port->power(false);
  const auto alone = w.run(select_alone(*w.master, a));
  ASSERT_FALSE(alone);
  EXPECT_EQ(alone.error().code, Errc::bus);
}

}  // namespace
}  // namespace berth::lss
