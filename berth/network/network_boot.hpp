/// The NMT startup of CiA 302-2 (docs/protocols/cia302.md §Boot-up of a network): from "power is on" to an operational
/// network, and what is done when a slave fails in it. The rules are 1F80h (`Startup`), 1F81h (`SlaveRules`) and 1F89h;
/// the steps of each slave are `BootSlave`'s.
///
///     ManagedBus bus(dispatcher);
///     NetworkBoot network(executor, bus);
///     bus.lead_to(&network.error_control());
///     network.observe([](const NetworkEvent& event) { print(text(event)); });
///     network.begin(plan);
///
/// What it does:
///   1. reset communication: one command for all nodes, or, when a slave is keep-alive, one for each node-ID from 1 to
///      127 but the master's and the keep-alive ones'; none when the network was taken over (`NetworkPlan::taken_over`)
///   2. all slaves are booted side by side, mandatory or not; a slave that was reset is asked when its boot-up message
///      came, or after `NetworkTiming::boot_timeout`
///   3. each ready slave is started (1F80h bit 3 = 0 and: bit 1 = 0, or the master is operational; 1F81h bit 2 = 1; not
///      L)
///   4. a mandatory slave that fails, or 1F89h over before all mandatory ones are ready: `Phase::halted`. No slave is
///      started any more; those under way are booted to their end. `operate` goes on, `begin` begins anew
///   5. all mandatory ones ready: the master becomes operational (bit 2 = 0), or the application makes it (`operate`,
///      `own_state`)
///   6. the master is operational: with bit 1 = 1 and bit 3 = 0 one start for all. That starts every node of the bus,
///      also one that failed its checks: so CiA 302-2 has it. A network that was taken over gets a start for each slave
///      that does not run instead
/// Optional slaves are booted all the time; one that is connected later is found by its boot-up message, or by asking.
///
/// An error event is: error control lost a slave that was ready, or it sent a boot-up message that no reset of the
/// master's explains. Of a mandatory slave, bit 6: all nodes and the master are stopped (`Phase::stopped`, until
/// `begin`); else bit 4: all nodes and the master are reset (`Phase::off`: the master begins when it has booted). Else
/// that slave alone: what was lost is reset and booted on its boot-up message; what booted is booted at once. A
/// keep-alive slave is not reset but booted at once: its state is looked at first (step 4 of `BootSlave`). A slave
/// without bit 2 of 1F81h gets its error control again, no more, and is not started.
///
/// Every call may be made at any time from the executor, also from the callback: what ends tasks is done later. With
/// bit 5 (flying master) `begin` and `end` follow `FlyingMaster`.
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

  /// Begins, or begins anew, from the reset on. Errc::invalid: the plan's master is none (bit 0), a slave is named
  /// twice, has no target, no source or no node-ID.
  Result<void> begin(NetworkPlan plan);
  /// Nothing is done any more; what is known of the slaves stays. With `releases` the device is no NMT master any more:
  /// commands that wait are dropped, and no slave is supervised.
  void end(bool releases = false) noexcept;
  /// The application makes the master operational. Errc::invalid: the startup has not come so far, or a mandatory slave
  /// is not ready (`Error::node`); after `Phase::halted` too.
  Result<void> operate();
  /// The NMT state that the master's own device has entered.
  void own_state(NmtState state) noexcept;
  /// Sends an NMT command and takes part: a slave that it resets is booted again, and that is no error event. To all:
  /// `with_master` does it to the master too. To the master's own node-ID: nothing is sent, it is done to it.
  void command(co::NmtCommand command, co::NmtTarget target, bool with_master = false) override;

  [[nodiscard]] Phase phase() const noexcept { return startup_.phase(); }
  [[nodiscard]] const NetworkPlan& plan() const noexcept { return plan_; }
  [[nodiscard]] NmtState own_state() const noexcept { return own_; }
  /// Null when it is not assigned, and from `begin` until the executor has run once. It stays until `begin`;
  /// `plan().slaves` has all assigned ones.
  [[nodiscard]] const SlaveStatus* find(NodeId node) const noexcept;
  /// Begins or ends the error control of a slave, by hand. Errc::not_found: not assigned. Errc::unsupported: it has
  /// neither a heartbeat time nor a guard time.
  Result<void> supervise(NodeId node, bool on);

  /// Where error control tells what it hears.
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
