// A search: beside devices that are known and answer on, because they got no node-ID, or because they answer Fastscan
// whatever node-ID they have. They are waiting, as no device stays in configuration while others are searched for, so
// they answer whatever they fit. What they do not fit is asked instead: at each part of their addresses the places
// beside them.
#include <algorithm>

#include "berth/discovery/walk_search.hpp"

namespace berth::discovery {
namespace {

// The largest places in `at` that hold none of `numbers`.
void without(Prefix at, const std::vector<std::uint32_t>& numbers, std::vector<Prefix>& to) {
  const bool holds = std::ranges::any_of(numbers, [&](std::uint32_t n) { return at.contains(n); });
  if (!holds) {
    to.push_back(at);
  } else if (at.bit > 0) {
    without(at.zero(), numbers, to);
    without(at.one(), numbers, to);
  }
}

}  // namespace

// One device at most: one that moved on stands elsewhere afterwards, and the next round begins with 80h.
rt::Task<void> Walker::Search::beside() {
  std::vector<Place> places;
  for (unsigned parts = 4; parts-- > 0;) {  // the others are most likely of the same type
    for (const LssAddress& a : aside_) {
      Place place{.part = {}, .parts = parts};
      for (unsigned i = 0; i < parts; ++i) place.part[i] = a.part(i);
      if (std::ranges::find(places, place) == places.end()) places.push_back(place);
    }
  }
  const auto found = report_.found.size();
  for (std::size_t i = 0; i < places.size() && !over(); ++i) {
    const Place place = places[i];
    const bool answered = co_await ask_beside(place);
    const bool done = answered || report_.found.size() > found;
    if (done || broken_) co_return;
  }
  if (!over()) exhausted_ = true;
}

bool Walker::Search::is_vacant(const Place& place) const {
  return std::ranges::any_of(vacant_, [&](const Place& v) {
    return place.parts >= v.parts && std::equal(v.part.begin(), v.part.begin() + v.parts, place.part.begin());
  });
}

// A device that was put aside may have left the search with its node-ID after all: then none is led there, twice.
rt::Task<Walker::Search::Stand> Walker::Search::stand_at(Place place) {
  Place silent;
  for (int tries = 0; tries < 2; ++tries) {
    const Heard anybody = co_await start();
    if (!anybody.yes()) co_return Stand::nobody;
    bool entered = true;
    while (entered && sub_ < place.parts && !broken_) entered = co_await enter(place.part[sub_]);
    if (broken_) co_return Stand::nobody;
    if (entered) co_return Stand::there;
    silent = place;
    silent.parts = sub_ + 1;
  }
  vacant_.push_back(silent);
  co_return Stand::vacant;
}

// True: a device answered beside them, or none answers at all; the round is over.
rt::Task<bool> Walker::Search::ask_beside(Place place) {
  std::vector<std::uint32_t> numbers;
  for (const LssAddress& a : aside_) {
    bool here = true;
    for (unsigned i = 0; i < place.parts; ++i) here = here && a.part(i) == place.part[i];
    if (here) numbers.push_back(a.part(place.parts));
  }
  std::vector<Prefix> open;
  without(Prefix{}, numbers, open);
  std::erase_if(open, [&](Prefix p) {
    return std::ranges::any_of(silent_, [&](const Silent& s) { return s.place == place && s.at == p; });
  });
  if (open.empty() || is_vacant(place)) co_return false;
  const Stand stand = co_await stand_at(place);
  if (stand != Stand::there) co_return stand == Stand::nobody;
  children_.clear();  // theirs
  // An answer of theirs that is late would be one to the first question.
  if (entered_answers_ < numbers.size()) co_await rt::sleep_until(asker_.settled());
  const bool others = entered_answers_ > numbers.size();
  const bool rows = place.parts == 3 && !report_.found.empty();
  if (rows) {
    const bool found = co_await row_beside();
    if (found || broken_) co_return true;
  }
  for (std::size_t i = 0; i < open.size() && !broken_; ++i) {
    const Prefix at = open[i];
    elsewhere();
    const bool doubted = std::ranges::any_of(doubted_, [&](const Silent& s) { return s.place == place && s.at == at; });
    asker_.be_patient(patient_ && doubted, wholly_ && doubted);
    const bool last = others && i + 1 == open.size();  // no question follows that a late answer would come to
    const Wait wait = last ? Wait::bound : Wait::learnt;
    const Heard heard = co_await ask_once(at, sub_, wait);
    asker_.be_patient(patient_, wholly_);
    const bool before = heard.late && i > 0;  // the place asked before this one was answered
    if (before || heard.yes()) {
      if (before) silent_.pop_back();
      const Prefix there = before ? open[i - 1] : at;
      const auto found = report_.found.size();
      co_await below(there);
      const bool led_astray = report_.found.size() == found && !set_aside_;
      if (led_astray) forget_silence(heard.at);
      co_return true;
    }
    if (!heard.sent) --i;
    if (heard.sent) silent_.push_back({place, at, heard.at});
  }
  co_return false;
}

// The next of the row that ends with the last one found.
rt::Task<bool> Walker::Search::row_beside() {
  const LssAddress last = report_.found.back().address;
  if (last != address(last.serial)) co_return false;
  const bool up = true;
  const auto next = next_of_row(last.serial, up);
  if (!next) co_return false;
  const Outcome outcome = co_await guess(*next, row_);
  co_return outcome == Outcome::found;
}

// The answer may have been one to any of the questions shortly before it: those are asked again, patiently.
void Walker::Search::forget_silence(rt::Time answered) {
  std::erase_if(silent_, [&](const Silent& s) {
    const bool lately = s.asked + asker_.longest() >= answered;
    if (lately) doubted_.push_back(s);
    return lately;
  });
}

rt::Task<void> Walker::Search::below(Prefix at) {
  open_.clear();
  seen_.clear();
  backs_ = 0;
  careful_ = 0;
  if (sub_ == 3) {
    const Open somebody{at, Open::Why::answered};
    co_await place(somebody);
    co_return;
  }
  anchors_.assign(1, at);
  const bool came = co_await descend(at, 2);
  if (!came || broken_) co_return;
  const bool entered = co_await enter_leaf();
  if (entered && !broken_) co_await round();
}

}  // namespace berth::discovery
