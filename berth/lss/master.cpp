#include "berth/lss/master.hpp"

#include <algorithm>
#include <utility>

#include "berth/can/empty_bus.hpp"
#include "berth/can/full_queue.hpp"

namespace berth::lss {

// ---- one service -----------------------------------------------------------------------------------------------

Exchange::Exchange(Master& master, const ServiceOptions& options, const Plan& plan) noexcept
    : master_(&master), options_(options), plan_(plan) {}

Exchange::~Exchange() { end(); }

void Exchange::refuse(Error error) noexcept {
  failed_ = true;
  error_ = error;
}

bool Exchange::start() noexcept {
  if (step_ != Step::idle) return false;
  if (!plan_.valid) {
    step_ = Step::done;
    refuse({.code = Errc::invalid, .text = "an argument of an LSS service is out of range"});
    return false;
  }
  step_ = Step::queued;
  master_->enter(*this);
  return true;
}

// Begins an attempt when the inhibit time is over.
void Exchange::take_turn() noexcept {
  ++reply_.attempts;
  next_frame_ = 0;
  if (master_->earliest_ > executor().now()) {
    step_ = Step::inhibited;
    executor().at(master_->earliest_, *this);
  } else {
    send_next();
  }
}

void Exchange::send_next() noexcept {
  step_ = Step::sending;
  give_up_ = executor().now() + master_->options_.send_timeout;
  send();
}

void Exchange::send() noexcept {
  executor().at(give_up_, *this);
  switch (master_->dispatcher_->send(plan_.frames[next_frame_], *this)) {
    case can::Queued::yes: break;
    case can::Queued::full: executor().at(can::again_at(executor().now(), give_up_), *this); break;
    default: done({.code = Errc::bus, .text = "the port does not take an LSS request"});
  }
}

void Exchange::sent(rt::Time at) noexcept {
  reply_.sent = at;
  ++next_frame_;
  master_->earliest_ = at + master_->options_.inhibit;
  if (next_frame_ < plan_.count) {
    step_ = Step::inhibited;
    if (master_->options_.inhibit.count() > 0) {
      executor().at(master_->earliest_, *this);
    } else {
      send_next();
    }
  } else if (plan_.answer == Answer::none) {
    done();
  } else {
    step_ = Step::listening;
    master_->feedback_.clear();
    executor().at(at + options_.timeout, *this);
  }
}

void Exchange::heard(const can::Frame& frame, rt::Time at) noexcept {
  const bool asked_for = step_ == Step::listening && command(frame) == plan_.expected;
  if (!asked_for) {
    ++(step_ == Step::listening ? reply_.others : reply_.stale);
    master_->times_.calm_since = at;
    return;
  }
  if (reply_.answers < reply_.heard.size()) {
    reply_.heard[reply_.answers] = frame;
    reply_.heard_at[reply_.answers] = at;
  }
  if (reply_.answers > 0 && !(frame == reply_.heard[0])) reply_.differ = true;
  ++reply_.answers;
  reply_.last_at = at;
  if (plan_.expected != Command::store) master_->times_.learn(at - reply_.sent);
  if (options_.full_window) return;
  const rt::Time until = reply_.sent + std::min(options_.listen, options_.timeout);
  if (until <= executor().now()) return window_over();
  if (reply_.answers == 1) executor().at(until, *this);
}

// The job's timer serves the pause before a frame, the wait for its confirmation, and the window.
void Exchange::run() noexcept {
  switch (step_) {
    case Step::queued: take_turn(); break;
    case Step::inhibited: send_next(); break;
    case Step::sending:
      if (executor().now() < give_up_) return send();
      done({.code = Errc::bus, .text = can::no_acknowledge});
      break;
    case Step::listening: window_over(); break;
    case Step::idle:
    case Step::done: break;
  }
}

void Exchange::window_over() noexcept {
  if (plan_.feedback) reply_.feedback = master_->feedback_.heard();
  if (reply_.answers == 0) {
    if (reply_.attempts <= options_.retries) {
      take_turn();
    } else if (plan_.answer == Answer::must) {
      master_->times_.calm_since = executor().now();
      done({.code = Errc::timeout, .text = "no LSS answer"});
    } else {
      done();
    }
    return;
  }
  if (plan_.checks_code && reply_.byte() != error::ok) {
    const auto& d = reply_.heard[0].data;
    const auto detail = d[1] | static_cast<std::uint32_t>(d[2]) << 8;
    done({.code = Errc::aborted, .detail = detail, .text = "the LSS slave refused"});
  } else {
    done();
  }
}

void Exchange::done(Error error) noexcept {
  refuse(error);
  done();
}

void Exchange::done() noexcept {
  end();
  finish();
}

void Exchange::end() noexcept {
  const auto was = std::exchange(step_, Step::done);
  if (was == Step::idle || was == Step::done) return;
  cancel();
  master_->dispatcher_->withdraw(*this);
  std::exchange(master_, nullptr)->leave(*this);
}

Result<Reply> Exchange::await_resume() noexcept {
  if (failed_) return fail(error_);
  return reply_;
}

Exchange Exchange::anybody_configuring(Master& master, const ServiceOptions& options) noexcept {
  constexpr std::uint8_t no_node_id = 0x80;
  const can::Frame frame = request(Command::configure_node_id, no_node_id);
  return {master, options, Plan::make(Answer::may, Command::configure_node_id, frame)};
}

// ---- the master ------------------------------------------------------------------------------------------------

Master::Master(can::Dispatcher& dispatcher, const MasterOptions& options)
    : dispatcher_(&dispatcher), options_(options) {
  times_.calm_since = now();
  listen();
}

void Master::lost_one() noexcept {
  times_.strangers = times_.lost = true;
  times_.calm_since = now();
}

void Master::listen() {
  dispatcher_->add(can::only(slave_cob_id), *this);
  dispatcher_->add(extended_feedback, *this);
  if (options_.feedback_base != 0) dispatcher_->add(base_feedback(options_.feedback_base), *this);
}

void Master::set_options(const MasterOptions& options) {
  const bool moves = options.feedback_base != options_.feedback_base;
  options_ = options;
  if (!moves) return;
  dispatcher_->remove(*this);
  listen();
}

Master::~Master() {
  while (first_ != nullptr) first_->done({.code = Errc::cancelled, .text = "the LSS master is gone"});
}

void Master::received(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.key() != slave_cob_id) {
    const bool listens = first_ != nullptr && first_->step_ == Exchange::Step::listening && first_->plan_.feedback;
    const auto feedback = listens ? decode_feedback(frame, options_.feedback_base) : std::nullopt;
    if (feedback) feedback_.add(*feedback, at);
    return;
  }
  if (!is_answer(frame)) return;
  if (first_ != nullptr) {
    const can::Frame whole = whole_answer(frame);
    first_->heard(whole, at);
  } else {
    ++times_.unexpected;
    times_.calm_since = at;
  }
}

