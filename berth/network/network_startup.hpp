/// The NMT startup of one network (CiA 302-2; docs/protocols/cia302.md §Boot-up of a network): applies the bits of
/// 1F80h, 1F81h and the boot time 1F89h to slaves that become ready, fail or are lost. It sends nothing and boots
/// nothing: its owner reports which slaves are ready, and executes its answers.
///
///     NetworkStartup startup(executor, owner);
///     startup.begin({rules_1F80, boot_time, slaves});
///     ... after each boot-up that ended:   do_it(startup.look());
///
/// Both of Berth's masters use it: `NetworkBoot`, by a network list, and `berth up`, by the slots of a bus.
#pragma once

#include <algorithm>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "berth/network/slave_boots.hpp"
#include "berth/network/startup_phase.hpp"

namespace berth::network {

class NetworkStartup {
 public:
  using Phase = StartupPhase::Phase;
  using OnError = StartupPhase::OnError;

  /// What to start next.
  enum class Go : std::uint8_t {
    nothing,
    each,  ///< an NMT start for each waiting slave (`Slave::waits_for_start`)
    all,   ///< one NMT start for all
  };

  enum class News : std::uint8_t {
    failed,       ///< the startup is halted: this mandatory slave failed
    late,         ///< the startup is halted: this slave is not ready, and the boot time is over
    resumed,      ///< all mandatory slaves have become ready
    all_ready,    ///< all mandatory slaves are ready
    operational,  ///< the master, and with it the network
  };

  class Owner {
   public:
    /// For mandatory slaves: true if it is there, and its boot-up has succeeded.
    [[nodiscard]] virtual bool is_ready(const Slave& slave) const noexcept { return slave.status.ready(); }
    /// True if its boot-up, or its identification, has failed. A silent slave is waited for.
    [[nodiscard]] virtual bool has_failed(const Slave& slave) const noexcept {
      return slave.status.phase == SlavePhase::failed;
    }
    /// `slave`: the slave concerned, if any.
    virtual void heard(News news, const Slave* slave) noexcept = 0;
    /// Applies the command to the master's own device.
    virtual void apply(co::NmtCommand command) noexcept = 0;

   protected:
    ~Owner() = default;
  };

  struct Plan {
    manager::Startup rules;
    rt::Duration boot_time{};         ///< 1F89h; 0: unlimited
    std::vector<Slave*> slaves = {};  ///< must stay until the next `begin`
    /// A halted startup resumes by itself; else the application resumes it (`operate`).
    bool resumes = false;
    /// Without a mandatory slave the master waits for `all_operational`; else it becomes operational at once.
    bool awaits_all = false;
  };

  NetworkStartup(rt::Executor& executor, Owner& owner) noexcept : owner_(&owner), late_(*this, executor) {}

  void begin(Plan plan);
  void end() noexcept;
  /// All nodes are stopped, because of an error of a mandatory slave.
  void stop() noexcept;

  [[nodiscard]] Phase phase() const noexcept { return phase_.now(); }
  [[nodiscard]] bool is(Phase phase) const noexcept { return phase_.is(phase); }
  [[nodiscard]] const manager::Startup& rules() const noexcept { return plan_.rules; }
  /// The first mandatory slave that is not ready; null: all are.
  [[nodiscard]] const Slave* missing() const noexcept;
  [[nodiscard]] bool has_mandatory() const noexcept;

  /// Step 10: true if this ready slave gets its own NMT start at once (bits 1 and 3).
  [[nodiscard]] bool starts(const Slave& slave) const noexcept {
    return slave.released || phase_.starts(slave.what.rules, master_operational_);
  }
  /// A boot-up has ended, or something else may have changed: checks the mandatory slaves.
  [[nodiscard]] Go look() noexcept;
  /// Every required slave is operational (`Plan::awaits_all`).
  void all_operational() noexcept;
  /// The application makes the master operational, `halted` or not. Errc::invalid: the startup has not come so far, or
  /// a mandatory slave is not ready (`Error::node`).
  [[nodiscard]] Result<Go> operate();
  /// The NMT state of the master's own device.
  [[nodiscard]] Go own_state(NmtState state) noexcept;
  /// The reaction to an error event of this slave; empty: none, because the startup has not begun, or all nodes are
  /// stopped.
  [[nodiscard]] std::optional<OnError> on_error(const Slave& slave) const noexcept;

 private:
  void late() noexcept;
  void halt(const Slave& slave, News why) noexcept;
  void make_operational() noexcept;
  [[nodiscard]] Go go() noexcept;

  Owner* owner_;
  Plan plan_;
  StartupPhase phase_;
  bool master_operational_ = false;
  rt::Later<NetworkStartup, &NetworkStartup::late> late_;
};

}  // namespace berth::network
