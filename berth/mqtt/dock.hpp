/// Gives a libmosquitto client a pair of sockets instead of a connection of its own. Internal to room `mqtt`.
///
/// libmosquitto only connects by itself, and reads whatever comes. So it connects to this object, which listens on
/// 127.0.0.1, and its socket is then replaced by one end of a pair; whoever else connects there is disconnected.
#pragma once

#include <cstdint>

namespace berth::mqtt {

class Dock {
 public:
  Dock() noexcept;
  ~Dock();
  Dock(const Dock&) = delete;
  Dock& operator=(const Dock&) = delete;

  /// False: the system refused; see errno.
  [[nodiscard]] bool good() const noexcept { return port_ != 0; }
  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
  /// In the place of `fd`, which is connected to this object: one end of a pair. The other end, which is the caller's;
  /// negative: the system refused, see errno.
  [[nodiscard]] int replace(int fd) const noexcept;

 private:
  int listener_;
  std::uint16_t port_ = 0;
};

}  // namespace berth::mqtt
