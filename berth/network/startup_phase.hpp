/// The progress of a network's NMT startup (CiA 302-2; docs/protocols/cia302.md §Boot-up of a network): applies the
/// bits of 1F80h to slaves that become ready or fail. It sends nothing and knows no slave: `NetworkBoot` uses it for a
/// network list, `berth up` for the slots of a bus.
///
///     off ── begin ──> booting ── all_ready ──> ready ── operate ──> operational
///                      │      ^                                      │
///                 halt v      │ resume                          stop v
///                      halted ┘                                      stopped
#pragma once

#include <cstdint>
#include <string_view>

#include "berth/manager/boot_rules.hpp"

namespace berth::network {

class StartupPhase {
 public:
  enum class Phase : std::uint8_t {
    off,          ///< not the master, not begun, ended, or resetting itself
    booting,      ///< waiting for mandatory slaves
    halted,       ///< a mandatory slave is not ready
    ready,        ///< the application must make the master operational
    operational,  ///< the network is operational
    stopped,      ///< by an error of a mandatory slave (bit 6)
  };
  /// The reaction to an error event of a slave.
  enum class OnError : std::uint8_t {
    one,    ///< only that slave is booted again
    reset,  ///< all nodes and the master are reset (bit 4)
    stop,   ///< all nodes and the master are stopped (bit 6)
  };

  void begin(const manager::Startup& startup) noexcept {
    startup_ = startup;
    phase_ = Phase::booting;
  }
  void end() noexcept { phase_ = Phase::off; }
  void stop() noexcept { phase_ = Phase::stopped; }
  [[nodiscard]] Phase now() const noexcept { return phase_; }
  [[nodiscard]] bool is(Phase phase) const noexcept { return phase_ == phase; }

  /// A mandatory slave failed, or the boot time is over before all are ready. True if that halts the startup.
  [[nodiscard]] bool halt() noexcept { return step(Phase::booting, Phase::halted); }
  /// The mandatory slaves have become ready after all.
  bool resume() noexcept { return step(Phase::halted, Phase::booting); }
  /// All mandatory slaves are ready. True the first time only.
  [[nodiscard]] bool all_ready() noexcept { return step(Phase::booting, Phase::ready); }
  /// Bit 2: true if the master makes itself operational at once.
  [[nodiscard]] bool operates_itself() const noexcept { return is(Phase::ready) && !startup_.application_operates; }
  /// The application may make the master operational, if no mandatory slave is missing.
  [[nodiscard]] bool may_operate() const noexcept { return is(Phase::ready) || is(Phase::halted); }
  /// Also for a halted startup, if the application has checked that no mandatory slave is missing.
  void make_ready() noexcept { phase_ = Phase::ready; }
  /// The master is operational. True the first time only.
  bool operate() noexcept;

  /// Step 10: true if this ready slave gets its own NMT start at once (bits 1 and 3).
  [[nodiscard]] bool starts(const manager::SlaveRules& slave, bool master_operational) const noexcept;
  /// One NMT start for all when the master becomes operational.
  [[nodiscard]] bool starts_all() const noexcept { return startup_.starts_all_at_once && !startup_.application_starts; }
  [[nodiscard]] bool application_starts() const noexcept { return startup_.application_starts; }
  [[nodiscard]] OnError on_error(const manager::SlaveRules& slave) const noexcept;

 private:
  [[nodiscard]] bool step(Phase from, Phase to) noexcept;

  manager::Startup startup_;
  Phase phase_ = Phase::off;
};
/// "off", "booting", ...
[[nodiscard]] std::string_view name(StartupPhase::Phase phase) noexcept;

}  // namespace berth::network
