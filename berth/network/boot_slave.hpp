/// The boot-up of one slave (CiA 302-2, "boot slave"; docs/protocols/cia302.md §Boot-up of a slave): from "is it
/// there?" to "it may be started". One procedure, whatever the rules, the configuration and the program come from, and
/// wherever the slave is.
///
///     BootSlave boot(executor, target, source, rules, options);
///     const BootResult result = co_await boot.run();
///     if (!is_ready(result.status)) ... letter(result.status), result.detail
///
/// In this order; the letter is how it ends when the step fails:
///   1. assigned (A); not to be booted: step 9 at once
///   2. 1000h is read, again and again until `give_up` (B), and compared (C)
///   3. 1018h is read as far as it is expected (D, M, N, O), and the hardware version, 1009h and paper 3's 5F01h (N)
///   4. keep alive: its state is observed (E, F); operational: step 9, and the end is L; else reset communication. The
///      same, but for E and F, of a slave that a former master may have started (`BootOptions::may_run`)
///   5. expected software (G, H): 1F56h, else 1F52h, else 100Ah, and whether it runs (1F51h); 6. its update (I), after
///      which all begins at 2 again
///   7. expected configuration date, 8. configuration (J)
///   9. error control is started (K)
/// The start of the slave (step 10) is its network's (`NetworkStartup`): `SlaveBoots` sends that of one.
#pragma once

#include <optional>
#include <string>

#include "berth/co/nmt.hpp"
#include "berth/co/sdo_access.hpp"
#include "berth/manager/boot_rules.hpp"
#include "berth/rt/task.hpp"

namespace berth::network {

/// The slave as the master reaches it: on the master's bus, or beneath a gateway.
class BootTarget {
 public:
  virtual ~BootTarget() = default;
  [[nodiscard]] virtual co::SdoAccess& objects() noexcept = 0;
  /// When it was sent. Errc::bus: it never left.
  [[nodiscard]] virtual rt::Task<Result<rt::Time>> command(co::NmtCommand command) = 0;
  /// True: a boot-up message at or after `since`, before `deadline`.
  [[nodiscard]] virtual rt::Task<bool> boots(rt::Time since, rt::Time deadline) = 0;
  /// The state that a heartbeat tells that is heard within this time from now. A boot-up message is none.
  [[nodiscard]] virtual rt::Task<std::optional<NmtState>> heartbeat(rt::Duration within) = 0;
  /// The state in the answer to one remote frame.
  [[nodiscard]] virtual rt::Task<std::optional<NmtState>> guard() = 0;
  /// From now on the master hears when it is lost: by heartbeat when the rules have one, else by node guarding when
  /// they have a guard time, else not at all.
  virtual void supervise(const manager::SlaveRules& rules) = 0;
  /// Before its NMT start: it is operational already, by another's doing, and is not started.
  [[nodiscard]] virtual rt::Task<bool> runs();
  /// Its NMT start was sent.
  [[nodiscard]] virtual rt::Task<void> start_sent();
  /// The slave is told to restart by other means than NMT (1F51h): its next boot-up message is no error event.
  virtual void expect_boot_up() noexcept {}
};

/// What is brought into a slave. The base class has nothing.
class BootSource {
 public:
  virtual ~BootSource() = default;
  /// Before each boot-up: whether the slave is booted, and whether it is mandatory, may be other than it was.
  virtual void renew(manager::SlaveRules&) const noexcept {}
  /// Step 2, after each question to a slave that is not mandatory and does not answer. False: the application stops
  /// polling (paper 5, Figure 4). It is B then, and booted again after its boot-up message only.
  [[nodiscard]] virtual bool polls() const noexcept { return true; }
  /// Step 8: whatever it takes, factory settings and saving included. Where nothing is to be configured: done.
  /// `rules`: what is found here settles how it is supervised from step 9 on (a slave without 1017h is guarded).
  [[nodiscard]] virtual rt::Task<Result<void>> configure(BootTarget& target, manager::SlaveRules& rules);
  /// Step 5, of a slave with more than one program: is the rest as expected? Empty: yes; else what is not, for people.
  [[nodiscard]] virtual rt::Task<Result<std::string>> other_programs(BootTarget& target,
                                                                     const manager::SlaveRules& rules);
  /// Step 6: stop, clear, download, start. Errc::unsupported: there is no program.
  [[nodiscard]] virtual rt::Task<Result<void>> update(BootTarget& target, const manager::SlaveRules& rules);
};

struct BootOptions {
  /// A slave that does not answer is asked until then. Mandatory ones: the boot time (1F89h) from the begin of the
  /// network's boot-up. Default: for ever, as CiA 302-2 has it for optional slaves.
  rt::Time give_up = rt::never;
  /// Its identity was read since its last boot-up, and is the expected one: step 3 is done.
  bool identified = false;
  /// Beside that, it has answered the upload of 1000h since its last boot-up: step 2 asks for it only when a device
  /// type is expected.
  bool typed = false;
  /// It may be running under a former master: step 4 is done as for a keep-alive slave, but one that tells no state is
  /// reset too.
  bool may_run = false;
  rt::Duration pause = std::chrono::seconds(1);         ///< before a silent slave is asked again
  rt::Duration boot_timeout = std::chrono::seconds(1);  ///< from reset communication to the boot-up message
};

struct BootResult {
  manager::BootStatus status = manager::BootStatus::booted;
  std::string detail = {};  ///< "vendor-ID 0000_0009h instead of 0000_0001h"; empty when there is no more to say
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
  /// It has answered the upload of 1000h.
  [[nodiscard]] bool found() const noexcept { return found_; }

 private:
  struct Expected {
    std::uint8_t sub;
    std::uint32_t value;
    manager::BootStatus status;
  };
  using Verdict = std::optional<manager::BootStatus>;  // empty: go on

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
  bool ran_ = false;  // its stopped program was started
};

}  // namespace berth::network
