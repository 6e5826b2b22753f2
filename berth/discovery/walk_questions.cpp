#include "berth/discovery/walk_questions.hpp"

#include <algorithm>

namespace berth::discovery::walk {

namespace {
constexpr lss::FastscanRequest start_scan{};
}  // namespace

void Questions::broken(Error error) noexcept {
  if (!broken_) error_ = error;
  broken_ = true;
}

// The observer may end the walk here. No device is selected yet: the way down to one begins again in the next search.
bool Questions::stops() noexcept {
  const bool now = !broken_ && observer_ != nullptr && !observer_->goes_on();
  if (now) broken_ = stopped_ = true;
  return now;
}

void Questions::end_slice() noexcept {
  const bool now = !broken_ && slice_ > 0 && asker_.requests() >= slice_;
  if (now) broken_ = stopped_ = true;
}

rt::Task<Heard> Questions::start() {
  way_.sub = 0;
  children_.clear();
  elsewhere();
  Heard result{};
  do {
    auto question = asker_.ask(start_scan, Wait::closing);
    const auto heard = co_await question;
    if (!heard) {
      broken(heard.error());
      co_return Heard{};
    }
    result = *heard;
    count(result);
  } while (!result.sent);
  asked_ = {};
  asked_sub_ = 0;
  entered_answers_ = result.answers;
  if (result.feedback) heard_feedback_ = true;
  take_feedback(asker_.feedback(), 0, asked_, children_);
  co_return result;
}

rt::Task<Heard> Questions::ask_once(Prefix at, unsigned next, Wait wait) {
  const bool ends = broken_ || stops();
  if (ends) co_return Heard{};
  const lss::FastscanRequest request{.id = at.value,
                                     .bit_checked = at.bit,
                                     .sub = static_cast<std::uint8_t>(way_.sub),
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
  if (asked_sub_ == way_.sub) {
    for (const Prefix p : late) frontier_.open(p, Open::Why::heard);
  }
  const bool whole = at.bit == 0;
  asked_ = whole ? Prefix{} : at;
  asked_sub_ = whole ? next : way_.sub;
  children_.clear();
  take_feedback(asker_.feedback(), asked_sub_, asked_, children_);
  co_return *heard;
}

rt::Task<Heard> Questions::ask(Prefix at, unsigned next, Wait wait) {
  Heard heard = co_await ask_once(at, next, wait);
  while (!heard.sent && !broken_) heard = co_await ask_once(at, next, wait);
  co_return heard;
}

rt::Task<bool> Questions::enter(std::uint32_t value) {
  way_.note_asked(value);
  const Prefix whole{value, 0};
  const Heard heard = co_await ask_once(whole, way_.sub + 1, Wait::bound);
  overtaken_ = heard.late && !heard.yes();
  if (!heard.yes()) co_return false;
  way_.part[way_.sub++] = value;
  entered_answers_ = heard.answers;
  co_return true;
}

// One answer to each of several nested questions means one device. `before` is set when everything for the question
// before has been heard.
void Questions::count(const Heard& heard) noexcept {
  if (below_ && heard.before > 0) alone_ = heard.before == 1 ? alone_ + 1 : 0;
  below_ = true;
}

void Questions::elsewhere() noexcept {
  below_ = false;
  alone_ = 0;
}

void Questions::take_feedback(const std::vector<lss::FeedbackValue>& heard, unsigned sub, Prefix at,
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

void Questions::be_patient(bool patient, bool wholly) noexcept {
  patient_ = patient;
  wholly_ = wholly;
  asker_.be_patient(patient, wholly);
}

}  // namespace berth::discovery::walk
