#include "berth/live/gate.hpp"

#include <algorithm>
#include <cassert>
#include <limits>

#include "berth/co/cob_id.hpp"
#include "berth/co/nmt.hpp"
#include "berth/live/requests_parts.hpp"

namespace berth::live {

namespace {

constexpr can::IdRange everything{0, std::numeric_limits<std::uint32_t>::max()};

// docs/protocols/cia305.md §Frames: the services without an answer, by command specifier: switch state global, the
// first parts of switch state selective and of identify remote slave, activate bit timing.
bool lss_answers(std::uint8_t specifier) noexcept {
  switch (specifier) {
    case 0x04:
    case 0x15:
    case 0x40:
    case 0x41:
    case 0x42:
    case 0x46:
    case 0x47:
    case 0x48:
    case 0x49:
    case 0x4A: return false;
    default: return true;
  }
}

}  // namespace

const char* name(GateState state) noexcept {
  switch (state) {
    case GateState::down: return "down";
    case GateState::listening: return "listening";
    case GateState::open: return "open";
    case GateState::foreign: return "another master";
    case GateState::observing: return "observing";
  }
  return "";
}

bool expects_answer(const can::Frame& frame) noexcept {
  const auto key = frame.key();
  if (frame.remote) return true;
  if (key >= co::all_sdo_requests.first && key <= co::all_sdo_requests.last) {
    constexpr std::uint8_t abort = 0x80;
    return frame.size == 0 || frame.data[0] != abort;
  }
  if (key == lss_requests) return frame.size == 0 || lss_answers(frame.data[0]);
  constexpr std::uint32_t who_is_master = 0x073;  // CiA 302-2
  if (key == who_is_master) return true;
  return key == rand_requests || key == and_requests;
}

namespace {

// Client command specifiers 2 and 3, CiA 301 §7.2.4.3.
bool uploads(const can::Frame& frame) noexcept {
  const auto key = frame.key();
  const bool request = key >= co::all_sdo_requests.first && key <= co::all_sdo_requests.last && !frame.remote;
  const auto specifier = static_cast<unsigned>(frame.data[0]) >> 5U;
  return request && frame.size == 8 && (specifier == 2 || specifier == 3);
}

}  // namespace

bool allowed(Role role, const can::Frame& frame) noexcept {
  if (role == Role::master) return true;
  if (role == Role::observer) return false;
  if (role == Role::reader) return uploads(frame);
  if (frame.key() == co::sync_id) return false;
  if (frame.key() != co::nmt_command_id) return true;
  const auto request = co::parse_nmt(frame);
  if (!request) return false;
  return request->command == co::NmtCommand::stop || request->command == co::NmtCommand::enter_pre_operational;
}

Gate::Gate(rt::Executor& executor, can::Port& inner, GateOptions options)
    : executor_(&executor), inner_(&inner), options_(std::move(options)), watch_(options_.watch) {
  pending_.reserve(most_pending);
  held_.reserve(most_pending);
  inner_->listen(this, std::span(&everything, 1));
  if (options_.role == Role::observer) {
    state_ = GateState::observing;
  } else if (inner_->status().up) {
    begin_listening();
  }
}

Gate::~Gate() { inner_->listen(nullptr, {}); }

std::vector<std::string> Gate::report() const {
  if (!watch_.foreign()) return {};
  std::vector<std::string> all{verdict(watch_, options_.slots)};
  const auto evidence = watch_.evidence();
  std::ranges::move(lines(evidence, rt::Time{}), std::back_inserter(all));
  return all;
}

// ---- states ----

void Gate::begin_listening() noexcept {
  watch_.reset();
  if (options_.listen.count() <= 0) return become(GateState::open);
  executor_->after(options_.listen, listening_);
  become(GateState::listening);
}

void Gate::heard_enough() noexcept {
  const bool another = watch_.foreign() && options_.role == Role::master;
  become(another ? GateState::foreign : GateState::open);
}

void Gate::listen_again() noexcept {
  if (state_ == GateState::foreign) begin_listening();
}

void Gate::become(GateState state) noexcept {
  if (state_ == state) return;
  state_ = state;
  if (state == GateState::open) watch_.running();
  if (on_change_) on_change_();
  if (listener_ != nullptr) listener_->changed(status(), executor_->now());
}

void Gate::shut() noexcept {
  for (const auto& pending : pending_) inner_->withdraw(pending.inner);
  pending_.clear();
  become(GateState::foreign);
}

// ---- can::Port ----

can::Queued Gate::send(const can::Frame& frame, std::uint32_t tag) noexcept {
  if (state_ == GateState::down) return can::Queued::closed;
  if (state_ != GateState::open) return can::Queued::listen_only;
  if (!allowed(options_.role, frame)) {
    ++refused_;
    return can::Queued::listen_only;
  }
  if (options_.dry_run) return hold(frame, tag);
  if (options_.role == Role::master && clients_.owns_channel_of(frame, executor_->now())) return can::Queued::full;
  if (pending_.size() == most_pending) return can::Queued::full;
  if (++next_tag_ == 0) next_tag_ = 1;
  const auto queued = inner_->send(frame, next_tag_);
  if (queued == can::Queued::yes) pending_.push_back({next_tag_, tag, frame});
  return queued;
}

can::Queued Gate::hold(const can::Frame& frame, std::uint32_t tag) noexcept {
  if (held_.size() == most_pending) return can::Queued::full;
  if (on_held_) on_held_(frame, executor_->now());
  if (tag == 0 || expects_answer(frame)) return can::Queued::yes;
  held_.push_back(tag);
  executor_->post(confirming_);
  return can::Queued::yes;
}

void Gate::confirm_held() noexcept {
  if (held_.empty()) return;
  const auto tag = held_.front();
  held_.erase(held_.begin());
  if (!held_.empty()) executor_->post(confirming_);
  if (listener_ != nullptr) listener_->sent(tag, executor_->now());
}

void Gate::withdraw(std::uint32_t tag) noexcept {
  std::erase(held_, tag);
  const auto it = std::ranges::find(pending_, tag, &Pending::outer);
  if (tag == 0 || it == pending_.end()) return;
  const auto inner = it->inner;
  pending_.erase(it);
  inner_->withdraw(inner);
}

void Gate::listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
  // A second dispatcher on this port would leave the first one deaf.
  assert(listener == nullptr || listener_ == nullptr || listener == listener_);
  listener_ = listener;
  accept_.assign(accept.begin(), accept.end());
}