void FeedbackWindow::add(const FeedbackValue& feedback, rt::Time at) noexcept {
  const auto place = std::ranges::lower_bound(heard_, feedback, {}, &HeardFeedback::feedback);
  if (place != heard_.end() && place->feedback == feedback) {
    if (place->times < 0xFFFF) ++place->times;
    return;
  }
  const auto index = place - heard_.begin();
  if (heard_.size() == most) {
    if (place == heard_.end()) return;
    heard_.pop_back();
  }
  heard_.insert(heard_.begin() + index, HeardFeedback{.feedback = feedback, .times = 1, .first = at});
}

void AnswerTimes::learn(rt::Duration answer_time) noexcept {
  constexpr int fades = 64;
  slowest = std::max(answer_time, slowest - slowest / fades);
  ++heard;
}

void Master::enter(Exchange& exchange) noexcept {
  Exchange** last = &first_;
  while (*last != nullptr) last = &(*last)->next_;
  *last = &exchange;
  if (first_ == &exchange) exchange.take_turn();
}

void Master::leave(Exchange& exchange) noexcept {
  const bool was_first = first_ == &exchange;
  for (Exchange** at = &first_; *at != nullptr; at = &(*at)->next_) {
    if (*at != &exchange) continue;
    *at = exchange.next_;
    break;
  }
  exchange.next_ = nullptr;
  // Posted, so that the next service never starts inside the call that ended this one.
  if (was_first && first_ != nullptr) dispatcher_->executor().post(*first_);
}

