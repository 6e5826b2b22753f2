#include "berth/research/negotiation_cycle.hpp"

#include <utility>

#include "berth/research/negotiation_frames.hpp"
#include "berth/research/negotiation_parts.hpp"

namespace berth::research {
namespace {

constexpr unsigned patience = 3;  // in frame times: how long a frame may wait to be acknowledged, up to twice as long

}  // namespace

void NegotiationCycle::stop() noexcept {
  step_.cancel();
  state_ = Negotiating::off;
  candidate_ = NodeId();
  rival_ = false;
}

void NegotiationCycle::suspend(rt::Duration time) noexcept {
  sender_.drop();
  enter(Negotiating::suspended, time);
}

void NegotiationCycle::listen() noexcept {
  window_ends_ = sender_.in(options_->quiet);
  enter(Negotiating::listening, options_->quiet + sender_.random(options_->jitter));
}

// --- Frames ----------------------------------------------------------------------------------------------------------

void NegotiationCycle::heard_request() noexcept {
  switch (state_) {
    case Negotiating::asking:
    case Negotiating::listening:
    case Negotiating::waiting:
    case Negotiating::exhausted:
      sender_.drop();
      choice_.begin();
      leads_ = false;
      return join();
    case Negotiating::asked:  // all devices that asked begin at the last request: so they are in phase
      leads_ = false;
      window_ends_ = sender_.in(options_->answers);
      return restart(options_->answers + behind());
    default: return;
  }
}

void NegotiationCycle::heard_used(NodeId id) noexcept {
  const bool mine = state_ == Negotiating::announcing && id == choice_.choose(sender_.now());
  choice_.heard(id);
  switch (state_) {
    case Negotiating::listening:
    case Negotiating::asked:
      if (!options_->literal) {
        const auto end = sender_.in(options_->straggler);
        if (end > window_ends_) restart(options_->straggler);
      }
      return;
    case Negotiating::announcing:
      if (mine) rival_ = true;  // another device has also won this cycle, and takes the same node-ID
      if (sender_.queued() && mine) {
        sender_.drop();
        announce();
      }
      return;
    default: return;
  }
}

void NegotiationCycle::heard_identity(unsigned byte, std::uint8_t value) noexcept {
  const auto own = identity_byte(options_->address, byte);
  switch (state_) {
    case Negotiating::asked:
    case Negotiating::competing:
    case Negotiating::announcing:
      if (value < own) return lose_cycle();
      if (value != own || options_->literal) return;
      if (state_ == Negotiating::asked && byte == 0 && choice_.choose(sender_.now()).configured()) {
        state_ = Negotiating::competing;
        byte_ = 0;
      }
      if (state_ == Negotiating::competing && byte == byte_) {
        sender_.drop();
        leads_ = false;
        byte_done();
      }
      return;
    case Negotiating::asking: sender_.drop(); [[fallthrough]];
    case Negotiating::listening:
    case Negotiating::waiting: return wait();
    default: return;
  }
}

void NegotiationCycle::sent() noexcept {
  leads_ = true;
  switch (state_) {
    case Negotiating::asking: return join();
    case Negotiating::competing: return byte_done();
    case Negotiating::announcing:
      step_.cancel();
      state_ = Negotiating::off;
      return owner_->id_won(std::exchange(candidate_, NodeId()));
    default: return;  // the last frame of a device that lost its node-ID
  }
}

// --- The negotiation -------------------------------------------------------------------------------------------------

void NegotiationCycle::step() noexcept {
  switch (state_) {
    case Negotiating::suspended: return listen();
    case Negotiating::listening:
    case Negotiating::waiting:
    case Negotiating::exhausted: return ask();
    case Negotiating::asked:
      byte_ = 0;
      if (!choice_.choose(sender_.now()).configured()) return announce();
      state_ = Negotiating::competing;
      return send_byte();
    case Negotiating::asking:
    case Negotiating::competing:
    case Negotiating::announcing:
      // Still not sent: the bus is busy, or all others send the same at the same moment so that none acknowledges, or
      // the controller was restarted and lost it.
      if (sender_.queued()) {
        sender_.drop();
        return restart(rt::Duration(sender_.dice().between(0, 2 * patience * sender_.frame_time().count())));
      }
      if (state_ == Negotiating::asking) return ask();
      return state_ == Negotiating::competing ? send_byte() : announce();
    default: return;
  }
}

void NegotiationCycle::ask() noexcept {
  state_ = Negotiating::asking;
  choice_.begin();
  offer(request_used());
}

// A cycle begins, by this device's request or another's.
void NegotiationCycle::join() noexcept {
  ++cycles_;
  candidate_ = NodeId();
  window_ends_ = sender_.in(options_->answers);
  enter(Negotiating::asked, options_->answers + behind());
}

void NegotiationCycle::send_byte() noexcept { offer(identity(options_->address, byte_)); }

void NegotiationCycle::offer(const can::Frame& frame) noexcept {
  if (!sender_.put(frame)) return restart(requeue_pause);
  const auto least = patience * sender_.frame_time();
  restart(least + rt::Duration(sender_.dice().between(0, least.count())));
}

// The byte was sent, by this device or by another with an equal one.
void NegotiationCycle::byte_done() noexcept {
  if (++byte_ < identity_bytes) return restart(sender_.pace() + behind());
  enter(Negotiating::announcing, options_->pause + sender_.random(options_->jitter));
}

void NegotiationCycle::announce() noexcept {
  candidate_ = choice_.choose(sender_.now());
  if (!candidate_.configured()) {
    enter(Negotiating::exhausted, options_->retry + sender_.random(options_->retry));
    return owner_->none_free();
  }
  offer(used(candidate_));
}

void NegotiationCycle::lose_cycle() noexcept {
  sender_.drop();
  wait();
}

void NegotiationCycle::wait() noexcept {
  enter(Negotiating::waiting, options_->quiet + options_->after_pause + sender_.random(options_->jitter));
}

void NegotiationCycle::enter(Negotiating state, rt::Duration own) noexcept {
  state_ = state;
  restart(own);
}

void NegotiationCycle::restart(rt::Duration own) noexcept { sender_.after(own, step_); }

// Later than the leading device, so that its byte is heard first and counts for all devices with the same byte.
rt::Duration NegotiationCycle::behind() const noexcept {
  return options_->literal || leads_ ? rt::Duration::zero() : 2 * sender_.frame_time();
}

}  // namespace berth::research
