// The recipe's table explored to the end: one slot, one device whose node-ID is an object with a signature, and every
// interleaving with lost requests, lost answers, crashes of Berth before and after each effect, and power failures.
// The table is the real one; device and store are small models. S4.2, S1.53.
#include <gtest/gtest.h>
#include <cstdint>
#include <deque>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "berth/places/recipe_binder.hpp"
#include "tests/pch.hpp"

using namespace berth;
using namespace berth::places;

namespace recipe_model_tests {
namespace {

constexpr NodeId factory(1);
constexpr NodeId place(5);
constexpr Assignment seat{{1, 2, 3, 4}, place};
constexpr int most_faults = 3;

struct State {
  NodeId memory = factory;  // what the device has stored
  NodeId active = factory;  // what it uses
  NodeId object = factory;  // written, and stored with the signature
  bool asked = false;
  bool confirmed = false;
  std::optional<RecipeBinding> work;
  int faults = 0;

  [[nodiscard]] std::string key() const {
    std::string k;
    for (const unsigned v : {unsigned{memory.value()}, unsigned{active.value()}, unsigned{object.value()},
                             unsigned{asked}, unsigned{confirmed}, static_cast<unsigned>(faults)}) {
      k.push_back(static_cast<char>(v));
    }
    if (!work) return k;
    for (const unsigned v : {static_cast<unsigned>(work->step()), static_cast<unsigned>(work->why()),
                             unsigned{work->old_id().value()}, work->tries_left(), unsigned{work->untouched()}}) {
      k.push_back(static_cast<char>(v));
    }
    return k;
  }
};

class Model {
 public:
  explicit Model(Recipe::After after) : after_(after) {}

  std::size_t explore() {
    push(State{});
    while (!queue_.empty() && !::testing::Test::HasFailure()) {
      const State s = queue_.front();
      queue_.pop_front();
      look(s);
      step(s);
      finishes(s);
    }
    return seen_.size();
  }

 private:
  void push(const State& s) {
    if (s.faults <= most_faults && seen_.insert(s.key()).second) queue_.push_back(s);
  }
  static void restart(State& s) { s.work.reset(); }

  // What must hold in every state.
  static void look(const State& s) {
    if (s.confirmed) {
      EXPECT_EQ(s.memory, place) << "confirmed, and a power failure would lose it";
    }
    const bool holds = s.memory == place || s.active == place || s.object == place;
    if (holds) {
      EXPECT_TRUE(s.asked || s.confirmed) << "the node-ID is in the device, and the store would give it away";
    }
  }

  // What the main job does: looks where the device is, and begins.
  [[nodiscard]] State begun(State s) const {
    s.work.emplace(after_, seat, s.active, 2U, s.asked);
    return s;
  }

  void step(const State& s) {
    if (s.confirmed) return;
    if (!s.work) return push(begun(s));
    if (s.work->ended()) {
      State next = s;
      const bool kept = s.work->untouched() && s.active != place;
      if (s.work->step() == RecipeStep::power_cycle) {
        power(next);
        next.work->heard_again();
        return push(next);
      }
      if (kept) next.asked = false;  // nothing was written: the slot is free again
      restart(next);
      ++next.faults;  // or the exploration would not end
      return push(next);
    }
    State good = s;
    const Outcome outcome = effect(good);
    State crashed = good;
    good.work->advance(outcome);
    push(good);
    fault(crashed, [](State& f) { restart(f); });                  // Berth dies behind the effect
    fault(s, [](State& f) { restart(f); });                        // before it
    fault(good, [](State& f) { power(f); });                       // the device's power fails
    fault(s, [](State& f) { f.work->advance(Outcome::silent); });  // the request is lost
    fault(
        crashed, [&](State& f) { f.work->advance(Outcome::silent); }, true);  // the answer is
    if (s.work->step() == RecipeStep::write) {
      State half = s;  // the object, and not the signature
      half.object = place;
      fault(half, [](State& f) { f.work->advance(Outcome::silent); });
      fault(half, [](State& f) { f.work->advance(Outcome::refused); });
      fault(half, [](State& f) { restart(f); });
      fault(half, [](State& f) { power(f); });
      fault(s, [](State& f) { f.work->advance(Outcome::unsupported); });
    }
  }

  template <class Change>
  void fault(State s, const Change& change, bool = false) {
    const auto was = s.work ? s.work->step() : RecipeStep::done;
    const bool local = was == RecipeStep::write_ask || was == RecipeStep::write_confirm;
    ++s.faults;
    const bool running = s.work.has_value();
    change(s);
    if (local && running && s.work && s.work->step() != was && s.work->step() != RecipeStep::failed) return;
    push(s);
  }

  static void power(State& s) {
    s.active = s.memory;
    s.object = s.memory;
  }