Exchange::Plan Exchange::Plan::make(Answer answer, Command expected, const can::Frame& frame) noexcept {
  Exchange::Plan plan{.answer = answer, .expected = expected};
  plan.frames[0] = frame;
  return plan;
}

Exchange Master::switch_global(State state) noexcept {
  const auto frame = request(Command::switch_global, static_cast<std::uint8_t>(state));
  return {*this, options_.service, Exchange::Plan::make(Exchange::Answer::none, Command::switch_global, frame)};
}

Exchange Master::switch_selective(const LssAddress& address, ServiceChoice options) noexcept {
  auto p = Exchange::Plan::make(Exchange::Answer::must, Command::selected, request_select(address, 0));
  p.count = 4;
  for (unsigned i = 1; i < p.count; ++i) p.frames[i] = request_select(address, i);
  return {*this, options.value_or(options_.service), p};
}

Exchange Master::configure_node_id(NodeId id, ServiceChoice options) noexcept {
  auto p = Exchange::Plan::make(Exchange::Answer::must, Command::configure_node_id,
                                request(Command::configure_node_id, id.value()));
  p.checks_code = true;
  p.valid = NodeId::make(id.value()).has_value();
  return {*this, options.value_or(options_.service), p};
}

Exchange Master::configure_bit_timing(BitRateIndex index, ServiceChoice options) noexcept {
  const auto frame = request(Command::configure_bit_timing, 0, static_cast<std::uint8_t>(index));
  auto p = Exchange::Plan::make(Exchange::Answer::must, Command::configure_bit_timing, frame);
  p.checks_code = true;
  p.valid = bit_rate(index).has_value();
  return {*this, options.value_or(options_.service), p};
}

Exchange Master::activate_bit_timing(std::uint16_t delay_ms) noexcept {
  return {*this, options_.service,
          Exchange::Plan::make(Exchange::Answer::none, Command::activate_bit_timing, request_activate(delay_ms))};
}

Exchange Master::store(ServiceChoice options) noexcept {
  auto p = Exchange::Plan::make(Exchange::Answer::must, Command::store, request(Command::store));
  p.checks_code = true;
  return {*this, options.value_or(options_.store), p};
}

Exchange Master::inquire(unsigned part, ServiceChoice options) noexcept {
  const auto command = static_cast<Command>(static_cast<unsigned>(Command::inquire_vendor) + (part & 3U));
  auto p = Exchange::Plan::make(Exchange::Answer::must, command, request(command));
  p.valid = part < 4;
  return {*this, options.value_or(options_.service), p};
}

Exchange Master::inquire_node_id(ServiceChoice options) noexcept {
  return {*this, options.value_or(options_.service),
          Exchange::Plan::make(Exchange::Answer::must, Command::inquire_node_id, request(Command::inquire_node_id))};
}

Exchange Master::identify_remote(const IdentifyRanges& ranges, ServiceChoice options) noexcept {
  auto p = Exchange::Plan::make(Exchange::Answer::may, Command::identified, request_identify(ranges, 0));
  p.count = 6;
  for (unsigned i = 1; i < p.count; ++i) p.frames[i] = request_identify(ranges, i);
  return {*this, options.value_or(options_.identify), p};
}

Exchange Master::identify_non_configured(ServiceChoice options) noexcept {
  return {
      *this, options.value_or(options_.identify),
      Exchange::Plan::make(Exchange::Answer::may, Command::non_configured, request(Command::identify_non_configured))};
}

Exchange Master::fastscan(const FastscanRequest& request, ServiceChoice options) noexcept {
  auto p = Exchange::Plan::make(Exchange::Answer::may, Command::identified, request_fastscan(request));
  p.valid = decode_fastscan(p.frames[0]).has_value();
  p.feedback = true;
  return {*this, options.value_or(options_.fastscan), p};
}

rt::Task<Result<LssAddress>> inquire_address(Master& master) {
  std::array<std::uint32_t, 4> parts{};
  for (unsigned i = 0; i < 4; ++i) {
    auto reply = co_await master.inquire(i);
    if (!reply) co_return fail(reply.error());
    if (reply->differ) co_return fail(Errc::duplicate, "two LSS slaves answer one inquiry");
    parts[i] = reply->value();
  }
  co_return LssAddress{parts[0], parts[1], parts[2], parts[3]};
}

}  // namespace berth::lss
