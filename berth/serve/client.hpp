/// One client of the socketcand server: its connection, its node on a bus, and the state of the protocol. Internal to
/// room `serve`.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "berth/io/seats.hpp"
#include "berth/io/socketcand_protocol.hpp"
#include "berth/io/stream.hpp"
#include "berth/serve/broadcast_manager.hpp"
#include "berth/serve/outbox.hpp"
#include "berth/serve/socketcand_server.hpp"

namespace berth::serve {

/// The content of < stat >: frames and bytes received and sent, at intervals.
class BusStatistics {
 public:
  void received(std::uint8_t size) noexcept { ++frames_in_, bytes_in_ += size; }
  void sent(std::uint8_t size) noexcept { ++frames_out_, bytes_out_ += size; }
  /// 0: stop.
  void tell_every(rt::Duration interval, rt::Time now) noexcept;
  /// When `tell` is due next.
  [[nodiscard]] std::optional<rt::Time> due() const noexcept;
  /// The element, if due.
  std::optional<std::string> tell(rt::Time now);

 private:
  std::uint64_t bytes_in_ = 0, frames_in_ = 0, bytes_out_ = 0, frames_out_ = 0;
  rt::Duration every_{0};
  rt::Time due_{};
};

class Client final : private io::Watcher,
                     private can::Listener,
                     private BroadcastManager::Client,
                     private io::Seat::Sitter {
 public:
  static constexpr rt::Duration quiet_after_ok = std::chrono::milliseconds(100);
  static constexpr rt::Duration bus_off_pause = std::chrono::seconds(1);
  static constexpr rt::Duration linger = std::chrono::seconds(1);  ///< for the frames of a disconnected client

  /// The parts of its server that a client uses.
  struct House {
    io::Loop* loop = nullptr;
    const ServerOptions* options = nullptr;
    const SocketcandServer::Factory* factory = nullptr;
    ServerCounters* counters = nullptr;
    std::chrono::microseconds epoch{0};
    rt::Job* reaper = nullptr;  ///< posted when a client is over
    io::Seats* seats = nullptr;
    io::BoundedLines* tell = nullptr;
    [[nodiscard]] rt::Executor& executor() const noexcept { return loop->executor(); }
  };
  Client(House& house, int fd, std::string name);
  ~Client();
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  /// Takes a seat.
  void greet();
  /// Ends with this reason; pending bytes are sent as far as the peer takes them at once.
  void end(const std::string& why, std::string_view last_word = {});
  [[nodiscard]] bool over() const noexcept { return over_; }

 private:
  enum class Mode : std::uint8_t { no_bus, bcm, raw, control };
  class Flush final : public rt::Job {
   public:
    explicit Flush(Client& client) : client_(&client) {}
    void run() noexcept override { client_->flush(); }

   private:
    Client* client_;
  };
  class Clock final : public rt::Job {
   public:
    explicit Clock(Client& client) : client_(&client) {}
    void run() noexcept override { client_->tick(); }

   private:
    Client* client_;
  };

  // io::Watcher
  void ready(std::uint32_t events) noexcept override;
  // can::Listener
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void sent(std::uint32_t tag, rt::Time at) noexcept override;
  void changed(const can::Status& status, rt::Time at) noexcept override;

  // BroadcastManager::Client
  void give(const can::Frame& frame) override;
  bool hand_over(const can::Frame& frame) override;
  bool tell_frame(const can::Frame& frame, rt::Time at) override;
  void arm(rt::Time when) noexcept override;
  void filter() override;

  // io::Seat::Sitter
  [[nodiscard]] bool owed() const noexcept override { return !outbox_.empty() || outbox_.echo_deadline().has_value(); }
  void seat_lost(io::Seat::End how) noexcept override;

  void say(std::string_view bytes);
  void flush() noexcept;
  void tick() noexcept;
  void work();
  void go_on();
  void leave();
  void act_without_bus(const io::SocketcandCommand& command);
  void act_on_bus(const io::SocketcandCommand& command);
  void enter(Mode mode);
  void answer_echoes(rt::Time now);
  void release();

  House* house_;
  io::Stream stream_;
  std::string name_;
  std::string bus_;
  io::ElementReader reader_;
  std::unique_ptr<can::Port> port_;
  Flush flush_{*this};
  Clock clock_{*this};
  Mode mode_ = Mode::no_bus;
  bool over_ = false;
  std::optional<rt::Time> leaving_;  // it hung up: none of its frames was sent since then
  std::optional<io::Seat> seat_;     // none: one too many
  Outbox outbox_;
  std::optional<rt::Time> quiet_until_;  // frames wait in `later_`
  std::string later_;
  std::optional<rt::Time> restart_at_;
  BroadcastManager broadcasts_{*this};
  BusStatistics statistics_;
};

}  // namespace berth::serve
