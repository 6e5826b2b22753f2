/// Between the thread that publishes and the clients' thread: a bounded queue of messages, and the room for all that is
/// not yet sent; how the client ends. No lock: the publishing thread never waits. Internal to room `mqtt`.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <tl/expected.hpp>

#include "berth/base/handover.hpp"
#include "berth/mqtt/client.hpp"

namespace berth::mqtt {

/// An accepted message.
struct Letter {
  MessageId id = 0;
  std::size_t bytes = 0;  // its room
  Message message{};
};

class Postbox {
 public:
  explicit Postbox(const Limits& limits);

  /// Any thread: gives the message a number and room, or refuses it.
  [[nodiscard]] tl::expected<Letter, Refusal> accept(Message message) noexcept;
  /// The one publishing thread. There is a place for each accepted letter.
  void put(Letter letter) noexcept;

  // The clients' thread.
  [[nodiscard]] std::optional<Letter> take() { return posts_.take(); }
  /// A letter was sent, acknowledged or handed back.
  void give_back(const Letter& letter) noexcept;
  /// Messages for `connection` are accepted, up to `largest` bytes of topic and payload; 0: none are.
  void open(ConnectionNumber connection, std::size_t largest) noexcept;
  void dropped_incoming() noexcept { incoming_dropped_.fetch_add(1, std::memory_order_relaxed); }

  [[nodiscard]] Counts counts() const noexcept;

  /// Any thread: the client is to end so. False: it was asked before.
  bool ask_to_part(Parting parting) noexcept;
  /// What was put before that is there to be taken.
  [[nodiscard]] std::optional<Parting> asked_to_part() const noexcept;
  void set_ended() noexcept { ended_.store(true, std::memory_order_release); }
  [[nodiscard]] bool has_ended() const noexcept { return ended_.load(std::memory_order_acquire); }
  void set_gone() noexcept;
  void wait_until_gone() const noexcept { gone_.wait(false, std::memory_order_acquire); }

 private:
  static constexpr int no_parting = -1;
  [[nodiscard]] bool take_room(std::size_t bytes, Need need) noexcept;

  std::size_t most_messages_;
  std::size_t most_bytes_;
  Handover<Letter> posts_;
  std::atomic<ConnectionNumber> open_{0};
  std::atomic<std::size_t> largest_{0};
  std::atomic<std::size_t> waiting_{0};
  std::atomic<std::size_t> waiting_bytes_{0};
  std::atomic<MessageId> accepted_{0};
  std::atomic<std::uint64_t> no_room_must_{0};
  std::atomic<std::uint64_t> no_room_may_{0};
  std::atomic<std::uint64_t> incoming_dropped_{0};
  std::atomic<int> parting_{no_parting};
  std::atomic<bool> ended_{false};
  std::atomic<bool> gone_{false};
};

}  // namespace berth::mqtt
