/// The executor's side of an edge node: looks ten times a second what changed of slots, buses and chosen values, and
/// hands that over. It never waits: what the queue has no room for stays here and is handed over later, with the newest
/// value. It sends nothing on a bus. Internal to room `fleet`.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "berth/fleet/clock.hpp"
#include "berth/fleet/link_parts.hpp"
#include "berth/fleet/signals.hpp"
#include "berth/fleet/told.hpp"
#include "berth/rt/later.hpp"
#include "berth/tree/session.hpp"

namespace berth::fleet {

class Reporter {
 public:
  static constexpr rt::Duration period = std::chrono::milliseconds(100);
  static constexpr rt::Duration slow_period = std::chrono::seconds(1);      ///< slots, if no event came
  static constexpr rt::Duration figures_period = std::chrono::seconds(10);  ///< load and counters of a bus

  struct Options {
    std::string version{};  ///< of Berth
    design::BusCommands allowed{};
  };
  /// All must outlive it. `wake`: news were put.
  Reporter(tree::Session& session, const std::vector<Signal>& signals, SignalTable& table, Link& link,
           const Clock& clock, Options options, std::function<void()> wake);
  Reporter(const Reporter&) = delete;
  Reporter& operator=(const Reporter&) = delete;

  /// To be called by `Session::on_event`: a slot may have changed.
  void event() noexcept { look_ = true; }
  /// Hands over what changed until now.
  void look_now();

 private:
  void tick() noexcept;
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

  tree::Session* session_;
  const std::vector<Signal>* signals_;
  SignalTable* table_;
  Link* link_;
  const Clock* clock_;
  Options options_;
  std::function<void()> wake_;
  std::vector<ToldSlot> slots_;  // as the machine's
  std::vector<ToldValue> told_;  // by signal
  Facts told_node_;              // "Machine/...", "Buses/..."
  std::vector<double> loads_;    // by bus, of the last interval
  bool node_told_ = false;
  bool look_ = true;
  bool put_ = false;  // since the last wake
  rt::Time looked_{};
  rt::Time figures_at_{};
  rt::Later<Reporter, &Reporter::tick> tick_;
};

}  // namespace berth::fleet
