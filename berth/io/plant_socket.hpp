/// One end of a plant connection: sends and receives packets, never blocks, and is bounded. Internal to room `io`.
#pragma once

#include <sys/un.h>

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "berth/io/loop.hpp"
#include "berth/io/plant_protocol.hpp"

namespace berth::io {

[[nodiscard]] bool address_of(const std::string& path, sockaddr_un& address) noexcept;

class PlantSocket {
 public:
  static constexpr std::size_t most_waiting = 4096;  ///< packets that the peer did not take; then the connection is
                                                     ///< given up

  static constexpr unsigned most_at_once = 64;  ///< messages to take in one turn of the loop

  /// Owns `fd`, a connected non-blocking SEQPACKET socket, and watches it with `watcher`.
  PlantSocket(Loop& loop, int fd, Watcher& watcher);
  ~PlantSocket();
  PlantSocket(const PlantSocket&) = delete;
  PlantSocket& operator=(const PlantSocket&) = delete;

  [[nodiscard]] bool open() const noexcept { return fd_ >= 0; }
  /// Total of packets that the peer took.
  [[nodiscard]] std::uint64_t taken() const noexcept { return taken_; }
  /// Packets that the peer has not taken yet.
  [[nodiscard]] std::size_t waiting() const noexcept { return waiting_.size(); }
  /// False: the peer is gone or takes nothing any more; the socket then counts as closed, and is `closing`.
  bool send(const Message& message);
  /// Sends waiting packets; call when the descriptor can be written.
  bool flush();
  /// The next message; empty when there is none now. A peer that is gone or sends an invalid message makes it
  /// `closing`.
  [[nodiscard]] std::optional<Message> receive();
  /// Nothing is sent or received any more: its owner may destroy it.
  [[nodiscard]] bool closing() const noexcept { return closing_; }
  void close() noexcept;

 private:
  bool put(const std::vector<std::uint8_t>& packet);
  void give_up() noexcept;
  Loop* loop_;
  int fd_;
  Watcher* watcher_;
  std::deque<std::vector<std::uint8_t>> waiting_;
  std::uint64_t taken_ = 0;
  bool closing_ = false;
};

}  // namespace berth::io
