#include "berth/research/negotiator.hpp"

#include "berth/research/negotiation_frames.hpp"

namespace berth::research {

Negotiator::Negotiator(rt::Executor& executor, NegotiatorOwner& owner, const NegotiatorOptions& options) noexcept
    : owner_(&owner),
      options_(options),
      sender_(executor, owner, options_),
      cycle_(executor, sender_, choice_, options_, *this),
      defence_(executor, sender_, options_, *this) {}

void Negotiator::start(NodeId last) noexcept {
  stop();
  choice_.prefer(last);
  cycle_.listen();
}

void Negotiator::begin_anew() noexcept {
  if (cycle_.state() != Negotiating::off) cycle_.listen();
}

void Negotiator::settle(NodeId id, bool firm) noexcept {
  stop();
  defence_.hold(id, firm, sender_.now() - sender_.in_world(options_.probation));  // past its probation
}

void Negotiator::stop() noexcept {
  sender_.drop();
  cycle_.stop();
  defence_.stop();
  choice_.avoid({});
  choice_.begin();
}

void Negotiator::suspend(rt::Duration time) noexcept {
  if (cycle_.state() != Negotiating::off) cycle_.suspend(time);
}

void Negotiator::received(const can::Frame& frame) noexcept {
  sender_.heard(frame);
  const auto message = decode_negotiation(frame);
  if (!message) return;
  const bool settled = node_id().configured();
  using Kind = NegotiationMessage::Kind;
  switch (message->kind) {
    case Kind::request_used: return settled ? defence_.heard_request() : cycle_.heard_request();
    case Kind::used:
      cycle_.heard_used(message->node);
      if (settled) defence_.heard_used(message->node);
      return;
    case Kind::identity: return cycle_.heard_identity(message->byte, message->value);
  }
}

void Negotiator::sent() noexcept {
  const bool settled = node_id().configured();
  sender_.sent();
  cycle_.sent();
  if (settled) defence_.sent();
}

void Negotiator::doubled() noexcept {
  if (node_id().configured() && !options_.literal) defence_.conflict();
}

void Negotiator::id_won(NodeId id) noexcept {
  choice_.prefer(id);
  choice_.avoid({});
  defence_.hold(id, false, sender_.now());
  owner_->node_id_taken(id);
}

void Negotiator::none_free() noexcept { owner_->all_taken(); }

// The holder's answer may be lost in the next cycle. A holder that stays silent after the dispute is gone.
void Negotiator::id_lost(NodeId id, IdLoss why) noexcept {
  lost_ = why;
  if (why != IdLoss::literal) {
    sender_.drop();
    choice_.avoid(id, sender_.in(options_.contest));
  }
  choice_.prefer(id);
  cycle_.wait();
  owner_->node_id_lost(id, why);
}

void Negotiator::id_kept(NodeId id) noexcept { owner_->node_id_kept(id); }

}  // namespace berth::research
