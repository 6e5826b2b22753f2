/// Chooses a device's node-ID (paper 2; S2.21): the preferred one, or the next after it that is not heard in use.
#pragma once

#include <bitset>

#include "berth/research/negotiation_rules.hpp"

namespace berth::research {

class NodeIdChoice {
 public:
  /// `options` must outlive this.
  explicit NodeIdChoice(const NegotiatorOptions& options) noexcept : options_(&options) {}
  /// In use by another device.
  void heard(NodeId id) noexcept { used_.set(id.value()); }
  /// A cycle begins: none is known to be in use.
  void begin() noexcept { used_.reset(); }
  /// The previous node-ID; unconfigured: none.
  void prefer(NodeId id) noexcept { last_ = id; }
  /// Not this one until then; unconfigured: no restriction.
  void avoid(NodeId id, rt::Time until = {}) noexcept { avoid_ = id, avoided_until_ = until; }
  /// Unconfigured: all are in use.
  [[nodiscard]] NodeId choose(rt::Time now) const noexcept;
  /// Its choice if no node-ID were in use.
  [[nodiscard]] NodeId preferred() const noexcept;

 private:
  const NegotiatorOptions* options_;
  std::bitset<128> used_;  // heard since the cycle began
  NodeId last_;
  NodeId avoid_;  // lost in a conflict
  rt::Time avoided_until_{};
};

}  // namespace berth::research
