/// The slaves of a network on their way from "it is there" to its start: steps 1 to 9 by `BootSlave`, and step 10, the
/// slave's own NMT start (CiA 302-2; docs/protocols/cia302.md §Boot-up of a slave). All are booted side by side.
///
/// Which slave is booted when, its owner says:
///   - `boot`: after its boot-up message, or by asking until it answers. `NetworkBoot` does so by a network list
///   - `boot_found`: now, in the caller's scope, because the owner has found out that the slave is there and is the
///     right device. `berth up` does so by its slots
/// The way of a slave is the same: its source is asked for its rules, `BootSlave` runs, `ended` tells how, and when
/// `starts` said so it is started.
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

/// A slave, and how far its boot-up has come.
struct Slave {
  Slave(rt::Executor& executor, const NetworkSlave& is) : what(is), scope(executor) {
    status.node = is.node;
    status.rules = is.rules;
  }
  /// It is ready and waits for its start: the startup of the network says for what.
  [[nodiscard]] bool waits_for_start() const noexcept { return status.phase == SlavePhase::ready && !starting; }
  /// It is booted anew, or looked for: nothing of its last boot-up counts.
  void forget() noexcept {
    status.phase = SlavePhase::idle;
    status.result = {};
    starting = released = false;
  }

  NetworkSlave what;
  SlaveStatus status;
  rt::Time since = rt::never;  // a reset was sent then, and its boot-up message comes first
  bool may_run = false;        // under a former master (`BootOptions::may_run`)
  bool again = false;          // its boot-up begins anew, as soon as no task runs
  bool waits = false;          // for the boot-up message
  bool starting = false;       // NMT start is on its way
  bool released = false;       // a person starts it, whatever the startup of the network waits for
  std::optional<BootSlave> boot;
  rt::Scope scope;  // the last member: its task uses the others
};

class SlaveBoots {
 public:
  class Owner {
   public:
    /// Its boot-up has ended well: is it started now, by itself?
    virtual bool starts(const Slave& slave) noexcept = 0;
    /// Its boot-up ended, well or not: `status.phase`. `starting` says whether its start follows; an owner that finds
    /// that it is not ready after all sets its phase to idle, and it is not started.
    virtual void ended(Slave& slave) noexcept = 0;
    /// NMT start was sent to it; true: not, as it runs by another's doing (`BootTarget::runs`); or the command never
    /// left.
    virtual void started(Slave& slave, const Result<bool>& ran) noexcept = 0;

   protected:
    ~Owner() = default;
  };

  SlaveBoots(rt::Executor& executor, Owner& owner, const NetworkTiming& timing) noexcept
      : executor_(&executor), owner_(&owner), timing_(timing) {}

  /// Other slaves, all idle. Not from inside a task. `other_masters`: a slave whose boot-up message was not heard may
  /// have been started by another master, on the other side of a cut, say.
  void set(std::span<const NetworkSlave> slaves, rt::Duration boot_time, bool other_masters);
  /// Ends every boot-up under way; what is known of the slaves stays. Not from inside a task.
  void cancel() noexcept;
  /// The same, and no slave is supervised any more.
  void release() noexcept;
  /// Its boot-up begins, or begins anew. `since`: a reset was sent to it then, and its boot-up message is waited for.
  void boot(Slave& slave, rt::Time since = rt::never) noexcept;
  /// The same for a slave that a former master may have started.
  void take_over(Slave& slave) noexcept;
  /// A slave of the owner's, which has identified it since its last boot-up: its boot-up and its start. One that is
  /// silent now is B. `typed`: it has answered 1000h since then.
  [[nodiscard]] rt::Task<void> boot_found(Slave& slave, bool typed);
  /// The start of a slave that waited for it.
  [[nodiscard]] rt::Task<void> start(Slave& slave);
  /// A boot-up message came while it was booting: is all to be done again?
  void booted_while_booting(Slave& slave, bool expected) noexcept;
  /// Begins or ends its error control; false: its rules have none.
  bool supervise(Slave& slave, bool on) noexcept;

  /// Null: there is none.
  [[nodiscard]] Slave* find(NodeId node) const noexcept { return node.configured() ? by_node_[node.value()] : nullptr; }
  /// Those of `set`.
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
