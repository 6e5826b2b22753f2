#include "berth/discovery/walk_serials.hpp"

#include <algorithm>
#include <utility>

namespace berth::discovery::walk {

namespace {
constexpr unsigned neighbourhood = 8;  // width in bits
}  // namespace

rt::Task<void> Serials::all() {
  q_.frontier().clear();
  const bool feedback = !q_.children().empty();
  const auto children = q_.children();
  const auto before = report_.found.size();
  co_await by_name();
  co_await registered_by_name();
  const bool named = report_.found.size() > before;
  if (feedback) {
    for (auto it = children.rbegin(); it != children.rend(); ++it) q_.frontier().open(*it, Open::Why::heard);
  } else if (!named) {
    q_.frontier().open(Prefix{}, Open::Why::answered);
  }
  const bool look = !feedback && (q_.entered_answers() > 1 || hints_fail_);
  failed_ = 0;
  while (!devices_.over() && failed_ <= options_.retries) {
    if (q_.frontier().empty()) {
      if (!look) co_return;
      const bool left = co_await anybody_left();
      if (!left) co_return;
      q_.frontier().forget_heard();  // a device that is heard again is still there
    }
    const Open next = q_.frontier().take();
    const bool found = co_await place(next);
    if (!found || devices_.over()) continue;
    const bool there = co_await again_at_serials();
    if (!there) co_return;
    if (!feedback) co_await around();
  }
}

// Slaves that forget their part are led to it once more. The test: other devices were here when this one was found, so
// one of them answers, or they forgot.
rt::Task<bool> Serials::again_at_serials() {
  const bool test = !forgets_ && q_.entered_answers() > 1 && !std::exchange(remembering_tested_, true);
  if (test) {
    const auto left = co_await others_left();
    forgets_ = !left && !q_.is_broken();
  }
  if (!forgets_) co_return true;
  const bool led = co_await lead_to_serials();
  co_return led;
}

rt::Task<bool> Serials::lead_to_serials() {
  const auto parts = q_.way().part;
  const Heard anybody = co_await q_.start();
  if (!anybody.yes()) co_return false;
  while (q_.way().sub < 3) {
    const bool entered = co_await q_.enter(parts[q_.way().sub]);
    if (!entered) co_return false;
  }
  co_return true;
}

// Asks for expected devices by name.
rt::Task<void> Serials::by_name() {
  const auto children = q_.children();
  unsigned patient = 4;  // this many questions get the longest window
  for (const LssAddress& a : known_.expected) {
    if (a != q_.way().address(a.serial) || devices_.is_found(a) || devices_.over()) continue;
    const bool unheard = std::ranges::none_of(children, [&](Prefix p) { return p.contains(a.serial); });
    if (!children.empty() && unheard) continue;
    const Prefix whole{a.serial, 0};
    const Wait wait = patient > 0 ? Wait::bound : Wait::learnt;
    if (patient > 0) --patient;
    const Heard heard = co_await q_.ask(whole, 3, wait);
    if (!heard.yes()) continue;
    const Outcome outcome = co_await devices_.settle(a.serial);
    if (outcome != Outcome::found) continue;
    const bool there = co_await again_at_serials();
    if (!there) co_return;
  }
}

rt::Task<void> Serials::registered_by_name() {
  for (const LssAddress& a : known_.registered) {
    if (a != q_.way().address(a.serial) || devices_.is_found(a) || devices_.aside().has(a)) continue;
    if (q_.is_broken() || !devices_.stayers().ask() || devices_.enough()) co_return;
    q_.elsewhere();
    const Prefix whole{a.serial, 0};
    const Heard heard = co_await q_.ask(whole, 3, Wait::learnt);
    if (!heard.yes()) {
      devices_.stayers().note(false);
      q_.end_slice();
      continue;
    }
    const Outcome outcome = co_await devices_.settle(a.serial);
    if (outcome != Outcome::found) continue;
    q_.end_slice();
    if (q_.is_broken()) co_return;
    const bool led = co_await lead_to_serials();
    if (!led) co_return;
  }
}

// Asks for the next of a row, then the next serial number, then the neighbourhood, each only while it has been worth
// it.
rt::Task<void> Serials::around() {
  while (!devices_.over()) {
    const std::uint32_t last = report_.found.back().address.serial;
    const std::uint64_t next = std::uint64_t{last} + 1;
    Outcome outcome = Outcome::nobody;
    for (const bool up : {true, false}) {
      const auto of_row = next_of_row(last, up);
      if (outcome == Outcome::nobody && of_row) outcome = co_await guess(*of_row, row_);
    }
    if (outcome == Outcome::nobody) outcome = co_await guess(next, next_);
    if (outcome == Outcome::found) {
      const bool there = co_await again_at_serials();
      if (!there) co_return;
      continue;
    }
    const bool done = outcome == Outcome::late || devices_.over() || !near_.ask();
    if (done) co_return;
    const Prefix block = Prefix::of(last, neighbourhood);
    q_.elsewhere();
    const Heard heard = co_await q_.ask(block, 3, Wait::learnt);
    near_.note(heard.yes());
    if (heard.yes()) q_.frontier().open(block, Open::Why::answered);
    co_return;
  }
}

// The step of the row is the distance to the nearest serial number that is known here.
std::optional<std::uint32_t> Serials::next_of_row(std::uint32_t serial, bool up) const {
  constexpr unsigned longest_row = 126;
  std::uint32_t step = 0;
  const auto look = [&](const LssAddress& a) {
    const std::uint32_t apart = a.serial > serial ? a.serial - serial : serial - a.serial;
    if (a == q_.way().address(a.serial) && apart != 0 && (step == 0 || apart < step)) step = apart;
  };
  for (const LssAddress& a : known_.registered) look(a);
  for (const Found& f : report_.found) look(f.address);
  if (step == 0) return std::nullopt;
  std::uint32_t at = serial;
  for (unsigned i = 0; i < longest_row; ++i) {
    const bool ends = up ? at > 0xFFFF'FFFF - step : at < step;
    if (ends) return std::nullopt;
    at = up ? at + step : at - step;
    if (!devices_.is_found(q_.way().address(at)) && !devices_.is_registered(q_.way().address(at))) return at;
  }
  return std::nullopt;
}

// `late`: a device answered there, but not when it was to be selected.
rt::Task<Outcome> Serials::guess(std::uint64_t serial, Worth& worth) {
  const auto value = static_cast<std::uint32_t>(serial);
  if (serial > 0xFFFF'FFFF || !worth.ask()) co_return Outcome::nobody;
  if (devices_.is_found(q_.way().address(value)) || devices_.is_registered(q_.way().address(value)))
    co_return Outcome::nobody;
  const Prefix whole{value, 0};
  q_.elsewhere();
  const Heard heard = co_await q_.ask(whole, 3, Wait::learnt);
  worth.note(heard.yes());
  if (!heard.yes()) co_return Outcome::nobody;
  const Outcome outcome = co_await devices_.settle(value);
  co_return outcome == Outcome::found ? outcome : Outcome::late;
}

rt::Task<bool> Serials::anybody_left() {
  const auto half = co_await others_left();
  if (half) q_.frontier().open(*half, Open::Why::answered);
  co_return half.has_value();
}

// The half of the serial numbers in which a device answers.
rt::Task<std::optional<Prefix>> Serials::others_left() {
  for (const Prefix half : {Prefix{}.zero(), Prefix{}.one()}) {
    q_.elsewhere();
    const Heard heard = co_await q_.ask(half, 3, Wait::learnt);
    if (heard.yes()) co_return half;
  }
  co_return std::nullopt;
}

// After a serial number that no device has, devices that forgot their parts would not answer on the way back.
rt::Task<void> Serials::lead_who_forgot() {
  if (devices_.take_released()) co_await lead_to_serials();
}

// Descends from one place and takes the device that it finds there. A device that answers but is never found may answer
// for ever: after `retries` such places in a row the round ends, and the search counts it.
rt::Task<bool> Serials::place(Open place) {
  unsigned answers = place.at.bit == 32 ? q_.entered_answers() : 2;
  if (place.at.bit != 32 && place.why != Open::Why::answered) q_.elsewhere();
  if (place.at.bit != 0 && place.why != Open::Why::answered) {
    Heard heard = co_await q_.ask(place.at, q_.way().sub, Wait::learnt);
    if (!heard.yes() && place.why == Open::Why::heard) heard = co_await q_.ask(place.at, q_.way().sub, Wait::bound);
    if (!heard.yes()) {
      if (place.why == Open::Why::heard) ++failed_;
      co_return false;
    }
    answers = heard.answers;
  }
  ++failed_;
  descent_.begin(place.at);
  Prefix from = place.at;
  while (!devices_.over()) {
    const bool came = co_await descent_.down(from, answers);
    if (!came || q_.is_broken()) co_return false;
    Outcome outcome = co_await devices_.settle(descent_.leaf().value);
    if (outcome == Outcome::late) {
      if (!q_.one_only()) q_.frontier().open(descent_.leaf(), Open::Why::maybe);
      outcome = co_await devices_.settle(descent_.leaf().value ^ 1U);
    }
    if (outcome == Outcome::found) {
      failed_ = 0;
      co_return true;
    }
    if (place.at.bit == 0) co_return false;
    co_await lead_who_forgot();
    const bool again = co_await descent_.back();
    if (!again) co_return false;
    from = descent_.deepest();
    answers = 2;
  }
  co_return false;
}

// Asks for the next device of the row that ends with the last one found.
rt::Task<bool> Serials::next_of_last() {
  const LssAddress last = report_.found.back().address;
  if (last != q_.way().address(last.serial)) co_return false;
  const bool up = true;
  const auto next = next_of_row(last.serial, up);
  if (!next) co_return false;
  const Outcome outcome = co_await guess(*next, row_);
  co_return outcome == Outcome::found;
}

}  // namespace berth::discovery::walk
