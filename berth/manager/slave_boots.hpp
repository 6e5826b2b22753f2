/// The slaves of a network, each with a boot-up of its own, side by side: a part of `NetworkBoot`.
#pragma once

#include <array>
#include <memory>
#include <span>

#include "berth/manager/boot_network.hpp"
#include "berth/rt/later.hpp"
#include "berth/rt/scope.hpp"

namespace berth::manager {

class SlaveBoots {
 public:
  /// Called from the slaves' tasks: must not destroy the slaves nor `set` others.
  class Owner {
   public:
    /// Step 10: a slave that is ready now is started by its master at once.
    virtual bool starts(const SlaveStatus& slave) noexcept = 0;
    /// Its boot-up ended, well or not: `slave.phase`.
    virtual void ended(const SlaveStatus& slave) noexcept = 0;
    /// It was started, by `starts`.
    virtual void started(const SlaveStatus& slave) noexcept = 0;
    /// An NMT command for it never left.
    virtual void not_sent(NodeId node, const Error& error) noexcept = 0;

   protected:
    ~Owner() = default;
  };

  struct Slave {
    Slave(rt::Executor& executor, const NetworkSlave& is) : what(is), scope(executor) {
      status.node = is.node;
      status.rules = is.rules;
    }
    NetworkSlave what;
    SlaveStatus status;
    rt::Time since = rt::never;  // a reset was sent then, and its boot-up message comes first
    bool may_run = false;        // under a former master (`BootOptions::may_run`)
    bool again = false;          // its boot-up begins anew, as soon as no task runs
    bool waits = false;          // for the boot-up message
    bool starting = false;       // NMT start is on its way
    std::optional<BootSlave> boot;
    rt::Scope scope;  // the last member: its task uses the others
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
  /// A boot-up message came while it was booting: is all to be done again?
  void booted_while_booting(Slave& slave, bool expected) noexcept;
  /// Begins or ends its error control; false: its rules have none.
  bool supervise(Slave& slave, bool on) noexcept;

  /// Null: there is none.
  [[nodiscard]] Slave* find(NodeId node) const noexcept { return node.configured() ? by_node_[node.value()] : nullptr; }
  [[nodiscard]] std::span<const std::unique_ptr<Slave>> all() const noexcept { return slaves_; }

 private:
  void begin_due() noexcept;
  rt::Task<void> run(Slave& slave);
  rt::Task<void> start(Slave& slave);

  rt::Executor* executor_;
  Owner* owner_;
  NetworkTiming timing_;
  rt::Duration boot_time_{};
  bool other_masters_ = false;
  std::vector<std::unique_ptr<Slave>> slaves_;
  std::array<Slave*, 128> by_node_{};
  rt::Later<SlaveBoots, &SlaveBoots::begin_due> due_{*this, *executor_};
};

}  // namespace berth::manager
