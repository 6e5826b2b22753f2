/// The NMT startup of one network (CiA 302-2; docs/protocols/cia302.md §Boot-up of a network): what the bits of 1F80h,
/// 1F81h and the boot time 1F89h make of slaves that become ready, fail or are lost. It sends nothing and boots nobody:
/// its owner says which slaves are ready, and does what it answers.
///
///     NetworkStartup startup(executor, owner);
///     startup.begin({rules_1F80, boot_time, slaves});
///     ... after each boot-up that ended:   do_it(startup.look());
///
/// Both masters of this house use it: `NetworkBoot`, by a network list, and `berth up`, by the slots of a bus.
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

  /// What is to be started now.
  enum class Go : std::uint8_t {
    nothing,
    each,  ///< an NMT start for each slave that waits (`Slave::waits_for_start`)
    all,   ///< one NMT start for all
  };

  enum class News : std::uint8_t {
    failed,       ///< the startup is halted: this mandatory slave failed
    late,         ///< the same: it is not ready, and the boot time is over
    resumed,      ///< the mandatory slaves are ready after all
    all_ready,    ///< all mandatory slaves
    operational,  ///< the master, and with it the network
  };

  class Owner {
   public:
    /// Asked of mandatory slaves: it is there, and its boot-up has ended well.
    [[nodiscard]] virtual bool is_ready(const Slave& slave) const noexcept { return slave.status.ready(); }
    /// Its boot-up, or the question who it is, has ended, and not well. One that is silent is waited for.
    [[nodiscard]] virtual bool has_failed(const Slave& slave) const noexcept {
      return slave.status.phase == SlavePhase::failed;
    }
    /// `slave`: where one is concerned.
    virtual void heard(News news, const Slave* slave) noexcept = 0;
    /// Does to the master's own device what the command says.
    virtual void apply(co::NmtCommand command) noexcept = 0;

   protected:
    ~Owner() = default;
  };

  struct Plan {
    manager::Startup rules;
    rt::Duration boot_time{};         ///< 1F89h; 0: for ever
    std::vector<Slave*> slaves = {};  ///< must stay until the next `begin`
    /// A halted startup goes on by itself; else the application says so (`operate`).
    bool resumes = false;
    /// Without a mandatory slave the master waits for `all_operational`; else it is operational at once.
    bool awaits_all = false;
  };

  NetworkStartup(rt::Executor& executor, Owner& owner) noexcept : owner_(&owner), late_(*this, executor) {}

  void begin(Plan plan);
  void end() noexcept;
  /// All nodes are stopped, for an error of a mandatory slave.
  void stop() noexcept;

  [[nodiscard]] Phase phase() const noexcept { return phase_.now(); }
  [[nodiscard]] bool is(Phase phase) const noexcept { return phase_.is(phase); }
  [[nodiscard]] const manager::Startup& rules() const noexcept { return plan_.rules; }
  /// The first mandatory slave that is not ready; null: all are.
  [[nodiscard]] const Slave* missing() const noexcept;
  [[nodiscard]] bool has_mandatory() const noexcept;

  /// Step 10: this slave, which is ready, is started by an NMT start of its own now (bits 1 and 3).
  [[nodiscard]] bool starts(const Slave& slave) const noexcept {
    return slave.released || phase_.starts(slave.what.rules, master_operational_);
  }
  /// A boot-up has ended, or something else may have changed: the mandatory slaves are looked at.
  [[nodiscard]] Go look() noexcept;
  /// Every slave that counts is operational (`Plan::awaits_all`).
  void all_operational() noexcept;
  /// The application makes the master operational, `halted` or not. Errc::invalid: it has not come so far, or a
  /// mandatory slave is not ready (`Error::node`).
  [[nodiscard]] Result<Go> operate();
  /// The NMT state that the master's own device has.
  [[nodiscard]] Go own_state(NmtState state) noexcept;
  /// What an error event of this slave asks for; none: nothing, as the startup has not begun, or all nodes are stopped.
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
