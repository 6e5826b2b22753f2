/// One client of the socketcand server: its connection, its node on a bus, and the state of the protocol. Inside of
/// room `serve`.
#pragma once

#include <array>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/io/socketcand_protocol.hpp"
#include "berth/io/stream.hpp"
#include "berth/serve/socketcand_server.hpp"

namespace berth::serve {

/// Cyclic jobs and subscriptions of BCM mode, as far as the kernel's broadcast manager is used by socketcand.
struct BcmJob {
  can::Frame frame;
  rt::Duration interval{0};  ///< 0: not cyclic
  rt::Time due{};
};
struct Subscription {
  std::uint32_t key = 0;
  bool always = true;                  ///< regardless of content
  std::array<std::uint8_t, 8> mask{};  ///< else: bits whose change counts
  rt::Duration interval{0};            ///< least time between two frames
  bool heard = false;
  bool waits = false;  ///< `last` is to be told when the interval is over
  rt::Time told{};
  can::Frame last;
  rt::Time last_at{};
};

class Client final : private io::Watcher, private can::Listener {
 public:
  static constexpr rt::Duration echo_wait = std::chrono::milliseconds(100);
  static constexpr rt::Duration quiet_after_ok = std::chrono::milliseconds(100);
  static constexpr rt::Duration least_interval = std::chrono::milliseconds(1);
  static constexpr rt::Duration bus_off_pause = std::chrono::seconds(1);
  static constexpr rt::Duration linger = std::chrono::seconds(1);  ///< for the frames of a client that has hung up
  static constexpr std::size_t most_jobs = 64;          ///< and as many subscriptions; further ones are `malformed`
  static constexpr std::size_t most_on_the_way = 1024;  ///< frames remembered until they are sent
  static constexpr std::size_t most_echoes = 256;       ///< not yet answered; then the client waits

  /// What a client needs of its server.
  struct House {
    io::Loop* loop = nullptr;
    const ServerOptions* options = nullptr;
    const SocketcandServer::Factory* factory = nullptr;
    ServerCounters* counters = nullptr;
    std::chrono::microseconds epoch{0};
    rt::Job* reaper = nullptr;  ///< posted when a client is over
    [[nodiscard]] rt::Executor& executor() const noexcept { return loop->executor(); }
  };
  Client(House& house, int fd, std::string name);
  ~Client();
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  void greet();
  /// Says why and ends; what is still to be sent is sent as far as the peer takes it at once.
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
  struct OnTheWay {
    std::uint32_t tag = 0;
    std::uint8_t size = 0;
  };
  struct Echo {
    std::uint32_t after = 0;  // answered when no frame up to this tag is outstanding
    rt::Time deadline{};
  };

  // io::Watcher
  void ready(std::uint32_t events) noexcept override;
  // can::Listener
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void sent(std::uint32_t tag, rt::Time at) noexcept override;
  void changed(const can::Status& status, rt::Time at) noexcept override;

  void say(std::string_view bytes);
  void flush() noexcept;
  void tick() noexcept;
  void arm(rt::Time when) noexcept;
  void work();
  void go_on();
  void leave();
  [[nodiscard]] bool stalled() const noexcept { return pending_.has_value() || echoes_.size() >= most_echoes; }
  void act(std::string_view element);
  void act_without_bus(const io::SocketcandCommand& command);
  void act_on_bus(const io::SocketcandCommand& command);
  void act_bcm(const io::SocketcandCommand& command);
  void open(const std::string& bus);
  void enter(Mode mode);
  void filter();
  void give(const can::Frame& frame);
  bool hand_over(const can::Frame& frame);
  void answer_echoes(rt::Time now);
  void tell_frame(const can::Frame& frame, rt::Time at);
  void release();
  void hear(Subscription& subscription, const can::Frame& frame, rt::Time at);
  void add_job(const io::SocketcandCommand& command);
  void subscribe(const io::SocketcandCommand& command);
  void run_jobs(rt::Time now);
  void run_subscriptions(rt::Time now);
  void tell_statistics(rt::Time now);
  void malformed() noexcept { ++house_->counters->malformed; }

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
  std::optional<rt::Time> leaving_;  // it has hung up: since then nothing of its was sent
  rt::Time patience_until_;
  std::optional<can::Frame> pending_;  // the bus has no room for it now
  std::vector<OnTheWay> on_the_way_;   // queued on the bus
  std::uint32_t last_tag_ = 0;
  std::deque<Echo> echoes_;
  std::optional<rt::Time> quiet_until_;  // frames wait in `later_`
  std::string later_;
  std::optional<rt::Time> restart_at_;
  std::vector<BcmJob> jobs_;
  std::vector<Subscription> subscriptions_;
  rt::Duration statistics_every_{0};
  rt::Time statistics_due_{};
  std::uint64_t bytes_in_ = 0, frames_in_ = 0, bytes_out_ = 0,
                frames_out_ = 0;  // of < stat >: received, sent on the bus
};

}  // namespace berth::serve
