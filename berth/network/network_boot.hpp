/// The NMT startup of CiA 302-2 (docs/protocols/cia302.md §Boot-up of a network), from power-on to an operational
/// network, and the reaction to a slave that fails. The rules are 1F80h (`Startup`), 1F81h (`SlaveRules`) and 1F89h;
/// `BootSlave` has the steps of each slave.
///
///     ManagedBus bus(dispatcher);
///     NetworkBoot network(executor, bus);
///     bus.lead_to(&network.error_control());
///     network.observe([](const NetworkEvent& event) { print(text(event)); });
///     network.begin(plan);
///
/// Its steps:
///   1. reset communication: one command for all nodes, or, when a slave is keep-alive, one for each node-ID from 1 to
///      127 but the master's and the keep-alive ones'; none when the network was taken over (`NetworkPlan::taken_over`)
///   2. all slaves are booted side by side, mandatory or not; a slave that was reset is asked when its boot-up message
///      came, or after `NetworkTiming::boot_timeout`
///   3. each ready slave is started (1F80h bit 3 = 0 and: bit 1 = 0, or the master is operational; 1F81h bit 2 = 1; not
///      L)
///   4. a mandatory slave that fails, or 1F89h over before all mandatory ones are ready: `Phase::halted`. No slave is
///      started any more; those under way are booted to their end. `operate` goes on, `begin` begins anew
///   5. all mandatory ones ready: the master becomes operational (bit 2 = 0), or the application makes it so
///      (`operate`, `own_state`)
///   6. the master is operational: with bit 1 = 1 and bit 3 = 0 one start for all. As CiA 302-2 requires, that starts
///      every node of the bus, even one that failed its checks. In a network that was taken over, each slave that does
///      not run gets its own start instead
/// Optional slaves are booted all the time; one that is connected later is found by its boot-up message, or by polling.
///
/// An error event is: error control lost a ready slave, or a slave sent a boot-up message without a reset by the
/// master. The reaction:
/// - mandatory slave, bit 6: all nodes and the master are stopped (`Phase::stopped`, until `begin`)
/// - mandatory slave, no bit 6, bit 4: all nodes and the master are reset (`Phase::off`: the master begins when it has
///   booted)
/// - else only that slave: a lost one is reset and booted after its boot-up message; one that booted is booted at once.
///   A keep-alive slave is not reset but booted at once, beginning with its state (step 4 of `BootSlave`). A slave
///   without bit 2 of 1F81h only gets its error control again, and is not started
///
/// Every call may be made at any time from the executor, also from the callback: tasks are ended later. With bit 5
/// (flying master) `FlyingMaster` controls `begin` and `end`.
#pragma once

#include <functional>

#include "berth/network/boot_network.hpp"
#include "berth/network/error_events.hpp"
#include "berth/network/network_startup.hpp"
#include "berth/network/slave_boots.hpp"

namespace berth::network {

class NetworkBoot final : private SlaveBoots::Owner, private NetworkStartup::Owner, private ErrorEvents::Network {
 public:
  using Phase = StartupPhase::Phase;

  /// `bus` must stay.
  NetworkBoot(rt::Executor& executor, BootBus& bus, const NetworkTiming& timing = {});

  void observe(std::function<void(const NetworkEvent&)> callback) { callback_ = std::move(callback); }

  /// Begins, or begins anew, with the reset. Errc::invalid: the plan's master is none (bit 0), or a slave is named
  /// twice or has no target, no source or no node-ID.
  Result<void> begin(NetworkPlan plan);
  /// Ends all activity, but keeps the known states of the slaves. With `releases` the device is no NMT master any more:
  /// waiting commands are dropped, and no slave is supervised.
  void end(bool releases = false) noexcept;
  /// The application makes the master operational. Errc::invalid: the startup has not come so far, or a mandatory slave
  /// is not ready (`Error::node`); also after `Phase::halted`.
  Result<void> operate();
  /// The NMT state that the master's own device has entered.
  void own_state(NmtState state) noexcept;
  /// Sends an NMT command and takes it into account: a slave that it resets is booted again, without an error event.
  /// For all nodes: `with_master` also applies it to the master. For the master's own node-ID: nothing is sent, it is
  /// only applied.
  void command(co::NmtCommand command, co::NmtTarget target, bool with_master = false) override;

  [[nodiscard]] Phase phase() const noexcept { return startup_.phase(); }
  [[nodiscard]] const NetworkPlan& plan() const noexcept { return plan_; }
  [[nodiscard]] NmtState own_state() const noexcept { return own_; }
  /// Null when it is not assigned, and from `begin` until the executor has run once. Valid until `begin`;
  /// `plan().slaves` has all assigned ones.
  [[nodiscard]] const SlaveStatus* find(NodeId node) const noexcept;
  /// Starts or ends the error control of a slave manually. Errc::not_found: not assigned. Errc::unsupported: it has
  /// neither a heartbeat time nor a guard time.
  Result<void> supervise(NodeId node, bool on);

  /// Receives the events of error control.
  [[nodiscard]] ErrorEvents& error_control() noexcept { return errors_; }

 private:
  using Kind = NetworkEvent::Kind;
  bool starts(const Slave& slave) noexcept override { return startup_.starts(slave); }
  void ended(Slave& slave) noexcept override;
  void started(Slave& slave, const Result<bool>& ran) noexcept override;
  void heard(NetworkStartup::News news, const Slave* slave) noexcept override;
  void apply(co::NmtCommand command) noexcept override;
  [[nodiscard]] bool is_off() const noexcept override;
  void end_for_all(bool stopped) noexcept override;
  void tell(const NetworkEvent& event) const override {
    if (callback_) callback_(event);
  }

  void act() noexcept;
  rt::Task<void> reset_and_boot();
  rt::Task<void> send(co::NmtCommand command, co::NmtTarget target, bool with_master);
  void go(NetworkStartup::Go what) noexcept;
  void commanded(Slave& slave, co::NmtCommand command, rt::Time at) noexcept;

  enum class Next : std::uint8_t { nothing, begin, cancel, release };
  rt::Executor* executor_;
  BootBus* bus_;
  NetworkTiming timing_;
  std::function<void(const NetworkEvent&)> callback_;
  NetworkPlan plan_;
  NmtState own_ = NmtState::pre_operational;
  Next next_ = Next::nothing;
  SlaveBoots boots_;
  NetworkStartup startup_;
  ErrorEvents errors_{*this, startup_, boots_};
  rt::Later<NetworkBoot, &NetworkBoot::act> act_{*this, *executor_};
  rt::Scope commands_;
  rt::Scope beginning_;
};

}  // namespace berth::network
