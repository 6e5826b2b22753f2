/// A roll-out: one file for the same slot of several machines, in waves: the next machines get it when all of those
/// before have ended (docs/fleet.md §Roll-out). It decides; its owner sends, and keeps the journal. Pure.
///
///     RollOut roll_out(options, machines);
///     while (!roll_out.over()) {
///       for (const auto& id : roll_out.turn(see, now)) roll_out.sent(id, now, send(id));
///     }
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "berth/sparkplug/fleet.hpp"

namespace berth::fleet {

/// How a command of a host ended, as its machine reports it (commands.hpp).
struct CommandEnd {
  std::uint64_t time_ms = 0;  ///< by the machine's clock
  std::string value{};        ///< in words
  std::string answer{};
  friend bool operator==(const CommandEnd&, const CommandEnd&) = default;
};

/// What is known of one machine.
struct RollOutView {
  bool known = false;  ///< something was heard of it
  bool online = false;
  bool has_slot = false;
  bool device_there = false;  ///< the slot's device was born
  bool allows = false;        ///< its machine file: the device has the command
  std::string state{};        ///< of the slot
  std::string reason{};
  std::optional<CommandEnd> done{};  ///< the last command that was carried out, if it was this one for this slot
  std::optional<CommandEnd> refused{};
};
/// `command`: `configure_metric` or `program_metric`.
[[nodiscard]] RollOutView see(const sparkplug::Fleet& fleet, const sparkplug::EdgeNodeId& machine,
                              const std::string& slot, const std::string& command);

/// Why a machine cannot get it now; empty: it can. `command`: as machine files allow it, "configure".
[[nodiscard]] std::string obstacle(const RollOutView& view, const std::string& slot, const std::string& command);

class RollOut {
 public:
  using Time = std::chrono::milliseconds;
  struct Options {
    std::string slot{};
    std::string command{};    ///< as machine files allow it
    std::string value{};      ///< of the command, in words
    std::size_t at_most = 1;  ///< machines of a wave
    bool stop_on_failure = false;
    Time patience{300'000};  ///< from sending until the slot is operational
    Time steady{3'000};      ///< so long it must stay so
  };
  enum class Stage : std::uint8_t { waiting, sent, carried_out, done, failed };
  struct Row {
    sparkplug::EdgeNodeId machine{};
    Stage stage = Stage::waiting;
    std::string words{};               ///< failed: why
    Time since{};                      ///< when it was sent, or carried out
    std::optional<CommandEnd> done{};  ///< as they were before
    std::optional<CommandEnd> refused{};
    std::optional<Time> good{};  ///< since when the slot is operational
  };

  RollOut(Options options, std::vector<sparkplug::EdgeNodeId> machines);

  using See = std::function<RollOutView(const sparkplug::EdgeNodeId&)>;
  /// Call it ten times a second. Returns the machines that get it now: `sent` follows for each.
  [[nodiscard]] std::vector<sparkplug::EdgeNodeId> turn(const See& see, Time now);
  /// `problem`: why it was not sent; empty: it was.
  void sent(const sparkplug::EdgeNodeId& machine, Time now, const std::string& problem);
  /// No machine is begun any more; those that were sent to are awaited.
  void stop() noexcept { stopped_ = true; }

  [[nodiscard]] const std::vector<Row>& rows() const noexcept { return rows_; }
  [[nodiscard]] bool over() const noexcept;

 private:
  void look(Row& row, const RollOutView& view, Time now);
  void settle(Row& row, const RollOutView& view, Time now);
  void fail(Row& row, std::string why);

  Options options_;
  std::vector<Row> rows_;
  bool stopped_ = false;
};

}  // namespace berth::fleet
