/// A bus beneath a gateway as its upstream side sees it (paper 3 Figures 1, 2 and 4; docs/multilevel.md §Boot-up): the
/// machine boots from the bottom up, and failures beneath are reported above.
///
///     multilevel::SubBus bus(executor, emcy, [&](co::NmtCommand command) { upper.apply(command); });
///     bus.on_settled([&] { upper.power_on(); });       // the bus beneath has booted, or failed: now the one above
///     lower_manager.network().observe(... bus.booted() ... bus.failed(node) ...);
///     upper.on().state = [&](NmtState state) { bus.own_state(state); };
///
/// If the bus beneath has failed and the upstream side becomes operational: a mandatory bus causes EMCY FF01h, and then
/// the upstream side is stopped, so that the boot-up above fails too (Figure 1); an optional one causes only EMCY FF02h
/// (Figure 2). The error exits if the bus boots later.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "berth/co/nmt.hpp"
#include "berth/multilevel/emcy_gateway.hpp"
#include "berth/od/values.hpp"
#include "berth/rt/later.hpp"

namespace berth::multilevel {

class SubBus {
 public:
  /// `emcy` must outlive it. `apply`: applies an NMT command to the upstream device.
  SubBus(rt::Executor& executor, EmcyGateway& emcy, std::function<void(co::NmtCommand)> apply);

  /// 5F00h. Used when the bus fails, and each time the upstream side becomes operational.
  void set_mandatory(bool mandatory) noexcept { mandatory_ = mandatory; }
  /// Called once, when the boot-up beneath has ended, successfully or not.
  void on_settled(std::function<void()> call) { settled_call_ = std::move(call); }
  /// The effect above of a lost heartbeat beneath (1029h:F1h..F8h); called after its EMCY is sent. Empty: none, since
  /// the paper requires only the EMCY.
  void on_heartbeat_lost(std::function<void()> call) { lost_call_ = std::move(call); }

  /// The gateway is switched on: the state of the bus beneath is unknown.
  void begin() noexcept { settled_ = failed_ = stops_ = effect_ = false; }
  /// All mandatory slaves beneath are ready.
  void booted();
  /// The boot-up beneath has failed because of this node (unconfigured: of no known one).
  void failed(NodeId node);
  /// The upstream device has entered this NMT state.
  void own_state(NmtState state);
  /// An event of the heartbeat consumer beneath.
  void heartbeat(const co::HeartbeatEvent& event);

  [[nodiscard]] bool settled() const noexcept { return settled_; }
  [[nodiscard]] bool has_failed() const noexcept { return failed_; }

 private:
  [[nodiscard]] std::uint16_t code() const noexcept {
    return mandatory_ ? gateway_code::mandatory_bus_failed : gateway_code::optional_bus_failed;
  }
  void settle();
  void tell_failure();
  void drained() noexcept;
  void act() noexcept;

  EmcyGateway* emcy_;
  std::function<void(co::NmtCommand)> apply_;
  std::function<void()> settled_call_;
  std::function<void()> lost_call_;
  NodeId by_;
  std::uint16_t told_ = 0;  // the code pending above
  NmtState own_ = NmtState::initialising;
  bool mandatory_ = false;
  bool settled_ = false;
  bool failed_ = false;
  bool stops_ = false;   // after the EMCY is sent
  bool effect_ = false;  // the same, for a lost heartbeat
  rt::Later<SubBus, &SubBus::act> act_;
};

/// Adds the objects of this header for buses 1 to `ports` to an upstream dictionary: 5F00h (UNSIGNED8 each, 1 =
/// mandatory) and 1029h:F1h.. (0 = pre-operational if operational, 1 = no change, 2 = stopped; default 1).
void add_sub_buses(od::DescriptionBuilder& builder, unsigned ports = 1);
[[nodiscard]] bool is_mandatory(const od::Values& upper, unsigned port) noexcept;
/// The error class of 1029h for the heartbeats of this bus.
[[nodiscard]] constexpr std::uint8_t heartbeat_error_class(unsigned port) noexcept {
  return static_cast<std::uint8_t>(0xF0 + port);
}

/// The time a bus takes to boot, to check that 1F89h of a bus above allows for all beneath (S3.4).
struct BootNeed {
  std::string name;
  rt::Duration own{};        ///< of its own nodes, without gateways
  rt::Duration boot_time{};  ///< its 1F89h; 0: no limit
  std::vector<BootNeed> beneath{};
};
/// The net boot time: its own and the longest of those beneath, which boot in parallel.
[[nodiscard]] rt::Duration net_boot_time(const BootNeed& bus);
struct BootTimeTooShort {
  std::string name;
  rt::Duration boot_time{};
  rt::Duration needed{};
};
/// Each bus whose boot time is too short, top down.
[[nodiscard]] std::vector<BootTimeTooShort> short_boot_times(const BootNeed& bus);

}  // namespace berth::multilevel
