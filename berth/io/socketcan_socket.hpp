/// The raw socket of a SocketCAN port, with as few system calls as possible. Internal to room `io`.
#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "berth/io/socketcan_codec.hpp"

namespace berth::io {

class CanSocket {
 public:
  CanSocket() = default;
  ~CanSocket() { close(); }
  CanSocket(const CanSocket&) = delete;
  CanSocket& operator=(const CanSocket&) = delete;

  /// A socket that receives only error frames at first, bound to an interface. False: see errno.
  [[nodiscard]] bool open(int index) noexcept;
  void close() noexcept;
  /// From the call on the socket also receives its own frames, if they pass the filters. False: the kernel refused.
  bool hear_own() noexcept;
  [[nodiscard]] int fd() const noexcept { return fd_; }
  /// Sets the filters. False: the kernel refused, and they are unchanged.
  bool filter(std::span<const KernelFilter> filters) noexcept;

  enum class Wrote : std::uint8_t {
    yes,
    full,     ///< the interface's queue is full (ENOBUFS): its end is not reported
    waiting,  ///< this socket has written as much as it may (EAGAIN): EPOLLOUT reports the end
    down,     ///< the interface is down or gone
    refused,  ///< the interface cannot carry such a frame
  };
  [[nodiscard]] Wrote write(const KernelFrame& bytes, std::size_t size) noexcept;

  struct Received {
    std::span<const std::uint8_t> bytes;
    bool own = false;                     ///< this socket wrote it
    std::optional<std::int64_t> stamp{};  ///< ns of the wall clock
  };
  static constexpr std::size_t batch = 32;
  /// At most `most` of the waiting frames, and at most `batch`; `error` 0, or an errno when the interface went down.
  /// The bytes are valid until the next call.
  [[nodiscard]] std::span<const Received> read(std::size_t most, int& error) noexcept;
  /// Frames lost because the receive buffer was full, since `open`, as reported with later frames.
  [[nodiscard]] std::uint32_t dropped() const noexcept { return dropped_; }
  /// The same, requested from the kernel: also counts losses after the last frame.
  std::uint32_t ask_dropped() noexcept;

 private:
  struct Slot {
    KernelFrame frame;
    alignas(cmsghdr) std::array<std::uint8_t, 128> control;
    iovec part;
  };
  void prepare();
  int read_one() noexcept;
  void take(const msghdr& head, Received& to) noexcept;

  int fd_ = -1;
  std::uint32_t dropped_ = 0;
  std::vector<Slot> slots_;
  std::vector<mmsghdr> heads_;
  std::array<Received, batch> received_{};
};

}  // namespace berth::io
