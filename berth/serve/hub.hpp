/// Shares one port among many users, as a kernel shares its interface among sockets: each hears what the port hears and
/// what the other users sent, when it was sent; none hears itself. For ports of which there can be one only: a
/// serial line, a plant's socket.
///
///     serve::Hub hub(executor, std::move(port));
///     auto user = hub.attach();           // a can::Port; destroy it before the hub
#pragma once

#include <memory>

#include "berth/can/port.hpp"

namespace berth::serve {

class Hub {
 public:
  static constexpr unsigned queue_depth = 32;    ///< frames of one user that wait to be sent; then `Queued::full`
  static constexpr unsigned events_kept = 4096;  ///< frames that one user was not yet told; then they count as `lost`

  Hub(rt::Executor& executor, std::unique_ptr<can::Port> port);
  ~Hub();
  Hub(const Hub&) = delete;
  Hub& operator=(const Hub&) = delete;

  /// `restart` of a user only brings a port back that is bus-off, at the rate it has.
  [[nodiscard]] std::unique_ptr<can::Port> attach();
  /// Sees every frame, in both directions; null: none. Must stay until replaced.
  void tap(can::Tap* tap) noexcept;
  [[nodiscard]] const can::Port& port() const noexcept;
  [[nodiscard]] std::size_t users() const noexcept;

 private:
  class Impl;
  class User;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::serve
