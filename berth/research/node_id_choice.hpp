/// Which node-ID a device would have (paper 2; S2.21): of those that it does not hear in use the preferred one, else
/// the next after it.
#pragma once

#include <bitset>

#include "berth/research/negotiation_rules.hpp"

namespace berth::research {

class NodeIdChoice {
 public:
  /// `options` must stay.
  explicit NodeIdChoice(const NegotiatorOptions& options) noexcept : options_(&options) {}
  /// In use by another device.
  void heard(NodeId id) noexcept { used_.set(id.value()); }
  /// A cycle begins: none is known to be in use.
  void begin() noexcept { used_.reset(); }
  /// The one it had before; unconfigured: none.
  void prefer(NodeId id) noexcept { last_ = id; }
  /// Not this one until then; unconfigured: any.
  void avoid(NodeId id, rt::Time until = {}) noexcept { avoid_ = id, avoided_until_ = until; }
  /// Unconfigured: all are in use.
  [[nodiscard]] NodeId choose(rt::Time now) const noexcept;
  /// What it would choose if nothing were in use.
  [[nodiscard]] NodeId preferred() const noexcept;

 private:
  const NegotiatorOptions* options_;
  std::bitset<128> used_;  // heard since the cycle began
  NodeId last_;
  NodeId avoid_;  // lost in a conflict
  rt::Time avoided_until_{};
};

}  // namespace berth::research
