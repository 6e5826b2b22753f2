/// The configuration manager (CiA 302-3; docs/protocols/cia302.md §Boot-up of a slave, steps 7 and 8, §Configuration):
/// one device, from "is it right?" to "saved and dated". Everything goes through `co::SdoAccess`, so that the device
/// may be anywhere.
///
///     Configurator configurator(values, saving, wanted, options);
///     ConfigurationReport report;
///     co_await configurator.run(report);
///     if (!report.good()) ... describe(*report.failure, wanted.file)
///
/// What it does, in this order:
///   1. 1020h equals the expected date: nothing is to be done (but `Entry::own` values are looked at)
///   2. every value is read; what may not be written and differs is a failure
///   3. the date is made 0, so that a half-done configuration never carries a valid one
///   4. what differs is written, in the order of `plan`
///   5. 1020h gets the expected date
///   6. everything written is read again, and must be there
///   7. 1010h:01 saves it, date and all; then 1020h is read once more: a device that restarted meanwhile shows here
/// Steps 3 to 7 are left out when nothing differs and the date agrees; a device without 1020h is compared at every
/// start (S5.19 when it has no 1010h either: then it is configured at every start).
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

/// What it is doing. The names stand in events.
enum class Stage : std::uint8_t { dating, comparing, writing, reading_back, saving };
[[nodiscard]] const char* name(Stage stage) noexcept;

/// Why a configuration stopped.
struct Failure {
  enum class Why : std::uint8_t {
    error,        ///< `error` says it: no answer, refused by an abort code, the port
    differs,      ///< it may not be written, and the device has `held`
    not_kept,     ///< written without an error, and the device has `held` all the same
    restarted,    ///< the device booted meanwhile: what was written is gone, or may be
    not_allowed,  ///< `before_change` said no
    not_saved,    ///< 1010h was not answered, and the device does not say afterwards that it has the configuration
  };
  Why why = Why::error;
  Stage stage = Stage::comparing;
  ObjectRef object;
  std::string name;
  std::uint32_t line = 0;
  bool own = false;  ///< the value is not of the file
  od::DataType type = od::DataType::none;
  std::vector<std::uint8_t> wanted;
  std::vector<std::uint8_t> held;
  Error error;

  /// Worth another try as it is: the device was silent, busy, or restarted, or a transfer was spoilt. Else only a
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
  bool own = false;                               ///< not of the file
};
/// "6110h:01 \"Limit\": 3 instead of 5 (pump.dcf:34)".
[[nodiscard]] std::string describe(const Difference& difference, const std::string& file);

enum class Saved : std::uint8_t {
  no_need,     ///< nothing changed
  saved,       ///< 1010h:01 answered
  by_itself,   ///< the device saves without a command (1010h bit 1)
  cannot,      ///< no 1010h, or it says that it does not save: to be configured at every start
  unanswered,  ///< no answer in time; the device has the configuration, but perhaps not for the next power-on
};

struct ConfigurationReport {
  bool by_date = false;      ///< 1020h agreed: the file's values were not read
  bool has_date = false;     ///< the device has 1020h and keeps what is written there
  std::size_t compared = 0;  ///< values read
  std::vector<Difference> differences;
  std::size_t refused = 0;  ///< values that `ConfiguratorOptions::refused` was told
  std::size_t written = 0;  ///< downloads, without date and saving
  bool dated = false;       ///< 1020h was written
  Saved saved = Saved::no_need;
  std::optional<Failure> failure;

  [[nodiscard]] bool good() const noexcept { return !failure.has_value(); }
  /// Something was brought into the device.
  [[nodiscard]] bool changed() const noexcept { return written > 0 || dated; }
};
/// "as pump.dcf has it" or "7 of 43 values written, dated, saved": one clause for people.
[[nodiscard]] std::string summary(const ConfigurationReport& report, const std::string& file);

struct Progress {
  Stage stage = Stage::comparing;
  std::size_t done = 0;
  std::size_t total = 0;
};

struct ConfiguratorOptions {
  bool write = true;         ///< false: only compare
  bool trust_date = true;    ///< false: compare everything even when 1020h agrees
  bool save_anyway = false;  ///< an earlier saving is not known to have been done: save even when nothing differs
  unsigned tries = 3;        ///< a device that says that it is not ready (0800 0021, 0800 0022) is asked so often
  rt::Duration pause = std::chrono::milliseconds(200);  ///< between these tries
  /// The answer to the saving came after its time-out. A device that is late is waited for, in silence, `asks` times
  /// `ask_pause`; only then it is asked. May be empty: then it is asked at once.
  std::function<bool()> answered_late;
  unsigned asks = 10;  ///< how often a device that did not answer the saving is asked whether it is there
  rt::Duration ask_pause = std::chrono::seconds(1);  ///< before each of these
  /// Called once, before the first thing in the device is changed; false: it shall not be. May be empty.
  std::function<bool()> before_change;
  std::function<bool()> restarted;                ///< true: the device has booted since `run` began; may be empty
  std::function<void(const Progress&)> progress;  ///< at the beginning of each stage; may be empty
  /// A value that the device refuses, cannot hold or does not keep is told here, the others are brought in all the
  /// same, and 1020h stays 0; empty: the first one is the end.
  std::function<void(const Failure&)> refused;
  bool each_value = false;  ///< `progress` also after each value that was read or written
};

class Configurator {
 public:
  /// All must stay until `run` is done. `values`: patient as usual. `saving`: with the time-out of a saving (seconds)
  /// and without retries; the same object may stand for both.
  Configurator(co::SdoAccess& values, co::SdoAccess& saving, const Wanted& wanted, const ConfiguratorOptions& options)
      : values_(&values), saving_(&saving), wanted_(&wanted), options_(&options) {}

  [[nodiscard]] rt::Task<void> run(ConfigurationReport& report);

  /// Does 1020h agree? False also when the device has none or does not answer.
  [[nodiscard]] rt::Task<bool> has_date();
  /// Makes 1020h 0, 0: the configuration is saved and not yet in use. A device without 1020h: nothing happens.
  [[nodiscard]] rt::Task<void> take_date();

 private:
  struct DateRead;
  rt::Task<void> read_date(DateRead& into);
  /// `wanted`: bytes that it is to hold.
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

/// Do these bytes of a device mean the wanted value? Strings may be padded with NULs; four bytes of an expedited answer
/// without a size may hold a shorter number.
[[nodiscard]] bool same_value(od::DataType type, std::span<const std::uint8_t> held,
                              std::span<const std::uint8_t> wanted) noexcept;

}  // namespace berth::manager
