#include "berth/device/negotiation.hpp"

#include <array>
#include <utility>

#include "berth/research/negotiation_frames.hpp"

namespace berth::device {
namespace {

constexpr rt::Duration memory_busy = std::chrono::milliseconds(50);

}  // namespace

Negotiation::Negotiation(can::Dispatcher& dispatcher, Owner& owner, NvMemory* memory,
                         const research::NegotiatorOptions& options)
    : dispatcher_(&dispatcher),
      owner_(&owner),
      options_(options),
      negotiator_(dispatcher.executor(), static_cast<research::NegotiatorOwner&>(*this), options) {
  if (memory != nullptr) record_.emplace(*memory, memory_at, 1);
}

Negotiation::~Negotiation() {
  if (record_ && record_->busy()) record_->forget();
}

void Negotiation::power_on(const LssAddress& address) noexcept {
  negotiator_.set_address(address);
  last_ = NodeId();
  std::array<std::uint8_t, 1> raw{};
  if (record_ && record_->load(raw)) last_ = NodeId::make(raw[0]).value_or(NodeId());
}

void Negotiation::power_off() noexcept {
  negotiator_.stop();
  dispatcher_->remove(*this);
  cancel();
  if (record_) record_->forget();
  negotiated_ = NodeId();
  hears_ = lost_ = false;
}

void Negotiation::resetting() noexcept {
  hears_ = false;
  dispatcher_->remove(*this);
  if (!lost_) negotiator_.stop();
}

void Negotiation::ready(NodeId id) noexcept {
  hears_ = true;
  const bool lost = std::exchange(lost_, false);
  listen(!id.configured());
  if (id.configured()) {
    negotiator_.settle(id, id != negotiated_);
  } else if (lost) {
    negotiator_.begin_anew();
  } else {
    negotiator_.start(last_);
  }
}

void Negotiation::listen(bool all) {
  dispatcher_->remove(*this);
  if (!all) return dispatcher_->add(research::negotiation_control, *this);
  dispatcher_->add(can::all_base, *this);  // to measure the bus load
  dispatcher_->add(can::all_extended, *this);
}

bool Negotiation::send(const can::Frame& frame) noexcept {
  if (!hears_) return false;
  withdraw();
  return dispatcher_->send(frame, *this) == can::Queued::yes;
}

void Negotiation::withdraw() noexcept {
  if (pending()) dispatcher_->withdraw(*this);
}

void Negotiation::node_id_taken(NodeId id) noexcept {
  last_ = negotiated_ = id;
  listen(false);
  keep();
  owner_->negotiated(id);
}

void Negotiation::node_id_lost(NodeId id, research::IdLoss why) noexcept {
  negotiated_ = NodeId();
  lost_ = true;
  owner_->negotiation_lost(id, why);
}

// --- Memory

bool Negotiation::stored() noexcept {
  std::array<std::uint8_t, 1> raw{};
  return record_->load(raw) && raw[0] == last_.value();
}

void Negotiation::keep() noexcept {
  if (!record_ || record_->busy() || stored()) return;
  const std::array<std::uint8_t, 1> raw{last_.value()};
  if (!record_->save(raw, *this)) dispatcher_->executor().after(memory_busy, *this);  // something else is being written
}

// A node-ID that could not be written is lost when the power goes. Another one may have been taken meanwhile.
void Negotiation::written(bool ok) noexcept {
  if (ok) keep();
}

}  // namespace berth::device
