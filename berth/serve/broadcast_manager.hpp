/// BCM mode of the socketcand protocol, like the kernel's broadcast manager behind it: frames sent cyclically, and
/// subscriptions that report frames when their content changes, with a minimum interval. Internal to room `serve`.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/io/socketcand_protocol.hpp"
#include "berth/rt/executor.hpp"

namespace berth::serve {

class BroadcastManager {
 public:
  static constexpr std::size_t most = 64;  ///< jobs, and as many subscriptions
  static constexpr rt::Duration least_interval = std::chrono::milliseconds(1);

  /// The destination of frames and the caller of `run`. Must outlive this.
  class Client {
   public:
    /// Sends it as soon as the bus has room.
    virtual void give(const can::Frame& frame) = 0;
    /// Sends it now; false: no room.
    virtual bool hand_over(const can::Frame& frame) = 0;
    /// A received frame; false: the client is over.
    virtual bool tell_frame(const can::Frame& frame, rt::Time at) = 0;
    /// `run` is due.
    virtual void arm(rt::Time when) noexcept = 0;
    /// `keys` changed.
    virtual void filter() = 0;

   protected:
    ~Client() = default;
  };
  explicit BroadcastManager(Client& client) noexcept : client_(&client) {}

  /// < add >, < update >, < delete >, < filter >, < subscribe >, < unsubscribe >. False: too many of them.
  bool act(const io::SocketcandCommand& command, rt::Time now);
  /// A frame of a key that is subscribed to; others do nothing.
  void hear(const can::Frame& frame, rt::Time at);
  /// Does what is due. A job whose turn comes without `room` is not sent then; its next turn follows.
  void run(rt::Time now, bool room);
  void clear() noexcept;
  /// The subscribed frames.
  [[nodiscard]] std::vector<can::IdRange> keys() const;

 private:
  struct Job {
    can::Frame frame;
    rt::Duration interval{0};  ///< 0: not cyclic
    rt::Time due{};
  };
  struct Subscription {
    std::uint32_t key = 0;
    bool always = true;                  ///< regardless of content
    std::array<std::uint8_t, 8> mask{};  ///< else: bits whose changes are reported
    rt::Duration interval{0};            ///< shortest time between two frames
    bool heard = false;
    bool waits = false;  ///< `last` is to be reported after the interval
    rt::Time told{};
    can::Frame last;
    rt::Time last_at{};
    [[nodiscard]] bool differs(const can::Frame& frame) const noexcept;
  };
  bool add_job(const io::SocketcandCommand& command, rt::Time now);
  bool subscribe(const io::SocketcandCommand& command);
  void run_jobs(rt::Time now, bool room);
  void run_subscriptions(rt::Time now);

  Client* client_;
  std::vector<Job> jobs_;
  std::vector<Subscription> subscriptions_;
};

}  // namespace berth::serve
