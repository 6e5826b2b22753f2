/// The main job as one object: a machine, its store, and a network for each of its buses. `berth up`, `berth demo`, the
/// tests and every tool use only this.
#pragma once

#include <array>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "berth/design/machine.hpp"
#include "berth/operate/network.hpp"
#include "berth/operate/report.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/tree/channel_settings.hpp"
#include "berth/tree/gateway_settings.hpp"
#include "berth/tree/own_frames.hpp"
#include "berth/tree/tree.hpp"

namespace berth::tree {

class Session {
 public:
  /// `machine` and `store` must outlive this. During the session the lines of the store's history have the executor's
  /// time: a store may be in one session at a time.
  Session(rt::Executor& executor, const design::Machine& machine, places::SlotStore& store);
  ~Session();
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Gives one bus its port. Every bus needs one before `open`; the port must outlive this. Errors: `not_found` no such
  /// bus; `duplicate` it already has one.
  Result<void> connect(std::string_view bus, can::Port& port);
  /// Values for devices besides `config =`. Call before `open`.
  void configure_with(manager::SlotSettings settings) { settings_ = std::move(settings); }
  /// The slot has `config =`, or what was written instead, gets settings, or is a gateway.
  [[nodiscard]] bool configures(const design::Slot& slot) const;
  /// Reads the store. Call once, after the ports. Errors: `invalid` a bus without a port, or one
  /// beneath gateways whose topmost bus the machine lacks; the store's.
  Result<void> open();
  /// Begins the main job on every bus.
  void start();
  /// Stops it at once.
  void stop() noexcept;
  /// The main job runs; without it the session only serves single commands.
  [[nodiscard]] bool started() const noexcept { return started_; }

  /// These buses have real devices: a command that disturbs an operational one needs a user's confirmation.
  void set_careful(bool careful) noexcept { careful_ = careful; }
  [[nodiscard]] bool careful() const noexcept { return careful_; }
  /// An event of the guard of a bus's port, or of its plant: `step` or `error`.
  void tell(std::string_view bus, operate::EventKind kind, std::string text);

  /// Called for every event at once. `report` keeps the newest `most_events`, too.
  void on_event(std::function<void(const operate::Event&)> handler) { on_event_ = std::move(handler); }
  /// For commands that come by SDO (1023h of the master's device of that bus): `NetworkObserver::command`.
  using CommandHandler =
      std::function<bool(const std::string& bus, std::string text, operate::NetworkObserver::Confirm confirm)>;
  void on_command(CommandHandler handler) { on_command_ = std::move(handler); }
  /// Called when the last bus has reached it.
  void on_milestone(std::function<void(operate::Milestone)> handler) { on_milestone_ = std::move(handler); }
  static constexpr std::size_t most_events = 10'000;

  [[nodiscard]] operate::Report report() const;
  /// The final one: takes the session's events, which then has none. For thousands of devices a copy would take
  /// megabytes.
  [[nodiscard]] operate::Report take_report();
  [[nodiscard]] std::vector<operate::SlotReport> slots() const;
  [[nodiscard]] bool operational() const noexcept;
  /// All networks only watch.
  [[nodiscard]] bool idle() const noexcept;

  [[nodiscard]] const design::Machine& machine() const noexcept { return *machine_; }
  [[nodiscard]] places::SlotStore& store() noexcept;
  [[nodiscard]] rt::Executor& executor() noexcept { return *executor_; }
  /// Null: there is none. An empty name means the only bus; null if there are several.
  [[nodiscard]] operate::Network* network(std::string_view bus) noexcept;
  [[nodiscard]] const std::vector<std::unique_ptr<operate::Network>>& networks() const noexcept { return networks_; }
  /// The buses beneath gateways.
  [[nodiscard]] Tree& tree() noexcept { return tree_; }

  /// Frames that Berth itself sends, if the owner of the ports reports them.
  friend OwnFrames& own_frames(Session& session) noexcept { return session.own_frames_; }
  friend void keep_written(Session& session, operate::WrittenFiles::Place place) {
    session.written_ = std::move(place);
  }

 private:
  class Clock final : public places::StoreClock {
   public:
    explicit Clock(rt::Executor& executor) noexcept : executor_(&executor) {}
    [[nodiscard]] std::int64_t now_ms() const noexcept override {
      return std::chrono::duration_cast<std::chrono::milliseconds>(executor_->now().time_since_epoch()).count();
    }

   private:
    rt::Executor* executor_;
  };
  void record(const operate::Event& event);

  rt::Executor* executor_;
  const design::Machine* machine_;
  places::SlotStore* store_;
  Clock clock_;
  std::vector<std::pair<const design::Bus*, can::Port*>> ports_;
  manager::SlotSettings settings_;
  operate::WrittenFiles::Place written_;
  std::vector<std::unique_ptr<operate::Network>> networks_;
  Tree tree_;
  OwnFrames own_frames_;
  std::deque<operate::Event> events_;
  std::function<void(const operate::Event&)> on_event_;
  std::function<void(operate::Milestone)> on_milestone_;
  CommandHandler on_command_;
  std::array<std::size_t, operate::milestones> reached_{};  // buses
  rt::Time began_{};
  bool started_ = false;
  bool careful_ = false;
};

[[nodiscard]] OwnFrames& own_frames(Session& session) noexcept;
/// Where configurations that SDO clients write to the manager (1F20h, 1F22h) are stored. Call before `Session::open`;
/// without it they count until the session ends.
void keep_written(Session& session, operate::WrittenFiles::Place place);
/// The open questions of all buses.
[[nodiscard]] std::vector<operate::Event> questions_of(const Session& session);

}  // namespace berth::tree
