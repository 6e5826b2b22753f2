// A search: the tree of one part's bits.
#include <algorithm>
#include <utility>

#include "berth/discovery/walk_search.hpp"

namespace berth::discovery {
namespace {
constexpr unsigned check_after = 6;    // conclusions from silence in a row
constexpr unsigned most_backs = 6;     // for one device
constexpr unsigned neighbourhood = 8;  // bits
}  // namespace

// ---- questions --------------------------------------------------------------------------------------------------

rt::Task<Heard> Walker::Search::ask_once(Prefix at, unsigned next, Wait wait) {
  const bool ends = broken_ || stops();
  if (ends) co_return Heard{};
  const lss::FastscanRequest request{.id = at.value,
                                     .bit_checked = at.bit,
                                     .sub = static_cast<std::uint8_t>(sub_),
                                     .next = static_cast<std::uint8_t>(next)};
  auto question = asker_.ask(request, wait, one_only());
  const auto heard = co_await question;
  if (!heard) {
    broken(heard.error());
    co_return Heard{};
  }
  if (!heard->sent) co_return *heard;
  count(*heard);
  std::vector<Prefix> late;
  take_feedback(asker_.feedback_before(), asked_sub_, asked_, late);
  if (asked_sub_ == sub_) {
    for (const Prefix p : late) open(p, Open::Why::heard);
  }
  const bool whole = at.bit == 0;
  asked_ = whole ? Prefix{} : at;
  asked_sub_ = whole ? next : sub_;
  children_.clear();
  take_feedback(asker_.feedback(), asked_sub_, asked_, children_);
  co_return *heard;
}

rt::Task<Heard> Walker::Search::ask(Prefix at, unsigned next, Wait wait) {
  Heard heard = co_await ask_once(at, next, wait);
  while (!heard.sent && !broken_) heard = co_await ask_once(at, next, wait);
  co_return heard;
}

// One answer each to questions that went ever deeper: one device. `before` is told when all that belongs to the
// question before has been heard.
void Walker::Search::count(const Heard& heard) noexcept {
  if (below_ && heard.before > 0) alone_ = heard.before == 1 ? alone_ + 1 : 0;
  below_ = true;
}

void Walker::Search::elsewhere() noexcept {
  below_ = false;
  alone_ = 0;
}

void Walker::Search::take_feedback(const std::vector<lss::FeedbackValue>& heard, unsigned sub, Prefix at,
                                   std::vector<Prefix>& to) {
  if (sub > 3 || by_bits_) return;
  for (const auto& f : heard) {
    const unsigned width = f.kind == lss::Feedback::extended ? 16 : 4;
    const bool other_half = width == 16 && f.toggle != (at.bit == 16);
    if (at.bit < width || at.bit % width != 0 || other_half) continue;
    const Prefix child = at.child(f.value, width);
    if (std::ranges::find(to, child) == to.end()) to.push_back(child);
  }
  std::ranges::sort(to, {}, &Prefix::value);
}

void Walker::Search::open(Prefix at, Open::Why why) {
  if (why == Open::Why::heard) {
    if (std::ranges::find(seen_, at) != seen_.end()) return;
    seen_.push_back(at);
  }
  open_.push_back({at, why});
}

// ---- the serial numbers of one type and revision ----------------------------------------------------------------

rt::Task<void> Walker::Search::serials() {
  open_.clear();
  seen_.clear();
  const bool feedback = !children_.empty();
  const auto children = children_;
  const auto before = report_.found.size();
  co_await by_name();
  co_await registered_by_name();
  const bool named = report_.found.size() > before;
  if (feedback) {
    for (auto it = children.rbegin(); it != children.rend(); ++it) open(*it, Open::Why::heard);
  } else if (!named) {
    open_.push_back({Prefix{}, Open::Why::answered});
  }
  const bool look = !feedback && (entered_answers_ > 1 || hints_fail_);
  failed_ = 0;
  while (!over() && failed_ <= options_.retries) {
    if (open_.empty()) {
      if (!look) co_return;
      const bool left = co_await anybody_left();
      if (!left) co_return;
      seen_.clear();  // a device that is heard again is still there
    }
    const Open next = open_.back();
    open_.pop_back();
    const bool found = co_await place(next);
    if (!found || over()) continue;
    const bool there = co_await again_at_serials();
    if (!there) co_return;
    if (!feedback) co_await around();
  }
}

// Slaves that forget their part are led to it once more. Others were there when this one was: one answers, or forgot.
rt::Task<bool> Walker::Search::again_at_serials() {
  const bool test = !forgets_ && entered_answers_ > 1 && !std::exchange(remembering_tested_, true);
  if (test) {
    const auto left = co_await others_left();
    forgets_ = !left && !broken_;
  }
  if (!forgets_) co_return true;
  const bool led = co_await lead_to_serials();
  co_return led;
}

rt::Task<bool> Walker::Search::lead_to_serials() {
  const auto parts = chain_;
  const Heard anybody = co_await start();
  if (!anybody.yes()) co_return false;
  while (sub_ < 3) {
    const bool entered = co_await enter(parts[sub_]);
    if (!entered) co_return false;
  }
  co_return true;
}

// A device that is expected is asked for by name.
rt::Task<void> Walker::Search::by_name() {
  const auto children = children_;
  unsigned patient = 4;  // so many are worth the longest window
  for (const LssAddress& a : known_.expected) {
    if (a != address(a.serial) || is_found(a) || over()) continue;
    const bool unheard = std::ranges::none_of(children, [&](Prefix p) { return p.contains(a.serial); });
    if (!children.empty() && unheard) continue;
    const Prefix whole{a.serial, 0};
    const Wait wait = patient > 0 ? Wait::bound : Wait::learnt;
    if (patient > 0) --patient;
    const Heard heard = co_await ask(whole, 3, wait);
    if (!heard.yes()) continue;
    const Outcome outcome = co_await settle(a.serial);
    if (outcome != Outcome::found) continue;
    const bool there = co_await again_at_serials();
    if (!there) co_return;
  }
}

// A device that has a node-ID and answers all the same is soonest known by its name, and gone round from then on.
rt::Task<void> Walker::Search::registered_by_name() {
  for (const LssAddress& a : known_.registered) {
    if (a != address(a.serial) || is_found(a) || is_aside(a)) continue;
    if (broken_ || !stayers_.ask() || report_.found.size() >= options_.most_devices) co_return;
    elsewhere();
    const Prefix whole{a.serial, 0};
    const Heard heard = co_await ask(whole, 3, Wait::learnt);
    if (!heard.yes()) {
      stayers_.note(false);
      continue;
    }
    const Outcome outcome = co_await settle(a.serial);
    if (outcome != Outcome::found) continue;
    const bool led = co_await lead_to_serials();
    if (!led) co_return;
  }
}

// The next of a row, the next serial number, then the neighbourhood; each only while it has been worth it.
rt::Task<void> Walker::Search::around() {
  while (!over()) {
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
    const bool done = outcome == Outcome::late || over() || !near_.ask();
    if (done) co_return;
    const Prefix block = Prefix::of(last, neighbourhood);
    elsewhere();
    const Heard heard = co_await ask(block, 3, Wait::learnt);
    near_.note(heard.yes());
    if (heard.yes()) open(block, Open::Why::answered);
    co_return;
  }
}

// The step of the row is the distance to the nearest serial number that is known here.
std::optional<std::uint32_t> Walker::Search::next_of_row(std::uint32_t serial, bool up) const {
  constexpr unsigned longest_row = 126;
  std::uint32_t step = 0;
  const auto look = [&](const LssAddress& a) {
    const std::uint32_t apart = a.serial > serial ? a.serial - serial : serial - a.serial;
    if (a == address(a.serial) && apart != 0 && (step == 0 || apart < step)) step = apart;
  };
  for (const LssAddress& a : known_.registered) look(a);
  for (const Found& f : report_.found) look(f.address);
  if (step == 0) return std::nullopt;
  std::uint32_t at = serial;
  for (unsigned i = 0; i < longest_row; ++i) {
    const bool ends = up ? at > 0xFFFF'FFFF - step : at < step;
    if (ends) return std::nullopt;
    at = up ? at + step : at - step;
    if (!is_found(address(at)) && !is_registered(address(at))) return at;
  }
  return std::nullopt;
}

// `late`: one answered there, and did not say so when it was selected.
rt::Task<Walker::Search::Outcome> Walker::Search::guess(std::uint64_t serial, Worth& worth) {
  const auto value = static_cast<std::uint32_t>(serial);
  if (serial > 0xFFFF'FFFF || !worth.ask()) co_return Outcome::nobody;
  if (is_found(address(value)) || is_registered(address(value))) co_return Outcome::nobody;
  const Prefix whole{value, 0};
  elsewhere();
  const Heard heard = co_await ask(whole, 3, Wait::learnt);
  worth.note(heard.yes());
  if (!heard.yes()) co_return Outcome::nobody;
  const Outcome outcome = co_await settle(value);
  co_return outcome == Outcome::found ? outcome : Outcome::late;
}

rt::Task<bool> Walker::Search::anybody_left() {
  const auto half = co_await others_left();
  if (half) open(*half, Open::Why::answered);
  co_return half.has_value();
}

// The half of the serial numbers that one is in.
rt::Task<std::optional<Prefix>> Walker::Search::others_left() {
  for (const Prefix half : {Prefix{}.zero(), Prefix{}.one()}) {
    elsewhere();
    const Heard heard = co_await ask(half, 3, Wait::learnt);
    if (heard.yes()) co_return half;
  }
  co_return std::nullopt;
}

// Goes down from one place and takes the device that it comes to. One that answers and is not found there may
// answer for ever: after so many such places in a row the round ends, and the search counts it.
rt::Task<bool> Walker::Search::place(Open place) {
  unsigned answers = place.at.bit == 32 ? entered_answers_ : 2;
  careful_ = 0;
  backs_ = 0;
  if (place.at.bit != 32 && place.why != Open::Why::answered) elsewhere();
  if (place.at.bit != 0 && place.why != Open::Why::answered) {
    Heard heard = co_await ask(place.at, sub_, Wait::learnt);
    if (!heard.yes() && place.why == Open::Why::heard) heard = co_await ask(place.at, sub_, Wait::bound);
    if (!heard.yes()) {
      if (place.why == Open::Why::heard) ++failed_;
      co_return false;
    }
    answers = heard.answers;
  }
  ++failed_;
  anchors_.assign(1, place.at);
  Prefix from = place.at;
  while (!over()) {
    const bool came = co_await descend(from, answers);
    if (!came || broken_) co_return false;
    Outcome outcome = co_await settle(leaf_.value);
    if (outcome == Outcome::late) {
      if (!one_only()) open(leaf_, Open::Why::maybe);
      outcome = co_await settle(leaf_.value ^ 1U);
    }
    if (outcome == Outcome::found) {
      failed_ = 0;
      co_return true;
    }
    if (place.at.bit == 0) co_return false;
    const bool again = co_await back();
    if (!again) co_return false;
    from = anchors_.back();
    answers = 2;
  }
  co_return false;
}

// Down to one whole number in `leaf_`. A device is below `at`.
rt::Task<bool> Walker::Search::descend(Prefix at, unsigned answers) {
  unsigned concluded = 0;
  while (at.bit > 0 && !broken_) {
    if (!children_.empty()) {
      const bool there = co_await down_feedback(at);
      if (!there) co_return false;
      concluded = 0;
      continue;
    }
    const Prefix zero = at.zero();
    const Wait wait = careful_ > 0 ? Wait::bound : Wait::quick;
    const Heard heard = co_await ask_once(zero, sub_, wait);
    if (heard.late && concluded > 0) {
      step_aside(at);
      concluded = 0;
      continue;
    }
    if (!heard.sent) continue;
    if (careful_ > 0) --careful_;
    if (heard.yes()) {
      if (answers > 1) open(at.one(), Open::Why::maybe);
      answers = heard.answers;
      at = zero;
      anchors_.push_back(at);
      concluded = 0;
      continue;
    }
    at = at.one();
    ++concluded;
    if (concluded < check_after || at.bit == 0) continue;
    const Heard check = co_await ask_once(at, sub_, Wait::bound);
    concluded = 0;
    if (check.late) {
      step_aside(at);
      continue;
    }
    if (check.yes()) {
      anchors_.push_back(at);
      continue;
    }
    const bool again = co_await back();
    if (!again) co_return false;
    at = anchors_.back();
  }
  leaf_ = at;
  co_return !broken_;
}

// Where we turned to the upper half a device in the lower one had answered, too late for us.
void Walker::Search::step_aside(Prefix& at) {
  if (!one_only()) open(at, Open::Why::maybe);
  at = at.brother();
  anchors_.push_back(at);
  children_.clear();
}

// One step by what feedback told; the lowest first, the others are kept.
rt::Task<bool> Walker::Search::down_feedback(Prefix& at) {
  const auto children = children_;
  for (auto it = children.rbegin(); it != children.rend(); ++it) open(*it, Open::Why::heard);
  children_.clear();
  const auto mine = std::ranges::find(open_, children.front(), &Open::at);
  if (mine == open_.end()) co_return false;  // it was heard and dealt with before
  open_.erase(mine);
  at = children.front();
  if (at.bit == 0) co_return true;
  Heard heard = co_await ask(at, sub_, Wait::learnt);
  if (!heard.yes()) heard = co_await ask(at, sub_, Wait::bound);
  if (heard.yes()) anchors_.push_back(at);
  co_return heard.yes();
}

// No device is on this path any more, or none ever was: up to the deepest place that still answers, and patiently from
// there.
rt::Task<bool> Walker::Search::back() {
  elsewhere();
  if (++backs_ > most_backs) co_return false;
  careful_ = backs_ > 1 ? 32 : check_after + 2;
  const bool anchored = anchors_.size() > 1;
  while (!anchors_.empty() && !broken_) {
    const Prefix at = anchors_.back();
    // Nothing below was ever answered: no device moved on to this part, and a late answer stood for the one that
    // should.
    if (at.bit == 32) co_return anchored;
    const Heard heard = co_await ask(at, sub_, Wait::bound);
    if (heard.yes()) co_return true;
    anchors_.pop_back();
  }
  co_return false;
}

}  // namespace berth::discovery
