#include "berth/discovery/walk_aside.hpp"

#include <algorithm>

namespace berth::discovery::walk {

namespace {

// The largest places in `at` that contain none of `numbers`.
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

rt::Task<void> Aside::round() {
  std::vector<Place> places;
  for (unsigned parts = 4; parts-- > 0;) {  // from the longest: the other devices are most likely of the same type
    for (const LssAddress& a : devices_.aside().all()) {
      Place place{.part = {}, .parts = parts};
      for (unsigned i = 0; i < parts; ++i) place.part[i] = a.part(i);
      if (std::ranges::find(places, place) == places.end()) places.push_back(place);
    }
  }
  const auto found = report_.found.size();
  for (std::size_t i = 0; i < places.size() && !devices_.over(); ++i) {
    const Place place = places[i];
    const bool answered = co_await ask_beside(place);
    const bool done = answered || report_.found.size() > found;
    if (done || q_.is_broken()) co_return;
  }
  if (!devices_.over()) exhausted_ = true;
}

bool Aside::is_vacant(const Place& place) const {
  return std::ranges::any_of(memory_.vacant, [&](const Place& v) {
    return place.parts >= v.parts && std::equal(v.part.begin(), v.part.begin() + v.parts, place.part.begin());
  });
}

// A device that was put aside may have left the search with its node-ID after all. If no device enters its place twice
// in a row, the place is vacant.
rt::Task<Aside::Stand> Aside::stand_at(Place place) {
  Place silent;
  for (int tries = 0; tries < 2; ++tries) {
    const Heard anybody = co_await q_.start();
    if (!anybody.yes()) co_return Stand::nobody;
    bool entered = true;
    while (entered && q_.way().sub < place.parts && !q_.is_broken())
      entered = co_await q_.enter(place.part[q_.way().sub]);
    if (q_.is_broken()) co_return Stand::nobody;
    if (entered) co_return Stand::there;
    silent = place;
    silent.parts = q_.way().sub + 1;
  }
  memory_.vacant.push_back(silent);
  co_return Stand::vacant;
}

// True: the round is over, because a device answered beside them or none answers at all.
rt::Task<bool> Aside::ask_beside(Place place) {
  std::vector<std::uint32_t> numbers;
  for (const LssAddress& a : devices_.aside().all()) {
    bool here = true;
    for (unsigned i = 0; i < place.parts; ++i) here = here && a.part(i) == place.part[i];
    if (here) numbers.push_back(a.part(place.parts));
  }
  std::vector<Prefix> open;
  without(Prefix{}, numbers, open);
  std::erase_if(open, [&](Prefix p) {
    return std::ranges::any_of(memory_.silent, [&](const Silent& s) { return s.place == place && s.at == p; });
  });
  if (open.empty() || is_vacant(place)) co_return false;
  const Stand stand = co_await stand_at(place);
  if (stand != Stand::there) co_return stand == Stand::nobody;
  q_.children().clear();  // feedback of the devices put aside
  // A late answer of a device put aside would count for the first question.
  if (q_.entered_answers() < numbers.size()) co_await rt::sleep_until(q_.asker().settled());
  const bool others = q_.entered_answers() > numbers.size();
  const bool names = q_.is_in_slices() && place.parts == 3;
  if (names) {
    co_await serials_.registered_by_name();
    if (devices_.over()) co_return true;
  }
  const bool rows = place.parts == 3 && !report_.found.empty();
  if (rows) {
    const bool found = co_await serials_.next_of_last();
    if (found || q_.is_broken()) co_return true;
  }
  for (std::size_t i = 0; i < open.size() && !q_.is_broken(); ++i) {
    const Prefix at = open[i];
    q_.elsewhere();
    const bool doubted =
        std::ranges::any_of(memory_.doubted, [&](const Silent& s) { return s.place == place && s.at == at; });
    q_.be_patient_where(doubted);
    // After the last question no other follows for which a late answer could count.
    const bool last = (others && i + 1 == open.size()) || q_.is_last_of_slice();
    const Wait wait = last ? Wait::closing : Wait::learnt;
    const Heard heard = co_await q_.ask_once(at, q_.way().sub, wait);
    q_.be_patient_where(true);
    const bool before = heard.late && i > 0;  // the answer is to the place asked before this one
    if (before || heard.yes()) {
      if (before) memory_.silent.pop_back();
      const Prefix there = before ? open[i - 1] : at;
      const auto found = report_.found.size();
      co_await below(there);
      const bool led_astray = report_.found.size() == found && !devices_.aside().in_this_round();
      // A slow device there may have answered only during the first question below: next time, this place is asked with
      // more patience.
      if (led_astray) memory_.doubted.push_back({place, there, heard.at});
      if (led_astray) forget_silence(heard.at);
      co_return true;
    }
    if (!heard.sent) --i;
    if (heard.sent) memory_.silent.push_back({place, at, heard.at});
    q_.end_slice();
  }
  co_return false;
}

// The answer may belong to any of the last few questions: they are asked again, with patience.
void Aside::forget_silence(rt::Time answered) {
  std::erase_if(memory_.silent, [&](const Silent& s) {
    const bool lately = s.asked + q_.asker().longest() >= answered;
    if (lately) memory_.doubted.push_back(s);
    return lately;
  });
}

rt::Task<void> Aside::below(Prefix at) {
  q_.frontier().clear();
  if (q_.way().sub == 3) {
    const Open somebody{at, Open::Why::answered};
    co_await serials_.place(somebody);
    co_return;
  }
  descent_.begin(at);
  const bool came = co_await descent_.down(at, 2);
  if (!came || q_.is_broken()) co_return;
  const bool entered = co_await descent_.enter_leaf();
  if (entered && !q_.is_broken()) co_await route_.round();
}

}  // namespace berth::discovery::walk
