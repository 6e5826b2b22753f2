// A client on its thread: the way to a connection, and what happens on it. Internal to room `mqtt`.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/mqtt/attempts.hpp"
#include "berth/mqtt/client.hpp"
#include "berth/mqtt/connection_parts.hpp"
#include "berth/mqtt/early.hpp"
#include "berth/mqtt/outbox.hpp"
#include "berth/mqtt/postbox.hpp"
#include "berth/mqtt/thread_parts.hpp"

namespace berth::mqtt {

class Core final : private Ear {
 public:
  Core(Hub& hub, Options options, Random random, Handler& handler);

  // Any thread.
  [[nodiscard]] Postbox& postbox() noexcept { return postbox_; }
  [[nodiscard]] Hub& hub() const noexcept { return *hub_; }

  // The hub's thread.
  void add(Letter letter) noexcept { outbox_.add(std::move(letter)); }
  void ready(Time now) noexcept;
  void work(Time now) noexcept;
  [[nodiscard]] Time due() const noexcept { return times_.due; }

  /// Its place in the hub's stack.
  struct Woken {
    Core* below = nullptr;
    std::atomic<bool> flag{false};  ///< it stands there
  };
  Woken woken;

 private:
  enum class State : std::uint8_t { pausing, looking_up, connecting, subscribing, connected, parting, ended };
  struct Times {
    Time until{};      // the end of the pause, or of the patience with this state
    Time connected{};  // since when
    Time tick{};       // the next look at the keep-alive
    Time due{};
  };
  /// The broker's.
  struct Answers {
    std::optional<Granted> granted{};
    std::optional<std::vector<int>> subscriptions{};
  };

  // The way to a connection.
  void look_up(Time now) noexcept;
  [[nodiscard]] std::optional<Cause> connect(const std::vector<std::string>& addresses) noexcept;
  [[nodiscard]] std::optional<Cause> ask() noexcept;
  void proceed(Time now) noexcept;
  void tell_connected(Time now) noexcept;
  [[nodiscard]] Stage stage() const noexcept;
  // What happens on it.
  void take_posts() noexcept;
  void begin_to_part(Time now) noexcept;
  void time_over(Time now) noexcept;
  void send(Time now) noexcept;
  void settle() noexcept;
  // Its end.
  void over(const Cause& cause, Time now) noexcept;
  void hand_back(const Letter& letter, std::string_view why) noexcept;
  void enter(State state, Time until) noexcept;

  void granted(const Granted& granted) noexcept override { answers_.granted = granted; }
  void subscribed(std::span<const int> codes) noexcept override;
  void message(std::string_view topic, std::span<const std::uint8_t> payload, bool retained) noexcept override;
  void skipped() noexcept override { postbox_.dropped_incoming(); }
  void out(int packet, unsigned code) noexcept override;

  Hub* hub_;
  Options options_;
  Handler* handler_;
  Postbox postbox_;
  Attempts attempts_;
  Outbox outbox_;
  Early early_;
  std::unique_ptr<Connection> connection_;
  std::uint32_t watched_ = 0;    // events
  ConnectionNumber number_ = 0;  // of the last connection
  Answers answers_{};
  State state_ = State::pausing;
  Times times_{};
};

}  // namespace berth::mqtt
