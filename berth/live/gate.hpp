/// The gate before a real port: whatever the code above does, no frame passes it that may not.
///
///     live::Gate gate(executor, port, {.role = live::Role::master, .watch = {.own = NodeId(127)}});
///     gate.on_change([&] { ... });          // opened; another master; the port went down and came back
///     Network network(executor, gate, ...);  // a can::Port like any other
///
/// It listens before the first frame, for `GateOptions::listen`, and again whenever the port was down. While it
/// listens, and for ever after it heard another master (`foreign_watch.hpp`), `send` says `Queued::listen_only`. A
/// master that appears later shuts it with the frame that tells: what is queued is taken back, and what the controller
/// is sending at that moment is the last. It does not open again by itself: two masters that both give way would take
/// turns.
///
/// Roles are kept frame by frame: a commissioner never sends NMT start, NMT reset or SYNC, and is not shut by another
/// master; an observer never sends a frame.
///
/// Another SDO client is no master: when one asks a node after the opening, this master goes on, and gives no SDO
/// request to that node until the client has been silent for `OtherClients::pause`: both use one channel, and each
/// would take the other's answers for its own. Requests to Berth's own node-ID are its clients'.
///
/// Own frames are known by their confirmations, so other processes of this machine must send through the process that
/// owns the port.
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
  rt::Duration listen = std::chrono::seconds(2);  ///< before the first frame; 0 = not at all
  WatchOptions watch{};
  std::vector<NodeId> slots{};  ///< devices of this machine, which are not the other master
  /// Nothing is sent: `on_held` gets what would be. A service that waits for a confirmation gets it, but not for a
  /// frame that a device would have to answer: there the future is unknown, and the service waits.
  bool dry_run = false;
};

enum class GateState : std::uint8_t {
  down,       ///< the port is: cable, interface, server
  listening,  ///< before the first frame
  open,
  foreign,   ///< another master is there: shut until `listen_again`
  observing  ///< an observer's, always
};
[[nodiscard]] const char* name(GateState state) noexcept;

/// A service answers it: an SDO request, an LSS request with an answer, a discovery request. Heartbeats, NMT commands,
/// SYNC, LSS switch and configure-activate have none.
[[nodiscard]] bool expects_answer(const can::Frame& frame) noexcept;
/// A commissioner's frame: everything but NMT start, NMT resets, SYNC. A reader's: SDO upload requests.
[[nodiscard]] bool allowed(Role role, const can::Frame& frame) noexcept;

class Gate final : public can::Port, private can::Listener {
 public:
  /// A port that is down so shortly after `restart` is on its way up: no cable was pulled.
  static constexpr rt::Duration restart_time = std::chrono::seconds(3);
  static constexpr std::size_t most_pending = 512;  ///< frames given and not confirmed; then `Queued::full`

  /// `inner` must stay. It is this gate's alone, and hears everything. A bus that is up is listened to from now on.
  Gate(rt::Executor& executor, can::Port& inner, GateOptions options);
  ~Gate() override;
  Gate(const Gate&) = delete;
  Gate& operator=(const Gate&) = delete;

  [[nodiscard]] GateState state() const noexcept { return state_; }
  /// It will not listen any longer by itself: open, or shut by another master, or observing.
  [[nodiscard]] bool decided() const noexcept { return state_ != GateState::listening && state_ != GateState::down; }
  [[nodiscard]] const ForeignWatch& watch() const noexcept { return watch_; }
  /// Frames that the role forbade.
  [[nodiscard]] std::uint32_t refused() const noexcept { return refused_; }
  /// What a person is told about the other master: the verdict, then one line for each sign; empty while there is none.
  [[nodiscard]] std::vector<std::string> report() const;
  /// A person says that the other master is gone: it listens anew.
  void listen_again() noexcept;

  /// The state changed. Called from the executor; must not destroy the gate.
  void on_change(std::function<void()> handler) { on_change_ = std::move(handler); }
  /// Behind the opening of a master's gate: other SDO clients, and the nodes that are left to them (`Queued::full`).
  [[nodiscard]] OtherClients& clients() noexcept { return clients_; }
  /// Dry run: a frame that would have been sent.
  void on_held(std::function<void(const can::Frame&, rt::Time)> handler) { on_held_ = std::move(handler); }
  /// Every frame on the bus, own ones when they are confirmed; and every error there that the port reports.
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
  std::vector<std::uint32_t> held_;  // tags of held frames that are to be confirmed
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