can::Status Gate::status() const noexcept {
  auto status = inner_->status();
  status.listen_only = status.listen_only || state_ != GateState::open;
  status.up = status.up || rechecking_.timed();
  return status;
}

bool Gate::restart(std::uint32_t bit_rate) noexcept {
  if (options_.dry_run) return true;
  pending_.clear();
  executor_->after(restart_time, rechecking_);
  return inner_->restart(bit_rate);
}

// ---- can::Listener ----

void Gate::received(const can::Frame& frame, rt::Time at) noexcept {
  if (on_frame_) on_frame_(frame, at, false);
  const auto sign = watch_.heard(frame, at);
  if (sign && state_ == GateState::open && options_.role == Role::master)
    *sign == Sign::sdo ? clients_.asks(frame, at) : shut();
  const auto holds = [key = frame.key()](const can::IdRange& r) { return key >= r.first && key <= r.last; };
  if (listener_ != nullptr && std::ranges::any_of(accept_, holds)) listener_->received(frame, at);
}

void Gate::sent(std::uint32_t tag, rt::Time at) noexcept {
  const auto it = std::ranges::find(pending_, tag, &Pending::inner);
  if (it == pending_.end()) return;
  const Pending done = *it;
  pending_.erase(it);
  if (on_frame_) on_frame_(done.frame, at, true);
  if (done.outer != 0 && listener_ != nullptr) listener_->sent(done.outer, at);
}

void Gate::changed(const can::Status& status, rt::Time at) noexcept {
  if (state_ == GateState::observing || state_ == GateState::foreign) {
    if (listener_ != nullptr) listener_->changed(this->status(), at);
    return;
  }
  if (rechecking_.timed()) return;
  if (!status.up && state_ != GateState::down) {
    listening_.cancel();
    pending_.clear();
    return become(GateState::down);
  }
  if (status.up && state_ == GateState::down) return begin_listening();
  if (listener_ != nullptr) listener_->changed(this->status(), at);
}

}  // namespace berth::live
