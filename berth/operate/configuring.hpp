/// Configuration before start (CiA 302-2 boot slave, steps 7 and 8; CiA 302-3): what `config =` wants is written into
/// the device, saved and dated; only then is the device started. A failure stops only that device.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include "berth/manager/configuration_upload.hpp"
#include "berth/manager/configurator.hpp"
#include "berth/operate/slot_table.hpp"

namespace berth::operate {

/// The text for a configuration that failed because the device restarted so many times: `cause`, and what to do.
[[nodiscard]] std::string restarted_each_time(const std::string& cause, unsigned times);
/// Whether this boot-up was a restart caused by a write of the configuration that had no answer. Counts such restarts
/// in a row; 0: it was not.
[[nodiscard]] unsigned restarts_by_configuration(SeatConfiguration& configuration, rt::Time booted,
                                                 rt::Duration within);
constexpr unsigned most_restarts = 3;  ///< after so many, it is configured again only when it boots by itself

/// What `berth configure` did, or found, in one slot.
struct SlotConfiguration {
  std::string bus;
  std::string slot;
  NodeId id;
  std::string file;
  std::string problem;  ///< why it was not even compared; empty: see `report`
  manager::ConfigurationReport report;
  places::SlotState state = places::SlotState::unknown;
  std::string reason;
};

/// What `berth upload` read in one slot.
struct SlotUpload {
  std::string bus;
  std::string slot;
  NodeId id;
  std::string file;     ///< of `config =`, without its folder; empty: there is none
  std::string problem;  ///< why nothing was read; empty: see the others
  manager::UploadedConfiguration uploaded;
  std::vector<manager::Difference> changes;  ///< how the device differs from what its slot wanted until then
};

/// Paths of the descriptions of slots' devices, by the slots' names.
using SlotDescriptions = std::map<std::string, std::string, std::less<>>;

/// Checks which device is under a slot's node-ID.
class SeatAsker {
 public:
  virtual rt::Task<void> ask_seat(Seat& seat) = 0;

 protected:
  ~SeatAsker() = default;
};

class Configuring {
 public:
  Configuring(BusServices& services, SlotTable& slots) noexcept : s_(services), slots_(slots) {}
  /// Call it before the first `configure`. `asker` must outlive this.
  void set_asker(SeatAsker& asker) noexcept { asker_ = &asker; }

  /// Reads the files of `config =`, or what SDO clients wrote instead. Several slots may share one file. `more`
  /// overrides them.
  void load(const manager::SlotSettings& more = {}, const SlotDescriptions& descriptions = {},
            WrittenFiles written = {});
  /// The same for one slot.
  void load(Seat& seat);
  /// Sets what the slot wants from now on; links override it. `path`: its file; empty: it is in none.
  void begin_with(Seat& seat, manager::Configuration configuration, const std::string& path);
  [[nodiscard]] const WrittenFiles& written() const noexcept { return written_; }
  /// What overrides the slot's file; null: nothing.
  [[nodiscard]] const manager::Configuration* linked(const Seat& seat) const;
  /// True: the device uses its configuration and may be started. Else the slot's state gives the reason.
  rt::Task<bool> configure(Seat& seat, manager::ConfigurationReport& report);
  /// Leaves a running device alone, but reports a different configuration.
  rt::Task<void> look_at_running(Seat& seat);
  /// `berth configure`: compares, and with `write` corrects differences; a running device is only compared.
  rt::Task<void> compare(Seat& seat, bool write, SlotConfiguration& into);
  /// `berth upload`: the device's present configuration becomes what the slot wants, until Berth ends.
  rt::Task<void> upload(Seat& seat, SlotUpload& into);
  /// The file's values and the heartbeat time of the machine file, because this network watches that heartbeat. Errors:
  /// the device did not answer, or the file's values cannot be computed for this node-ID.
  rt::Task<Result<manager::Wanted>> wanted_of(Seat& seat);
  /// A boot-up message came after the device was last checked: earlier results are no longer valid.
  [[nodiscard]] bool rebooted(const Seat& seat) const noexcept;

 private:
  struct Attempt;
  rt::Task<void> upload_from(Seat& seat, SlotUpload& into);
  rt::Task<std::string> belongs_elsewhere(Seat& seat);
  void take(Seat& seat, const std::string& dcf, SlotUpload& into);
  void add_links(Seat& seat);
  enum class Next : std::uint8_t { done, again, not_now };
  [[nodiscard]] bool may_be_configured(Seat& seat);
  rt::Task<Next> try_once(Seat& seat, Attempt& attempt);
  rt::Task<Next> take_into_use(Seat& seat, Attempt& attempt);
  rt::Task<bool> configure_once(Seat& seat, Attempt& attempt);
  rt::Task<bool> waits_for_power(Seat& seat, manager::Configurator& configurator, const manager::Wanted& wanted);
  rt::Task<void> wait_for_power(Seat& seat, manager::Configurator& configurator, const manager::Wanted& wanted,
                                const std::string& reason);
  /// `identified`: when it was asked who it is.
  rt::Task<bool> reset_and_wait(Seat& seat, rt::Time& identified);
  void forgot(Seat& seat, const manager::ConfigurationReport& report, const manager::Wanted& wanted);
  bool note(Seat& seat, places::Configured::Stage stage, const manager::Wanted& wanted);

  BusServices& s_;
  SlotTable& slots_;
  SeatAsker* asker_ = nullptr;
  manager::SlotSettings linked_;
  WrittenFiles written_;
};

}  // namespace berth::operate
