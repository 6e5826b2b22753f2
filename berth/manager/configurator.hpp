/// The configuration manager (CiA 302-3; docs/protocols/cia302.md §Boot-up of a slave, steps 7 and 8,
/// §Configuration): compares, writes, saves and dates one device. All access is by `co::SdoAccess`, so that the device
/// may be anywhere.
///
///     Configurator configurator(values, saving, wanted, options);
///     ConfigurationReport report;
///     co_await configurator.run(report);
///     if (!report.good()) ... describe(*report.failure, wanted.file)
///
/// What it does, in this order:
///   1. 1020h equals the expected date: nothing to do (but `Entry::own` values are compared)
///   2. every value is read; a difference in a value that may not be written is a failure
///   3. the date is set to 0, so that a partial configuration never has a valid date
///   4. different values are written, in the order of `plan`
///   5. 1020h gets the expected date
///   6. everything written is read again and compared
///   7. 1010h:01 saves it, date included; then 1020h is read once more, which reveals a restart meanwhile
/// Steps 3 to 7 are omitted if nothing differs and the date agrees. A device without 1020h is compared at every start;
/// one without 1010h either is configured at every start (S5.19).
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/co/sdo_access.hpp"
#include "berth/manager/configuration.hpp"
#include "berth/manager/configuration_plan.hpp"
#include "berth/rt/task.hpp"

namespace berth::manager {

/// The present stage. The names are used in events.
enum class Stage : std::uint8_t { dating, comparing, writing, reading_back, saving };
[[nodiscard]] const char* name(Stage stage) noexcept;

/// Why a configuration stopped.
struct Failure {
  enum class Why : std::uint8_t {
    error,        ///< see `error`: no answer, refused by an abort code, the port
    differs,      ///< it may not be written, and the device has `held`
    not_kept,     ///< written without an error, but the device still has `held`
    restarted,    ///< the device booted meanwhile: the written values are lost, or may be
    not_allowed,  ///< `before_change` returned false
    not_saved,    ///< 1010h got no answer, and the device does not confirm the configuration afterwards
  };
  Why why = Why::error;
  Stage stage = Stage::comparing;
  ObjectRef object;
  std::string name;
  std::uint32_t line = 0;
  bool own = false;  ///< the value is not from the file
  od::DataType type = od::DataType::none;
  std::vector<std::uint8_t> wanted;
  std::vector<std::uint8_t> held;
  Error error;

  /// Another try may succeed: the device was silent, busy, or restarted, or a transfer was disturbed. Else only a
  /// change of the file or of the device helps.
  [[nodiscard]] bool passing() const noexcept;
};
/// "writing 6110h:01 \"Limit\" = 5 (pump.dcf:34): the device refused it: value too high (0609 0031h)".
[[nodiscard]] std::string describe(const Failure& failure, const std::string& file);

struct Difference {
  ObjectRef object;
  std::string name;
  std::uint32_t line = 0;
  od::DataType type = od::DataType::none;
  std::vector<std::uint8_t> wanted;
  std::optional<std::vector<std::uint8_t>> held;  ///< empty: it cannot be read
  bool own = false;                               ///< not from the file
};
/// "6110h:01 \"Limit\": 3 instead of 5 (pump.dcf:34)".
[[nodiscard]] std::string describe(const Difference& difference, const std::string& file);

enum class Saved : std::uint8_t {
  no_need,     ///< nothing changed
  saved,       ///< 1010h:01 answered
  by_itself,   ///< the device saves without a command (1010h bit 1)
  cannot,      ///< no 1010h, or it reports that it does not save: configured at every start
  unanswered,  ///< no answer in time; the device has the configuration, but perhaps not for the next power-on
};

struct ConfigurationReport {
  bool by_date = false;      ///< 1020h agreed: the file's values were not read
  bool has_date = false;     ///< the device has 1020h and keeps its value
  std::size_t compared = 0;  ///< values read
  std::vector<Difference> differences;
  std::size_t refused = 0;  ///< values reported to `ConfiguratorOptions::refused`
  std::size_t written = 0;  ///< downloads, without date and saving
  bool dated = false;       ///< 1020h was written
  Saved saved = Saved::no_need;
  std::optional<Failure> failure;

