/// Takes the slaves of a network from detection to their start: steps 1 to 9 by `BootSlave`, and step 10, the slave's
/// own NMT start (CiA 302-2; docs/protocols/cia302.md §Boot-up of a slave). All are booted side by side.
///
/// Its owner decides when to boot which slave:
/// - `boot`: after its boot-up message, or by polling until it answers. `NetworkBoot` does so by a network list
/// - `boot_found`: at once, in the caller's scope, because the owner has identified the slave as the right device.
///   `berth up` does so by its slots
/// The steps are the same: the source gives the slave's rules, `BootSlave` runs, `ended` reports the result, and if
/// `starts` returned true, the slave is started.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "berth/network/boot_network.hpp"
#include "berth/rt/later.hpp"
#include "berth/rt/scope.hpp"

namespace berth::network {

/// A slave and the state of its boot-up.
struct Slave {
  Slave(rt::Executor& executor, const NetworkSlave& is) : what(is), scope(executor) {
    status.node = is.node;
    status.rules = is.rules;
  }
  /// It is ready and waits for its start; the network's startup decides when.
  [[nodiscard]] bool waits_for_start() const noexcept { return status.phase == SlavePhase::ready && !starting; }
  /// It is booted anew, or searched for: the results of its last boot-up become invalid.
  void forget() noexcept {
    status.phase = SlavePhase::idle;
    status.result = {};
    starting = released = false;
  }

  NetworkSlave what;
  SlaveStatus status;
  rt::Time since = rt::never;  // time of a reset whose boot-up message has not come yet
  bool may_run = false;        // under a former master (`BootOptions::may_run`)
  bool again = false;          // its boot-up begins anew as soon as no task runs
  bool waits = false;          // for the boot-up message
  bool starting = false;       // NMT start is being sent
  bool released = false;       // the user starts it, whatever the network's startup waits for
  std::optional<BootSlave> boot;
  rt::Scope scope;  // the last member: its task uses the others
};

class SlaveBoots {
 public:
  class Owner {
   public:
    /// Its boot-up has succeeded. True: start it at once.
    virtual bool starts(const Slave& slave) noexcept = 0;
    /// Its boot-up ended, well or not: see `status.phase`. `starting` shows whether its start follows; if the owner
    /// finds that it is not ready after all, it sets the phase to idle, and the slave is not started.
    virtual void ended(Slave& slave) noexcept = 0;
    /// NMT start was sent to it; true: it was not sent, because another master runs it (`BootTarget::runs`); an error:
    /// the command was never sent.
    virtual void started(Slave& slave, const Result<bool>& ran) noexcept = 0;

   protected:
    ~Owner() = default;
  };

  SlaveBoots(rt::Executor& executor, Owner& owner, const NetworkTiming& timing) noexcept
      : executor_(&executor), owner_(&owner), timing_(timing) {}

  /// Replaces the slaves; all are idle. Not from inside a task. `other_masters`: a slave whose boot-up message was not
  /// heard may have been started by another master, for example on the other side of a cut.
  void set(std::span<const NetworkSlave> slaves, rt::Duration boot_time, bool other_masters);
  /// Ends every boot-up under way; the known states of the slaves stay. Not from inside a task.
  void cancel() noexcept;
  /// The same, and ends the supervision of all slaves.
  void release() noexcept;
  /// Begins its boot-up, anew if necessary. `since`: a reset was sent to it then, and its boot-up message is waited
  /// for.
  void boot(Slave& slave, rt::Time since = rt::never) noexcept;
  /// The same for a slave that a former master may have started.
  void take_over(Slave& slave) noexcept;
  /// Boot-up and start of a slave that the owner has identified since its last boot-up. If it does not answer, the
  /// result is B. `typed`: it has answered 1000h since then.
  [[nodiscard]] rt::Task<void> boot_found(Slave& slave, bool typed);
  /// Starts a slave that waited for it.
  [[nodiscard]] rt::Task<void> start(Slave& slave);
  /// A boot-up message came while it was booting: decides whether to repeat all.
  void booted_while_booting(Slave& slave, bool expected) noexcept;
  /// Starts or ends its error control; false: its rules have none.
  bool supervise(Slave& slave, bool on) noexcept;

  /// Null: there is none.
  [[nodiscard]] Slave* find(NodeId node) const noexcept { return node.configured() ? by_node_[node.value()] : nullptr; }
  /// The slaves of `set`.
  [[nodiscard]] std::span<const std::unique_ptr<Slave>> all() const noexcept { return slaves_; }

 private:
  void begin_due() noexcept;
  rt::Task<void> boot_awaited(Slave& slave);
  rt::Task<void> run(Slave& slave, BootOptions options);

  rt::Executor* executor_;
  Owner* owner_;
  NetworkTiming timing_;
  rt::Duration boot_time_{};
  bool other_masters_ = false;
  std::vector<std::unique_ptr<Slave>> slaves_;
  std::array<Slave*, 128> by_node_{};
  rt::Later<SlaveBoots, &SlaveBoots::begin_due> due_{*this, *executor_};
};

}  // namespace berth::network
