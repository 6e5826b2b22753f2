#include "berth/discovery/asker.hpp"

#include <algorithm>

#include "berth/can/empty_bus.hpp"
#include "berth/can/full_queue.hpp"

namespace berth::discovery {
namespace {
constexpr rt::Duration default_window = std::chrono::milliseconds(10);  // as in paper 4
constexpr rt::Duration send_timeout = std::chrono::seconds(1);
constexpr std::int64_t answer_bits = 126;  // 4Fh and seven zeros, with intermission
constexpr std::size_t most_feedback = 256;
}  // namespace

// ---- one question -----------------------------------------------------------------------------------------------

Question::~Question() { end(); }

bool Question::start() noexcept {
  asker_->current_ = this;
  const rt::Time earliest = asker_->last_sent_ + asker_->options_->inhibit;
  if (asker_->options_->inhibit.count() > 0 && earliest > executor().now()) {
    step_ = Step::inhibited;
    executor().at(earliest, *this);
  } else {
    send();
  }
  return true;
}

void Question::send() noexcept {
  step_ = Step::sending;
  give_up_ = executor().now() + send_timeout;
  try_to_send();
}

void Question::try_to_send() noexcept {
  executor().at(give_up_, *this);
  switch (asker_->dispatcher_->send(lss::request_fastscan(request_), *this)) {
    case can::Queued::yes: break;
    case can::Queued::full: executor().at(can::again_at(executor().now(), give_up_), *this); break;
    default: fail_with("the port does not take a Fastscan request");
  }
}

void Question::sent(rt::Time at) noexcept {
  Asker& a = *asker_;
  a.learn();
  ++a.requests_;
  a.asked_ = at;
  a.last_sent_ = at;
  heard_.before = a.answers_;
  a.answers_ = 0;
  a.signs_ = 0;
  a.before_.swap(a.feedback_);
  a.feedback_.clear();
  heard_.at = at;
  step_ = Step::listening;
  const Options& o = *a.options_;
  const rt::Duration longest = a.longest() - a.frame_ - o.blocking;
  const rt::Duration bound = a.patient_ ? a.patience_.response(o.shortest, longest) : longest;
  // With a single device, a late answer is noticed within a few questions. With several devices, late answers come at
  // every other question.
  const bool patient = a.patient_ && !(alone_ && wait_ == Wait::quick);
  const rt::Duration learnt = patient ? bound : a.latency_.response(o.shortest, bound);
  a.asked_patiently_ = patient;
  ready_by_ = at + learnt;
  const bool quick = wait_ == Wait::quick && a.takes_back_;
  const rt::Duration believed = wait_ == Wait::closing ? longest : wait_ == Wait::bound ? bound : learnt;
  const rt::Duration silence = quick ? learnt : believed + a.frame_ + o.blocking;
  executor().at(at + silence, *this);
}

void Question::answered(rt::Time at, bool whole) noexcept {
  if (step_ == Step::listening) {
    // Other answers may wait behind the first one. They are sent during this wait, or before the next request.
    executor().at(alone_ && whole ? at : std::max(at, ready_by_), *this);
  } else if (step_ == Step::sending || step_ == Step::inhibited) {
    late(at);
  }
}

void Question::late(rt::Time at) noexcept {
  if (asker_->signs_ != 1) return;  // the question was answered in time
  heard_.late = true;
  // A frame that was heard at this instant occupied the bus until now, so this request was not sent. A port that
  // reports frames later than it hears them cannot show this: with it, no request is taken back.
  const bool surely_queued = step_ == Step::inhibited || at == executor().now();
  if (!surely_queued) {
    asker_->takes_back_ = false;
    return;
  }
  heard_.sent = false;
  over();
}

void Question::run() noexcept {
  switch (step_) {
    case Step::inhibited: send(); break;
    case Step::sending:
      if (executor().now() < give_up_) return try_to_send();
      fail_with(can::no_acknowledge);
      break;
    case Step::listening: over(); break;
    case Step::idle:
    case Step::done: break;
  }
}

void Question::fail_with(const char* text) noexcept {
  outcome_ = fail(Errc::bus, text);
  end();
  finish();
}

void Question::over() noexcept {
  if (heard_.sent) {
    heard_.answers = asker_->answers_;
    heard_.feedback = !asker_->feedback_.empty();
  }
  outcome_ = heard_;
  end();
  finish();
}

void Question::end() noexcept {
  step_ = Step::done;
  cancel();
  if (asker_->current_ != this) return;
  asker_->current_ = nullptr;
  asker_->dispatcher_->withdraw(*this);
}

// ---- the asker --------------------------------------------------------------------------------------------------

Asker::Asker(can::Dispatcher& dispatcher) : dispatcher_(&dispatcher) {
  feedback_.reserve(most_feedback);
  before_.reserve(most_feedback);
  dispatcher.add(can::only(lss::slave_cob_id), *this);
}

void Asker::begin(const Options& options, std::uint16_t feedback_base) noexcept {
  options_ = &options;
  if (feedback_base != feedback_base_) {
    dispatcher_->remove(*this);
    dispatcher_->add(can::only(lss::slave_cob_id), *this);
    if (feedback_base != 0) {
      dispatcher_->add(lss::extended_feedback, *this);
      dispatcher_->add(lss::base_feedback(feedback_base), *this);
    }
    feedback_base_ = feedback_base;
  }
  patient_ = wholly_ = false;
  requests_ = 0;
  answers_ = 0;
  signs_ = 0;
  feedback_.clear();
  before_.clear();
  takes_back_ = dispatcher_->port().status().knows_sent;
  const auto rate = dispatcher_->port().status().bit_rate;
  frame_ = rate == 0 ? rt::Duration{0} : rt::Duration(answer_bits * 1'000'000'000 / rate);
}

void Asker::forget() noexcept {
  latency_.forget();
  patience_ = {};
}

rt::Duration Asker::longest() const noexcept {
  return (options_->window.count() > 0 ? options_->window : default_window) + frame_ + options_->blocking;
}

rt::Duration Asker::usual() const noexcept {
  const rt::Duration bound = longest() - frame_ - options_->blocking;
  const rt::Duration shortest = options_->shortest;
  const auto response = patient_ ? patience_.response(shortest, bound) : latency_.response(shortest, bound);
  return response + frame_ + options_->blocking;
}

void Asker::received(const can::Frame& frame, rt::Time at) noexcept {
  if (options_ == nullptr) return;
  if (const auto value = lss::decode_feedback(frame, feedback_base_)) {
    const auto place = std::ranges::lower_bound(feedback_, *value);
    const bool known = place != feedback_.end() && *place == *value;
    if (!known && feedback_.size() < most_feedback) feedback_.insert(place, *value);
    sign(frame_ * (value->kind == lss::Feedback::extended ? 70 : 50) / answer_bits, at, false);
    return;
  }
  if (!lss::is_answer(frame) || lss::command(frame) != lss::Command::identified) return;
  ++answers_;
  last_ = at;
  const int left_out = 8 - frame.size;  // nine bits each, stuff bits included
  sign(frame_ * (answer_bits - 9 * left_out) / answer_bits, at, true);
}

void Asker::sign(rt::Duration own, rt::Time at, bool whole) noexcept {
  if (signs_++ == 0) first_ = at - asked_ - own;
  if (current_ != nullptr) current_->answered(at, whole);
}

// The first answer may come from the fastest of many devices. The last answer waited for at most one frame after it was
// ready.
void Asker::learn() noexcept {
  if (signs_ == 0) return;
  rt::Duration sample = first_;
  if (signs_ == answers_ && answers_ > 1) sample = std::max(sample, last_ - asked_ - 2 * frame_);
  latency_.note(sample);
  if (asked_patiently_) patience_.note(sample);
}

}  // namespace berth::discovery