  static Outcome effect(State& s) {
    switch (s.work->step()) {
      case RecipeStep::check_vacant: return Outcome::ok;  // it is alone; at home the table does not ask
      case RecipeStep::identify_old: return s.active == s.work->old_id() ? Outcome::ok : Outcome::silent;
      case RecipeStep::write_ask: s.asked = true; return Outcome::ok;
      case RecipeStep::write:
      case RecipeStep::revert:
        if (s.active != s.work->old_id()) return Outcome::silent;
        s.object = s.memory = s.work->step() == RecipeStep::write ? place : s.work->old_id();
        return Outcome::ok;
      case RecipeStep::reset:
        if (s.active == s.work->old_id()) power(s);
        return Outcome::ok;
      case RecipeStep::await_boot_up: return s.active == place ? Outcome::ok : Outcome::silent;
      case RecipeStep::identify: return s.active == place ? Outcome::ok : Outcome::silent;
      case RecipeStep::write_confirm:
        s.asked = false;
        s.confirmed = true;
        return Outcome::ok;
      default: return Outcome::error;
    }
  }

  // Nothing goes wrong any more: the end is near, from wherever this is. A device is switched off and on at last.
  void finishes(State s) {
    for (int n = 0; n < 200 && !s.confirmed; ++n) {
      if (!s.work) {
        if (n > 100) power(s);
        s = begun(s);
      } else if (s.work->step() == RecipeStep::power_cycle) {
        power(s);
        s.work->heard_again();
      } else if (s.work->ended()) {
        restart(s);
      } else {
        const Outcome outcome = effect(s);
        s.work->advance(outcome);
      }
    }
    EXPECT_TRUE(s.confirmed);
    EXPECT_EQ(s.active, place);
    EXPECT_EQ(s.memory, place);
  }

  Recipe::After after_;
  std::set<std::string> seen_;
  std::deque<State> queue_;
};

}  // namespace

TEST(RecipeModel, S4_2_EveryInterleavingEndsWithTheNodeIdInThePlaceAndNeverElsewhere) {
  for (const auto after : {Recipe::After::reset_node, Recipe::After::reset_communication, Recipe::After::power_cycle}) {
    EXPECT_GT(Model(after).explore(), 100U);
  }
}

TEST(RecipeBinding, NothingIsWrittenBeforeTheIntentionIsDurable) {
  RecipeBinding b(Recipe::After::reset_node, seat, factory);
  for (const auto step :
       {RecipeStep::check_vacant, RecipeStep::identify_old, RecipeStep::write_ask, RecipeStep::write, RecipeStep::reset,
        RecipeStep::await_boot_up, RecipeStep::identify, RecipeStep::write_confirm}) {
    ASSERT_EQ(b.step(), step) << name(b.step());
    b.advance(Outcome::ok);
  }
  EXPECT_EQ(b.step(), RecipeStep::done);
}

TEST(RecipeBinding, TwoUnderTheFactoryNodeIdAreNotTouched) {
  RecipeBinding b(Recipe::After::reset_node, seat, factory);
  b.advance(Outcome::ok);
  b.advance(Outcome::several);
  EXPECT_EQ(b.step(), RecipeStep::failed);
  EXPECT_EQ(b.why(), Why::clone);
  EXPECT_TRUE(b.untouched());
}

TEST(RecipeBinding, WhatWasWrittenIsTakenBackWhenASecondOneComes) {
  RecipeBinding b(Recipe::After::reset_node, seat, factory);
  for (int i = 0; i < 4; ++i) b.advance(Outcome::ok);
  ASSERT_EQ(b.step(), RecipeStep::reset);
  b.advance(Outcome::several);
  EXPECT_EQ(b.step(), RecipeStep::revert);
  b.advance(Outcome::ok);
  EXPECT_EQ(b.step(), RecipeStep::failed);
  EXPECT_EQ(b.why(), Why::clone);
  EXPECT_FALSE(b.untouched());
}

TEST(RecipeBinder, BytesAreLittleEndian) {
  using Bytes = std::vector<std::uint8_t>;
  EXPECT_EQ(RecipeBinder::bytes({0x2000, 0, 1, 0, true}, NodeId(5)), (Bytes{5}));
  EXPECT_EQ(RecipeBinder::bytes({0x2000, 0, 4, 0, true}, NodeId(127)), (Bytes{0x7F, 0, 0, 0}));
  EXPECT_EQ(RecipeBinder::bytes({0x2000, 0, 4, 0x65766173, false}, NodeId(5)), (Bytes{'s', 'a', 'v', 'e'}));
  EXPECT_EQ(RecipeBinder::bytes({0x2000, 0, 8, 0x0102030405060708, false}, NodeId(5)), (Bytes{8, 7, 6, 5, 4, 3, 2, 1}));
}

}  // namespace recipe_model_tests
