/// The boot-up of one slave (CiA 302-2, "boot slave"; docs/protocols/cia302.md §Boot-up of a slave), from "is it
/// there?" to "it may be started". One procedure for any source of rules, configuration and program, and for any
/// location of the slave.
///
///     BootSlave boot(executor, target, source, rules, options);
///     const BootResult result = co_await boot.run();
///     if (!is_ready(result.status)) ... letter(result.status), result.detail
///
/// The steps; the letter is the result if the step fails:
///   1. assigned (A); if it is not to be booted, step 9 follows at once
///   2. 1000h is read repeatedly until `give_up` (B), and compared (C)
///   3. 1018h is read as far as it is expected (D, M, N, O), and the hardware version, 1009h and paper 3's 5F01h (N)
///   4. keep alive: its state is observed (E, F); if operational: step 9, and the result is L; else reset
///      communication. The same, except E and F, for a slave that a former master may have started
///      (`BootOptions::may_run`)
///   5. expected software (G, H): 1F56h, else 1F52h, else 100Ah, and whether it runs (1F51h)
///   6. update of the software (I), after which all begins at 2 again
///   7. expected configuration date, 8. configuration (J)
///   9. error control is started (K)
/// The network (`NetworkStartup`) decides about the start of the slave (step 10); `SlaveBoots` sends the start of one
/// slave.
#pragma once

#include <optional>
#include <string>

#include "berth/co/nmt.hpp"
#include "berth/co/sdo_access.hpp"
#include "berth/manager/boot_rules.hpp"
#include "berth/rt/task.hpp"

namespace berth::network {

/// How the master reaches the slave: on the master's bus, or beneath a gateway.
class BootTarget {
 public:
  virtual ~BootTarget() = default;
  [[nodiscard]] virtual co::SdoAccess& objects() noexcept = 0;
  /// Returns when it was sent. Errc::bus: it was never sent.
  [[nodiscard]] virtual rt::Task<Result<rt::Time>> command(co::NmtCommand command) = 0;
  /// True if a boot-up message came at or after `since` and before `deadline`.
  [[nodiscard]] virtual rt::Task<bool> boots(rt::Time since, rt::Time deadline) = 0;
  /// The state in the first heartbeat within this time. A boot-up message does not count.
  [[nodiscard]] virtual rt::Task<std::optional<NmtState>> heartbeat(rt::Duration within) = 0;
  /// The state in the answer to one remote frame.
  [[nodiscard]] virtual rt::Task<std::optional<NmtState>> guard() = 0;
  /// From the call on the master detects the loss of the slave: by heartbeat if the rules have one, else by node
  /// guarding if they have a guard time, else not at all.
  virtual void supervise(const manager::SlaveRules& rules) = 0;
  /// Called before its NMT start. True: another master made it operational, so it is not started.
  [[nodiscard]] virtual rt::Task<bool> runs();
  /// Its NMT start was sent.
  [[nodiscard]] virtual rt::Task<void> start_sent();
  /// The slave is commanded to restart by other means than NMT (1F51h): its next boot-up message is no error event.
  virtual void expect_boot_up() noexcept {}
};

/// What the boot-up downloads to a slave. The base class has nothing.
class BootSource {
 public:
  virtual ~BootSource() = default;
  /// Called before each boot-up: the slave may have become mandatory or optional, or no longer be booted.
  virtual void renew(manager::SlaveRules&) const noexcept {}
  /// Step 2, after each unanswered question to an optional slave. False: the application stops polling (paper 5, Figure
  /// 4). The result is then B, and only a boot-up message starts the boot-up again.
  [[nodiscard]] virtual bool polls() const noexcept { return true; }
  /// Step 8, including factory settings and saving. Succeeds if there is nothing to configure. `rules`: decides here
  /// how the slave is supervised from step 9 on (a slave without 1017h is guarded).
  [[nodiscard]] virtual rt::Task<Result<void>> configure(BootTarget& target, manager::SlaveRules& rules);
  /// Step 5, for a slave with more than one program: whether the others are as expected. Empty: yes; else the
  /// difference, for users.
  [[nodiscard]] virtual rt::Task<Result<std::string>> other_programs(BootTarget& target,
                                                                     const manager::SlaveRules& rules);
  /// Step 6: stop, clear, download, start. Errc::unsupported: there is no program.
  [[nodiscard]] virtual rt::Task<Result<void>> update(BootTarget& target, const manager::SlaveRules& rules);
};

struct BootOptions {
  /// How long a silent slave is asked. For mandatory ones: the boot time (1F89h) from the beginning of the network's
  /// boot-up. Default: for ever, as in CiA 302-2 for optional slaves.
  rt::Time give_up = rt::never;
  /// Its identity was read since its last boot-up, and is the expected one: skip step 3.
  bool identified = false;
  /// In addition, it has answered the upload of 1000h since its last boot-up: step 2 reads it only if a device type is
  /// expected.
  bool typed = false;
  /// It may be running under a former master: step 4 is done as for a keep-alive slave, but a slave that reports no
  /// state is reset too.
  bool may_run = false;
  rt::Duration pause = std::chrono::seconds(1);         ///< before a silent slave is asked again
  rt::Duration boot_timeout = std::chrono::seconds(1);  ///< from reset communication to the boot-up message
};

struct BootResult {
  manager::BootStatus status = manager::BootStatus::booted;
  std::string detail = {};  ///< "vendor-ID 0000_0009h instead of 0000_0001h"; empty without details
  bool updated = false;
  bool configured = false;

  /// "D: its vendor-ID (1018h:01) is not the expected one (1F85h): 00000009h instead of 00000001h".
  [[nodiscard]] std::string text() const;
};

class BootSlave {
 public:
  /// `target` and `source` must stay until `run` is done.
  BootSlave(rt::Executor& executor, BootTarget& target, BootSource& source, const manager::SlaveRules& rules,
            const BootOptions& options) noexcept
      : executor_(&executor), target_(&target), source_(&source), rules_(rules), options_(options) {}

  [[nodiscard]] rt::Task<BootResult> run();
  /// True if it has answered the upload of 1000h.
  [[nodiscard]] bool found() const noexcept { return found_; }

 private:
  struct Expected {
    std::uint8_t sub;
    std::uint32_t value;
    manager::BootStatus status;
  };
  using Verdict = std::optional<manager::BootStatus>;  // empty: continue

  rt::Task<Verdict> check_identity();
  rt::Task<Result<std::uint32_t>> device_type();
  [[nodiscard]] bool asks_on() const noexcept;
  rt::Task<bool> is_as(Expected expected);
  rt::Task<Verdict> check_hardware();
  rt::Task<Verdict> check_state();
  enum class Software : std::uint8_t { right, other, untold };
  rt::Task<Verdict> check_software(bool& begin_again);
  rt::Task<Software> compare_software();
  rt::Task<Software> compare_software_date();
  rt::Task<Software> compare_programs();
  rt::Task<Verdict> run_program(bool& begin_again);
  rt::Task<Software> compare_text(std::uint16_t index, const std::string& expected);
  rt::Task<Verdict> configure();
  rt::Task<bool> has_expected_date();
  rt::Task<Verdict> start_error_control();
  rt::Task<manager::BootStatus> steps();
  void differs(std::uint32_t is, std::uint32_t expected);

  rt::Executor* executor_;
  BootTarget* target_;
  BootSource* source_;
  manager::SlaveRules rules_;
  BootOptions options_;
  BootResult result_;
  bool found_ = false;
  bool ran_ = false;  // its stopped program has been started
};

}  // namespace berth::network
