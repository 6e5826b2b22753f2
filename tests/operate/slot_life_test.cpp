// The table of a slot's life (berth/operate/slot_life.hpp): every event in every life, and every sequence of them.
#include "berth/operate/slot_life.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <set>
#include <vector>

namespace berth::operate {
namespace {

using L = Life;
using E = SlotEvent;
using places::SlotState;

std::vector<Life> all_lives() {
  std::vector<Life> all;
  for (unsigned i = 0; i < lives; ++i) all.push_back(static_cast<Life>(i));
  return all;
}

std::vector<SlotEvent> all_events() {
  std::vector<SlotEvent> all;
  for (unsigned i = 0; i < slot_events; ++i) all.push_back(static_cast<SlotEvent>(i));
  return all;
}

// All lives that sequences of `events` lead to.
std::set<Life> reached_from(Life start, const std::vector<SlotEvent>& events) {
  std::set<Life> seen{start};
  std::deque<Life> open{start};
  while (!open.empty()) {
    const Life life = open.front();
    open.pop_front();
    for (const SlotEvent event : events) {
      const auto to = next(life, event);
      if (to && seen.insert(*to).second) open.push_back(*to);
    }
  }
  return seen;
}

std::vector<SlotEvent> without(std::initializer_list<SlotEvent> those) {
  std::vector<SlotEvent> events = all_events();
  std::erase_if(events, [&](SlotEvent e) { return std::ranges::find(those, e) != those.end(); });
  return events;
}

TEST(SlotLife, EveryLifeIsReached) { EXPECT_EQ(reached_from(L::unknown, all_events()).size(), lives); }

TEST(SlotLife, EveryEventChangesSomeLife) {
  for (const SlotEvent event : all_events()) {
    const bool counts = std::ranges::any_of(all_lives(), [&](Life life) {
      const auto to = next(life, event);
      return to && *to != life;
    });
    EXPECT_TRUE(counts) << static_cast<int>(event);
  }
}

// The promise that two fields beside each other could not hold.
TEST(SlotLife, OnlyADeviceThatIsThereIsConfiguredOrOperational) {
  for (const Life life : all_lives()) {
    const SlotState state = shown(life);
    const bool works = state == SlotState::operational || state == SlotState::configuring;
    EXPECT_TRUE(!works || is_there(life)) << static_cast<int>(life);
    const bool away = state == SlotState::unknown || state == SlotState::empty || state == SlotState::binding ||
                      state == SlotState::absent;
    EXPECT_TRUE(!away || !is_there(life)) << static_cast<int>(life);
  }
}

// Whatever else is told: nobody is there before its identity was read, or a binding proved it. One in NMT stopped
// cannot be asked: it is there by its error control, and nothing is done to it before it could be identified.
TEST(SlotLife, NobodyIsThereWhoWasNotIdentified) {
  const std::vector<SlotEvent> events = without({E::bound, E::identified, E::runs, E::stopped});
  for (const Life start : all_lives()) {
    if (is_there(start)) continue;
    for (const Life life : reached_from(start, events)) EXPECT_FALSE(is_there(life)) << static_cast<int>(start);
  }
}

TEST(SlotLife, WhatPutsADeviceInDoubtEndsItsLifeAtOnce) {
  for (const Life life : all_lives()) {
    for (const SlotEvent event :
         {E::gone, E::two_answer, E::misplaced, E::freed, E::rests, E::binds, E::waits_for_power, E::binding_failed}) {
      const auto to = next(life, event);
      ASSERT_TRUE(to);
      EXPECT_FALSE(is_there(*to)) << static_cast<int>(life) << " " << static_cast<int>(event);
    }
    if (!is_there(life)) continue;
    const auto asked = next(life, E::heard_again);
    ASSERT_TRUE(asked);
    EXPECT_FALSE(is_there(*asked)) << static_cast<int>(life);
  }
}

// A device that is away hears no step of a boot-up that ends late, and a slot does not seem to be at work then.
TEST(SlotLife, ALateEndOfABootUpChangesNothingWhenTheDeviceIsAway) {
  for (const Life life : all_lives()) {
    if (is_there(life)) continue;
    for (const SlotEvent event : {E::configures, E::prepared, E::saves_for_power, E::boot_failed, E::pauses,
                                  E::tried_again, E::operational, E::leaves, E::boots, E::boots_while_prepared}) {
      EXPECT_EQ(next(life, event), std::nullopt) << static_cast<int>(life) << " " << static_cast<int>(event);
    }
  }
}

// No life is an end: the bus alone, without a person, leads from each to operational.
TEST(SlotLife, EveryLifeLeadsToOperational) {
  const std::vector<SlotEvent> of_the_bus = {E::heard_again, E::identified, E::operational, E::gone};
  for (const Life life : all_lives()) EXPECT_TRUE(reached_from(life, of_the_bus).contains(L::operational));
}

// A second device is told of by hand of a person or by asking again, not by a heartbeat of which nobody knows the
// sender.
TEST(SlotLife, AHeartbeatDoesNotEndTheDoubtAboutASecondDevice) {
  EXPECT_EQ(next(L::suspect, E::operational), std::nullopt);
  EXPECT_EQ(next(L::doubled, E::operational), std::nullopt);
  EXPECT_EQ(next(L::suspect, E::identified), L::present);
}

// An event that is told twice, or heard twice, does what it does once.
TEST(SlotLife, TheSameEventTwiceIsTheSame) {
  for (const Life life : all_lives()) {
    for (const SlotEvent event : all_events()) {
      const auto once = next(life, event);
      if (!once) continue;
      const Life twice = next(*once, event).value_or(*once);
      EXPECT_EQ(shown(twice), shown(*once)) << static_cast<int>(life) << " " << static_cast<int>(event);
    }
  }
}

// The boot-up belongs to the device: it is forgotten when the device is away, and when it is identified anew. The one
// exception is a boot-up message, because the rules of 1F80h count it as an error of the device that ran.
TEST(SlotLife, ABootUpIsForgottenWithItsDevice) {
  for (const Life life : all_lives()) {
    for (const SlotEvent event : all_events()) {
      const auto to = next(life, event);
      if (!to) continue;
      const bool leaves = is_there(life) && !is_there(*to);
      const bool by_boot_up = event == E::boots || event == E::boots_while_prepared;
      EXPECT_TRUE(!leaves || by_boot_up || forgets_boot_up(life, event, *to)) << static_cast<int>(event);
      if (is_there(life) && is_there(*to)) {
        const bool anew = event == E::bound || event == E::identified || event == E::runs;
        EXPECT_EQ(forgets_boot_up(life, event, *to), anew) << static_cast<int>(event);
      }
    }
  }
  EXPECT_FALSE(forgets_boot_up(L::operational, E::boots, L::asked));
  EXPECT_TRUE(forgets_boot_up(L::asked, E::gone, L::absent));
}

}  // namespace
}  // namespace berth::operate
