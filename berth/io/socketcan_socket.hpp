/// The raw socket of a SocketCAN port: what the kernel offers, as few system calls as can be. Inside of room `io`.
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

  /// A socket that hears nothing yet but error frames, bound to an interface. False: errno says why.
  [[nodiscard]] bool open(int index) noexcept;
  void close() noexcept;
  /// What this socket writes comes back to it from now on, when it passes the filters. False: the kernel refused.
  bool hear_own() noexcept;
  [[nodiscard]] int fd() const noexcept { return fd_; }
  /// What passes from now on. False: the kernel refused, and the filters are as before.
  bool filter(std::span<const KernelFilter> filters) noexcept;

  enum class Wrote : std::uint8_t {
    yes,
    full,     ///< the interface's queue is full (ENOBUFS): it is not told when that changes
    waiting,  ///< this socket has written as much as it may (EAGAIN): EPOLLOUT tells when that changes
    down,     ///< the interface is down or gone
    refused,  ///< the interface does not carry such a frame
  };
  [[nodiscard]] Wrote write(const KernelFrame& bytes, std::size_t size) noexcept;

  struct Received {
    std::span<const std::uint8_t> bytes;
    bool own = false;                     ///< this socket wrote it
    std::optional<std::int64_t> stamp{};  ///< ns of the wall clock
  };
  static constexpr std::size_t batch = 32;
  /// At most `most` of what waits, and at most `batch`; `error` 0, or an errno when the interface went down. The bytes
  /// are good until the next call.
  [[nodiscard]] std::span<const Received> read(std::size_t most, int& error) noexcept;
  /// Frames that found no room in the receive buffer since `open`, as told beside the frames that did.
  [[nodiscard]] std::uint32_t dropped() const noexcept { return dropped_; }
  /// The same, asked for: knows of those after which no other came.
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