  [[nodiscard]] bool good() const noexcept { return !failure.has_value(); }
  /// Something in the device was changed.
  [[nodiscard]] bool changed() const noexcept { return written > 0 || dated; }
};
/// "as pump.dcf has it" or "7 of 43 values written, dated, saved": one clause for users.
[[nodiscard]] std::string summary(const ConfigurationReport& report, const std::string& file);

struct Progress {
  Stage stage = Stage::comparing;
  std::size_t done = 0;
  std::size_t total = 0;
};

struct ConfiguratorOptions {
  bool write = true;         ///< false: only compare
  bool trust_date = true;    ///< false: compare everything even when 1020h agrees
  bool save_anyway = false;  ///< save even if nothing differs: an earlier save was not confirmed
  unsigned tries = 3;        ///< how often a device that is not ready (0800 0021, 0800 0022) is asked
  rt::Duration pause = std::chrono::milliseconds(200);  ///< between these tries
  /// Whether the answer to the save came after its timeout. Berth first waits for a late device without asking, `asks`
  /// times `ask_pause`. May be empty: then it asks at once.
  std::function<bool()> answered_late;
  unsigned asks = 10;  ///< how often a device that did not answer the save is asked whether it is there
  rt::Duration ask_pause = std::chrono::seconds(1);  ///< before each such question
  /// Called once, before the first change of the device; false: no change is allowed. May be empty.
  std::function<bool()> before_change;
  std::function<bool()> restarted;                ///< true: the device booted since `run` began; may be empty
  std::function<void(const Progress&)> progress;  ///< at the beginning of each stage; may be empty
  /// Called for each value that the device refuses, cannot hold or does not keep: the others are still written, and
  /// 1020h stays 0. Empty: the first such value ends the run.
  std::function<void(const Failure&)> refused;
  bool each_value = false;  ///< also call `progress` after each value read or written
};

class Configurator {
 public:
  /// All must outlive `run`. `values`: with the usual timeouts. `saving`: with a timeout for saving (seconds) and
  /// without retries; the same object may serve for both.
  Configurator(co::SdoAccess& values, co::SdoAccess& saving, const Wanted& wanted, const ConfiguratorOptions& options)
      : values_(&values), saving_(&saving), wanted_(&wanted), options_(&options) {}

  [[nodiscard]] rt::Task<void> run(ConfigurationReport& report);

  /// Whether 1020h agrees. False also if the device has none or does not answer.
  [[nodiscard]] rt::Task<bool> has_date();
  /// Sets 1020h to 0, 0: the configuration is saved and not yet in use. No effect on a device without 1020h.
  [[nodiscard]] rt::Task<void> take_date();

 private:
  struct DateRead;
  rt::Task<void> read_date(DateRead& into);
  /// `wanted`: the number of bytes it should hold.
  rt::Task<Result<co::SdoValue>> read(ObjectRef object, std::size_t wanted = 0);
  rt::Task<Result<void>> write(ObjectRef object, std::span<const std::uint8_t> data);
  [[nodiscard]] bool may_change(ConfigurationReport& report) const;
  rt::Task<bool> own_agree(ConfigurationReport& report);
  rt::Task<bool> compare(ConfigurationReport& report);
  rt::Task<bool> read_entry(std::size_t index, ConfigurationReport& report);
  rt::Task<bool> make_right(ConfigurationReport& report, bool differs, bool needs_date, bool saves);
  rt::Task<void> read_needed();
  rt::Task<bool> download(ConfigurationReport& report);
  rt::Task<bool> put_date(ConfigurationReport& report);
  rt::Task<bool> read_back(ConfigurationReport& report);
  rt::Task<void> tell_a_restart(ConfigurationReport& report);
  rt::Task<bool> read_values_back(ConfigurationReport& report);
  rt::Task<bool> save(ConfigurationReport& report);
  rt::Task<bool> check_saved(ConfigurationReport& report);
  rt::Task<bool> ask_after_saving(ConfigurationReport& report, Error unanswered);
  [[nodiscard]] bool still_there(ConfigurationReport& report, Stage stage) const;
  void tell(Stage stage, std::size_t done, std::size_t total) const;
  void tell_value(Stage stage, std::size_t done, std::size_t total) const;
  void fail_at(ConfigurationReport& report, Stage stage, const Entry& entry, const Error& error) const;
  void fail_at(ConfigurationReport& report, Stage stage, ObjectRef object, const char* name, const Error& error) const;

  co::SdoAccess* values_;
  co::SdoAccess* saving_;
  const Wanted* wanted_;
  const ConfiguratorOptions* options_;
  Held held_;
  std::vector<bool> changes_;
  std::vector<bool> readable_;
};

/// Whether these bytes of a device equal the wanted value. Strings may be padded with NULs; four bytes of an expedited
/// answer without a size may hold a shorter number.
[[nodiscard]] bool same_value(od::DataType type, std::span<const std::uint8_t> held,
                              std::span<const std::uint8_t> wanted) noexcept;

}  // namespace berth::manager
