/// The gate before a real port: no frame passes that is not allowed, whatever the code above does.
///
///     live::Gate gate(executor, port, {.role = live::Role::master, .watch = {.own = NodeId(127)}});
///     gate.on_change([&] { ... });          // opened; another master; the port went down and came back
///     Network network(executor, gate, ...);  // a can::Port like any other
///
/// Before the first frame, and after each time the port was down, it listens for `GateOptions::listen`. While it
/// listens, and permanently after it heard another master (`foreign_watch.hpp`), `send` returns `Queued::listen_only`.
/// A master that appears later shuts it with its first frame that is a sign: queued frames are taken back, and the
/// frame being sent is the last. The gate does not open again by itself: two masters that both give way would
/// alternate.
///
/// It enforces roles frame by frame: a commissioner never sends NMT start, NMT reset or SYNC, and another master does
/// not shut its gate; an observer never sends a frame.
///
/// Another SDO client is not a master. If one asks a node after the gate has opened, this master goes on, but sends no
/// SDO request to that node until the client has been silent for `OtherClients::pause`: both use one channel, and each
/// would take the other's answers for its own. Requests to Berth's own node-ID come from its clients.
///
/// Own frames are recognised by their confirmations, so other processes of this machine must send through the process
/// that owns the port.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "berth/can/port.hpp"
#include "berth/live/foreign_watch.hpp"
#include "berth/live/other_clients.hpp"
#include "berth/live/role.hpp"

namespace berth::live {

struct GateOptions {
  Role role = Role::master;
  rt::Duration listen = std::chrono::seconds(2);  ///< before the first frame; 0 = do not listen
  WatchOptions watch{};
  std::vector<NodeId> slots{};  ///< devices of this machine, which cannot be the other master
  /// Sends nothing: `on_held` gets the frames instead. They are confirmed to waiting services, except frames that a
  /// device would answer: what follows is unknown, and the service waits.
  bool dry_run = false;
};

enum class GateState : std::uint8_t {
  down,       ///< the port is down: cable, interface, server
  listening,  ///< before the first frame
  open,
  foreign,   ///< another master is there: shut until `listen_again`
  observing  ///< always, for an observer
};
[[nodiscard]] const char* name(GateState state) noexcept;

/// A frame that a service answers: an SDO request, an LSS request with an answer, a discovery request. Heartbeats, NMT
/// commands, SYNC, LSS switch and configure-activate have no answer.
[[nodiscard]] bool expects_answer(const can::Frame& frame) noexcept;
/// A commissioner may send everything except NMT start, NMT resets, SYNC. A reader: SDO upload requests.
[[nodiscard]] bool allowed(Role role, const can::Frame& frame) noexcept;

class Gate final : public can::Port, private can::Listener {
 public:
  /// A port that goes down this soon after `restart` is still starting: no cable was pulled.
  static constexpr rt::Duration restart_time = std::chrono::seconds(3);
  static constexpr std::size_t most_pending = 512;  ///< frames given and not confirmed; then `Queued::full`

  /// `inner` must outlive it, be used by this gate only, and hear everything. If the bus is up, the gate listens from
  /// now on.
  Gate(rt::Executor& executor, can::Port& inner, GateOptions options);
  ~Gate() override;
  Gate(const Gate&) = delete;
  Gate& operator=(const Gate&) = delete;

  [[nodiscard]] GateState state() const noexcept { return state_; }
  /// It no longer listens: it is open, shut by another master, or observing.
  [[nodiscard]] bool decided() const noexcept { return state_ != GateState::listening && state_ != GateState::down; }
  [[nodiscard]] const ForeignWatch& watch() const noexcept { return watch_; }
  /// Frames blocked because of the role.
  [[nodiscard]] std::uint32_t refused() const noexcept { return refused_; }
  /// The message to the user about the other master: the verdict, then one line for each sign; empty if there is none.
  [[nodiscard]] std::vector<std::string> report() const;
  /// The user says that the other master is gone: listens again.
  void listen_again() noexcept;

  /// The state changed. Called from the executor; must not destroy the gate.
  void on_change(std::function<void()> handler) { on_change_ = std::move(handler); }
  /// Other SDO clients since a master's gate opened, and the nodes that are left to them (`Queued::full`).
  [[nodiscard]] OtherClients& clients() noexcept { return clients_; }
  /// Dry run: a frame that would have been sent.
  void on_held(std::function<void(const can::Frame&, rt::Time)> handler) { on_held_ = std::move(handler); }
  /// Every frame on the bus, own ones when confirmed; and every error that the port reports.
  void on_frame(std::function<void(const can::Frame&, rt::Time, bool own)> handler,
                std::function<void(const can::Frame& report, rt::Time)> on_error = {}) {
    on_frame_ = std::move(handler);
    on_error_ = std::move(on_error);
  }

  // can::Port. `status` is the inner port's, and `listen_only` while nothing may be sent.
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override;
  void withdraw(std::uint32_t tag) noexcept override;
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override;
  [[nodiscard]] can::Status status() const noexcept override;
  bool restart(std::uint32_t bit_rate) noexcept override;

 private:
  struct Pending {
    std::uint32_t inner;
    std::uint32_t outer;
    can::Frame frame;
  };
  class Listening final : public rt::Job {
   public:
    explicit Listening(Gate& gate) noexcept : gate_(gate) {}
    void run() noexcept override { gate_.heard_enough(); }

   private:
    Gate& gate_;
  };
  class Rechecking final : public rt::Job {
   public:
    explicit Rechecking(Gate& gate) noexcept : gate_(gate) {}
    void run() noexcept override { gate_.changed(gate_.inner_->status(), gate_.executor_->now()); }

   private:
    Gate& gate_;
  };
  class Confirming final : public rt::Job {
   public:
    explicit Confirming(Gate& gate) noexcept : gate_(gate) {}
    void run() noexcept override { gate_.confirm_held(); }

   private:
    Gate& gate_;
  };
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void sent(std::uint32_t tag, rt::Time at) noexcept override;
  void changed(const can::Status& status, rt::Time at) noexcept override;
  void error(const can::Frame& report, rt::Time at) noexcept override {
    if (on_error_) on_error_(report, at);
  }
  void begin_listening() noexcept;
  void heard_enough() noexcept;
  void confirm_held() noexcept;
  can::Queued hold(const can::Frame& frame, std::uint32_t tag) noexcept;
  void shut() noexcept;
  void become(GateState state) noexcept;

  rt::Executor* executor_;
  can::Port* inner_;
  GateOptions options_;
  ForeignWatch watch_;
  GateState state_ = GateState::down;
  std::uint32_t refused_ = 0;
  std::uint32_t next_tag_ = 0;
  std::vector<Pending> pending_;
  std::vector<std::uint32_t> held_;  // tags of held frames that will be confirmed
  can::Listener* listener_ = nullptr;
  std::vector<can::IdRange> accept_;
  OtherClients clients_;
  std::function<void()> on_change_;
  std::function<void(const can::Frame&, rt::Time)> on_held_;
  std::function<void(const can::Frame&, rt::Time, bool)> on_frame_;
  std::function<void(const can::Frame&, rt::Time)> on_error_;
  Listening listening_{*this};
  Confirming confirming_{*this};
  Rechecking rechecking_{*this};  // waits while the controller restarts
};

}  // namespace berth::live
