#include "berth/operate/slot_life.hpp"

#include <array>
#include <initializer_list>

namespace berth::operate {
namespace {

// A set of lives, one bit each.
using Lives = std::uint32_t;
static_assert(lives <= 32);

constexpr Lives of(std::initializer_list<Life> each) {
  Lives set = 0;
  for (const Life life : each) set |= 1U << static_cast<unsigned>(life);
  return set;
}

constexpr Lives any = (1U << lives) - 1;
constexpr Lives there = any & ~((1U << static_cast<unsigned>(Life::present)) - 1);
constexpr Lives away = any & ~there;

struct Row {
  SlotEvent event;
  Lives from;
  Life to;
};

using E = SlotEvent;
using L = Life;
using S = places::SlotState;

// The first matching row applies; without one the event changes nothing.
constexpr Row table[] = {
    {E::rests, any, L::unknown},
    {E::freed, any, L::empty},

    {E::nobody, away, L::empty},
    {E::asks_person, away, L::question},
    {E::asks_person, there, L::used},
    {E::answered, of({L::question}), L::unknown},
    {E::binds, any, L::binding},
    {E::bound, any, L::present},
    {E::waits_for_power, any, L::waits},
    {E::binding_failed, any, L::unbound},

    {E::boots, of({L::operational}), L::asked},
    {E::heard_again, of({L::failed}), L::unbound},
    {E::heard_again, of({L::used}), L::question},
    {E::heard_again, of({L::saved}), L::waits},
    {E::heard_again, of({L::suspect}), L::doubled},
    {E::heard_again, of({L::unfit}), L::stranger},
    {E::heard_again, there, L::asked},
    {E::gone, any, L::absent},
    {E::identified, any, L::present},
    {E::runs, any, L::operational},
    {E::stopped, any, L::stopped},
    {E::wrong_type, away, L::stranger},
    {E::wrong_type, there, L::unfit},
    {E::misplaced, any, L::misplaced},
    {E::two_answer, any, L::doubled},
    {E::doubted, away, L::doubled},
    {E::doubted, there, L::suspect},
    {E::operational, there & ~of({L::suspect}), L::operational},
    {E::leaves, of({L::operational}), L::left},

    {E::configures, there, L::configuring},
    {E::prepared, there, L::present},
    {E::saves_for_power, there, L::saved},
    {E::boot_failed, there, L::failed},
    {E::boots_while_prepared, there, L::asked},
    {E::pauses, there, L::present},
    {E::tried_again, of({L::failed, L::used}), L::present},
};

constexpr std::array<places::SlotState, lives> states = {
    S::unknown,     S::empty,   S::question,  S::binding,     S::present,     S::absent,
    S::power_cycle, S::failed,  S::failed,    S::duplicate,   S::wrong_type,  // there:
    S::present,     S::present, S::present,   S::configuring, S::operational, S::question,
    S::power_cycle, S::failed,  S::duplicate, S::wrong_type,
};

}  // namespace

std::optional<Life> next(Life life, SlotEvent event) noexcept {
  for (const Row& row : table) {
    const bool fits = row.event == event && (row.from & of({life})) != 0;
    if (fits) return row.to;
  }
  return std::nullopt;
}

bool forgets_boot_up(Life before, SlotEvent event, Life now) noexcept {
  // A device that booted is identified first: if it is the slot's device, its boot-up was an error of a running device.
  if (event == E::boots || event == E::boots_while_prepared) return false;
  // The letter of a previous device is removed with it.
  if (event == E::nobody || event == E::freed) return true;
  const bool left = (is_there(before) || before == L::asked) && !is_there(now);
  return left || event == E::bound || event == E::identified || event == E::runs;
}

places::SlotState shown(Life life) noexcept { return states[static_cast<unsigned>(life)]; }

}  // namespace berth::operate
