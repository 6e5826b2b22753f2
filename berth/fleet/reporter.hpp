/// The executor's side of an edge node: looks ten times a second what changed of slots, buses and chosen values, hands
/// that over, and has the hosts' commands carried out. It never waits: what the queue has no room for stays here and is
/// handed over later, with the newest value. Nothing is sent on a bus because of it, except by `poll = true` and by
/// commands. Internal to room `fleet`.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "berth/command/reply.hpp"
#include "berth/fleet/clock.hpp"
#include "berth/fleet/facts.hpp"
#include "berth/fleet/link_parts.hpp"
#include "berth/fleet/signals.hpp"
#include "berth/fleet/told.hpp"
#include "berth/rt/later.hpp"
#include "berth/rt/scope.hpp"
#include "berth/tree/session.hpp"

namespace berth::fleet {

/// Carries one request out, as in `command::ControlServer`: both outlive the task.
using Carry = std::function<rt::Task<void>(const command::Request& request, command::Reply& reply)>;

class Reporter {
 public:
  static constexpr rt::Duration period = std::chrono::milliseconds(100);
  static constexpr rt::Duration slow_period = std::chrono::seconds(1);      ///< slots, if no event came
  static constexpr rt::Duration figures_period = std::chrono::seconds(10);  ///< load and counters of a bus
  static constexpr std::size_t most_requests = 8;                           ///< under way at once
  /// Commands and refusals of hosts: so many at once, then one a second. Each is a line in the audit log.
  static constexpr unsigned burst = 20;

  struct Options {
    std::string version{};  ///< of Berth
    std::string who{};      ///< in the audit log: "mqtt, broker:8883"
    design::BusCommands allowed{};
  };
  /// All must outlive it. `wake`: news were put.
  Reporter(tree::Session& session, std::vector<Signal> signals, Carry carry, Link& link, const Clock& clock,
           Options options, std::function<void()> wake);
  ~Reporter();
  Reporter(const Reporter&) = delete;
  Reporter& operator=(const Reporter&) = delete;

  /// To be called by `Session::on_event`: a slot may have changed.
  void event() noexcept { look_ = true; }
  /// A frame of a bus, by its index in `Machine::buses`. No heap, no lock, no clock.
  void frame(std::size_t bus, const can::Frame& frame, rt::Time at) noexcept { table_.frame(bus, frame, at); }
  /// Hands over what changed until now.
  void look_now();

 private:
  struct Work;
  void tick() noexcept;
  void finish() noexcept;
  void tell_node();
  void tell_slots();
  bool tell_slot(std::size_t index, const operate::SlotReport& now);
  bool tell_birth(std::size_t index, const Facts& facts);
  bool tell_facts(const std::string& device, const Facts& now, Facts& told);
  void tell_buses();
  void tell_signals();
  bool tell_signal(std::size_t index);
  [[nodiscard]] sparkplug::Quality quality_of(std::size_t index) const;
  [[nodiscard]] sparkplug::Value value_of(std::size_t index) const;
  [[nodiscard]] std::vector<sparkplug::OwnMetric> signal_metrics(std::size_t slot);
  void note_told(std::size_t signal);
  /// By the machine's slots; null: none.
  [[nodiscard]] ToldSlot* slot_of(const operate::SlotReport& slot);
  [[nodiscard]] Facts node_facts();
  [[nodiscard]] BusFigures figures_of(std::size_t bus);
  [[nodiscard]] sparkplug::Utc utc_of(rt::Time at) const;
  bool put(News news);

  void take_orders();
  void begin(sparkplug::Command command);
  void refuse(const sparkplug::Command& command, const std::string& why);
  void end(const char* metric, const sparkplug::Command& command, const std::string& answer);
  [[nodiscard]] bool may_go_on();
  void say(operate::EventKind kind, const std::string& words);

  [[nodiscard]] rt::Task<void> poll();
  [[nodiscard]] rt::Task<void> poll_one(std::size_t index);

  tree::Session* session_;
  std::vector<Signal> signals_;
  SignalTable table_;
  Carry carry_;
  Link* link_;
  const Clock* clock_;
  Options options_;
  std::function<void()> wake_;
  std::vector<ToldSlot> slots_;  // as the machine's
  std::vector<ToldValue> told_;  // by signal
  Facts told_node_;              // "Machine/...", "Buses/..."
  std::vector<double> loads_;    // by bus, of the last interval
  std::vector<std::unique_ptr<Work>> works_;
  bool node_told_ = false;
  bool look_ = true;
  bool put_ = false;  // since the last wake
  rt::Time looked_{};
  rt::Time figures_at_{};
  unsigned left_ = burst;
  rt::Time refilled_{};
  std::uint64_t left_out_ = 0;
  command::Request polled_request_;
  command::Reply polled_;
  rt::Later<Reporter, &Reporter::tick> tick_;
  rt::Later<Reporter, &Reporter::finish> done_;
  rt::Scope scope_;  // last: its task uses the rest
};

}  // namespace berth::fleet
