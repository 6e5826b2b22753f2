/// A network directly on a bus, for `NetworkBoot` and `BootSlave`: SDO by the default channels, NMT commands with the
/// inhibit time between them, heartbeat consumer, node guarding, and the boot-up messages and states of all nodes.
///
///     ManagedBus bus(dispatcher);                        // or (dispatcher, sdo), where the node has an SDO client
///     bus.nmt().set_inhibit(10ms);                       // 102Ah
///     bus.on_apply([&](co::NmtCommand command) { own_device.apply(command); });
///     NetworkBoot network(executor, bus);
///     bus.lead_to(&network.error_control());
///     plan.slaves.push_back({node, rules, &bus.target(node), &source});
///
/// One manager per bus. It shares the dispatcher with the master's own device, which does not hear it.
#pragma once

#include <array>
#include <bitset>
#include <functional>
#include <memory>
#include <optional>

#include "berth/co/guarding.hpp"
#include "berth/co/heartbeat.hpp"
#include "berth/co/nmt_master.hpp"
#include "berth/co/sdo_access.hpp"
#include "berth/network/boot_network.hpp"

namespace berth::network {

class ManagedBus final : public BootBus,
                         private can::Handler,
                         private co::HeartbeatConsumer::Observer,
                         private co::GuardingMaster::Observer {
 public:
  /// The dispatcher must stay.
  explicit ManagedBus(can::Dispatcher& dispatcher);
  /// `sdo`: the SDO client used by the rest of this node, on this dispatcher; it must stay. With two clients in one
  /// node, each would take the other's answers for those of a second device.
  ManagedBus(can::Dispatcher& dispatcher, co::SdoClient& sdo);
  ~ManagedBus() override;

  /// Receives the events of error control; may be null. Must stay, or be removed.
  void lead_to(ErrorControl* listener) noexcept { listener_ = listener; }
  /// Applies commands to the master's own device; without a function, nothing is applied.
  void on_apply(std::function<void(co::NmtCommand)> apply) { apply_ = std::move(apply); }
  [[nodiscard]] co::SdoClient& sdo() noexcept { return *sdo_; }
  [[nodiscard]] co::NmtMaster& nmt() noexcept { return nmt_; }

  /// The slave with this node-ID (configured); valid as long as this object.
  [[nodiscard]] BootTarget& target(NodeId node);

  rt::Task<Result<rt::Time>> command(co::NmtCommand command, co::NmtTarget target) override;
  void apply(co::NmtCommand command) noexcept override {
    if (apply_) apply_(command);
  }

 private:
  ManagedBus(can::Dispatcher& dispatcher, std::unique_ptr<co::SdoClient> own, co::SdoClient* shared);
  class Target;
  struct Heard {
    NmtState state = NmtState::initialising;  // initialising: a boot-up message
    rt::Time at{};
  };
  /// `auto heard = co_await Next(bus, node, deadline)`: the next error control frame of a node; empty: none before
  /// `deadline`.
  class Next;

  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void heartbeat(const co::HeartbeatEvent& event, rt::Time at) noexcept override;
  void guarding(const co::GuardingEvent& event, rt::Time at) noexcept override;
  void is_lost(NodeId node) noexcept;
  void is_back(NodeId node) noexcept;
  void supervise(NodeId node, const manager::SlaveRules& rules);

  can::Dispatcher* dispatcher_;
  ErrorControl* listener_ = nullptr;
  std::function<void(co::NmtCommand)> apply_;
  std::unique_ptr<co::SdoClient> own_sdo_;
  co::SdoClient* sdo_;
  co::NmtMaster nmt_;
  co::HeartbeatConsumer heartbeats_;
  co::GuardingMaster guarding_;
  std::array<std::unique_ptr<Target>, 128> targets_;
  std::array<std::optional<rt::Time>, 128> booted_;  // the last boot-up message
  std::bitset<128> reset_;                           // a reset was sent, and no boot-up message has come since
  std::bitset<128> lost_;
  rt::Duration longest_{};  // heartbeat time
  Next* waiting_ = nullptr;
};

}  // namespace berth::network
