#include "berth/research/claim_slave.hpp"

namespace berth::research {

const char* name(Claiming state) noexcept {
  switch (state) {
    case Claiming::off: return "off";
    case Claiming::claiming: return "claiming";
    case Claiming::settled: return "settled";
    case Claiming::cannot: return "cannot claim";
  }
  return "?";
}

ClaimSlave::ClaimSlave(rt::Executor& executor, ClaimOwner& owner, const ClaimOptions& options) noexcept
    : executor_(&executor),
      owner_(&owner),
      options_(options),
      name_(claim_name(options.address)),
      random_(options.seed) {}

void ClaimSlave::set_address(const LssAddress& address) noexcept {
  options_.address = address;
  name_ = claim_name(address);
  used_.reset();
  sent_ = 0;
}

void ClaimSlave::start() noexcept {
  firm_ = false;
  id_ = options_.preferred;
  if (!id_.configured()) id_ = NodeId(static_cast<std::uint8_t>(1 + name_ % 127));
  if (used_.test(id_.value())) return next();
  state_ = Claiming::claiming;
  say();
}

void ClaimSlave::settle(NodeId id, bool firm) noexcept {
  cancel();
  id_ = id;
  firm_ = firm;
  state_ = Claiming::settled;
}

void ClaimSlave::stop() noexcept {
  cancel();
  state_ = Claiming::off;
  id_ = NodeId();
}

void ClaimSlave::received(const can::Frame& frame) noexcept {
  if (state_ == Claiming::off) return;
  if (const auto other = decode_claim(frame)) return heard(*other);
  const auto asked = decode_claim_request(frame);
  if (!asked || (*asked != claim_everybody && *asked != id_.value())) return;
  if (state_ != Claiming::cannot) {
    ++sent_;
    owner_->send(claim({.id = id_.value(), .name = name_}));
  } else if (!timed()) {
    executor_->after(rt::Duration(random_.between(0, options_.cannot_most.count())), *this);
  }
}

void ClaimSlave::heard(const Claim& other) noexcept {
  if (other.id == claim_nobody || other.name == name_) return;  // a clone's claim equals the own one
  if (other.id != id_.value()) {
    used_.set(other.id);
    return;
  }
  if (other.name > name_ || firm_) {
    ++sent_;
    owner_->send(claim({.id = id_.value(), .name = name_}));
    return;
  }
  used_.set(other.id);
  if (state_ != Claiming::settled) return next();
  const auto lost = id_;
  stop();
  owner_->claim_lost(lost);
}

// The next node-ID after the lost one that no device was heard to claim.
void ClaimSlave::next() noexcept {
  const unsigned from = id_.value();
  for (unsigned i = 0; i < 127; ++i) {
    const unsigned candidate = 1 + (from + i) % 127;
    if (used_.test(candidate)) continue;
    id_ = NodeId(static_cast<std::uint8_t>(candidate));
    state_ = Claiming::claiming;
    say();
    return;
  }
  id_ = NodeId();
  state_ = Claiming::cannot;
  executor_->after(rt::Duration(random_.between(0, options_.cannot_most.count())), *this);
}

void ClaimSlave::say() noexcept {
  ++sent_;
  owner_->send(claim({.id = id_.value(), .name = name_}));
  executor_->after(options_.wait, *this);
}

void ClaimSlave::run() noexcept {
  if (state_ == Claiming::cannot) {
    owner_->send(claim({.id = claim_nobody, .name = name_}));
    return;
  }
  if (state_ != Claiming::claiming) return;
  state_ = Claiming::settled;
  owner_->claimed(id_);
}

}  // namespace berth::research
