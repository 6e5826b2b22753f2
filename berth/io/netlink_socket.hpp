/// The kernel's answers about network interfaces: the descriptor below netlink.hpp. Inside of room `io`.
#pragma once

#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/io/netlink.hpp"

namespace berth::io {

/// Hears of every change of every interface. Move-only owner of a non-blocking descriptor.
class LinkWatch {
 public:
  LinkWatch() = default;
  ~LinkWatch() { close(); }
  LinkWatch(const LinkWatch&) = delete;
  LinkWatch& operator=(const LinkWatch&) = delete;

  [[nodiscard]] bool open() noexcept;  ///< false: errno says why
  [[nodiscard]] int fd() const noexcept { return fd_; }
  /// Asks for one interface; `receive` gives the answer with this sequence number.
  bool ask(std::uint32_t sequence, const std::string& name) noexcept;

  struct Heard {
    std::vector<LinkNotice> notices;
    bool overrun = false;  ///< there was more than the socket could keep: ask anew
  };
  /// One packet; empty when there is none now.
  [[nodiscard]] std::optional<Heard> receive();

 private:
  void close() noexcept;
  int fd_ = -1;
  std::vector<std::uint8_t> buffer_;
};

/// What the kernel refused.
struct Refusal {
  int error = 0;  ///< an errno
  std::string text;
  [[nodiscard]] bool not_allowed() const noexcept;  ///< it wants another user or CAP_NET_ADMIN
};

/// How an interface is; waits for the kernel's answer, which is at once. ENODEV: there is none of this name.
[[nodiscard]] tl::expected<Link, Refusal> read_link(const std::string& name);
/// Changes it; waits until it is done, which takes as long as the driver does.
[[nodiscard]] tl::expected<void, Refusal> apply(int index, const LinkChange& change);

}  // namespace berth::io
