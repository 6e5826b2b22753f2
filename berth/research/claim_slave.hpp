/// One device's side of claiming a node-ID in the data field (docs/claim.md; SAE J1939-81; S2.4): frames in, frames
/// out, a timer. No heap, no exceptions.
///
///     off -> claiming -> settled            250 ms without a lower NAME for this node-ID
///              ^  |         |
///              |  |         +-- a lower NAME claims it: off, the device resets communication and starts anew
///              |  +-- a lower NAME claims it: the next node-ID that no device was heard to claim
///              +-- cannot: none is left; tells so when asked
///
/// A device answers a higher NAME's claim of its own node-ID with its own claim. A device whose node-ID was assigned in
/// another way (`firm`) never yields.
#pragma once

#include <bitset>
#include <chrono>

#include "berth/base/random.hpp"
#include "berth/research/claim_frames.hpp"
#include "berth/rt/executor.hpp"

namespace berth::research {

enum class Claiming : std::uint8_t { off, claiming, settled, cannot };
[[nodiscard]] const char* name(Claiming state) noexcept;

struct ClaimOptions {
  LssAddress address{};
  NodeId preferred{};                                         ///< unconfigured: derived from the NAME
  std::uint64_t seed = 1;                                     ///< for the delay of "cannot claim"
  rt::Duration wait = std::chrono::milliseconds(250);         ///< from a claim to the use of the node-ID
  rt::Duration cannot_most = std::chrono::milliseconds(153);  ///< "cannot claim" is sent after a delay from 0 to this
};

/// The device. Called from the slave's calls and its timer; must not call back into it.
class ClaimOwner {
 public:
  /// Queues a frame; whether it was sent is not reported.
  virtual void send(const can::Frame& frame) noexcept = 0;
  /// The device has this node-ID from now on.
  virtual void claimed(NodeId id) noexcept = 0;
  /// A lower NAME took the node-ID in use: continue without one, then call `start` again.
  virtual void claim_lost(NodeId id) noexcept = 0;

 protected:
  ~ClaimOwner() = default;
};

class ClaimSlave final : private rt::Job {
 public:
  ClaimSlave(rt::Executor& executor, ClaimOwner& owner, const ClaimOptions& options) noexcept;

  /// While off, at power-on: sets another identity and forgets everything heard.
  void set_address(const LssAddress& address) noexcept;
  /// The device has no node-ID: claim one.
  void start() noexcept;
  /// The device has this node-ID; `firm`: not from a claim.
  void settle(NodeId id, bool firm) noexcept;
  void stop() noexcept;
  /// A frame of `claims` or `claim_requests`; others are ignored.
  void received(const can::Frame& frame) noexcept;

  [[nodiscard]] Claiming state() const noexcept { return state_; }
  /// Claimed or in use; unconfigured while off or `cannot`.
  [[nodiscard]] NodeId id() const noexcept { return id_; }
  [[nodiscard]] std::uint64_t name() const noexcept { return name_; }
  /// Claims sent since power-on.
  [[nodiscard]] unsigned claims_sent() const noexcept { return sent_; }

 private:
  void run() noexcept override;
  void heard(const Claim& other) noexcept;
  void say() noexcept;
  void next() noexcept;

  rt::Executor* executor_;
  ClaimOwner* owner_;
  ClaimOptions options_;
  std::uint64_t name_;
  Random random_;
  std::bitset<128> used_;  // other devices' claims were heard
  NodeId id_;
  Claiming state_ = Claiming::off;
  bool firm_ = false;
  unsigned sent_ = 0;
};

}  // namespace berth::research
