/// The kernel's answers about network interfaces: the socket for netlink.hpp. Internal to room `io`.
#pragma once

#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/io/netlink.hpp"

namespace berth::io {

/// Receives every change of every interface. Move-only owner of a non-blocking descriptor.
class LinkWatch {
 public:
  LinkWatch() = default;
  ~LinkWatch() { close(); }
  LinkWatch(const LinkWatch&) = delete;
  LinkWatch& operator=(const LinkWatch&) = delete;

  [[nodiscard]] bool open() noexcept;  ///< false: see errno
  [[nodiscard]] int fd() const noexcept { return fd_; }
  /// Asks for one interface; `receive` returns the answer with this sequence number.
  bool ask(std::uint32_t sequence, const std::string& name) noexcept;

  struct Heard {
    std::vector<LinkNotice> notices;
    bool overrun = false;  ///< some were lost, because the socket's buffer was full: ask again
  };
  /// One packet; empty when there is none now.
  [[nodiscard]] std::optional<Heard> receive();

 private:
  void close() noexcept;
  int fd_ = -1;
  std::vector<std::uint8_t> buffer_;
};

/// A refusal by the kernel.
struct Refusal {
  int error = 0;  ///< an errno
  std::string text;
  [[nodiscard]] bool not_allowed() const noexcept;  ///< it requires another user or CAP_NET_ADMIN
};

/// The state of an interface; waits for the kernel's answer, which comes at once. ENODEV: there is no such interface.
[[nodiscard]] tl::expected<Link, Refusal> read_link(const std::string& name);
/// Changes it; waits until the driver has done it.
[[nodiscard]] tl::expected<void, Refusal> apply(int index, const LinkChange& change);

}  // namespace berth::io
