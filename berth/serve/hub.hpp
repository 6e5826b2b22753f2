/// Shares one port among many users, like a kernel shares its interface among sockets: each receives the port's frames
/// and those sent by the other users, when they were sent, but not its own. For ports that can be opened only once: a
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
  static constexpr unsigned queue_depth = 32;    ///< waiting frames of one user; then `Queued::full`
  static constexpr unsigned events_kept = 4096;  ///< frames not yet delivered to one user; further ones count as `lost`

  Hub(rt::Executor& executor, std::unique_ptr<can::Port> port);
  ~Hub();
  Hub(const Hub&) = delete;
  Hub& operator=(const Hub&) = delete;

  /// A user's `restart` only recovers a bus-off port, at its present rate.
  [[nodiscard]] std::unique_ptr<can::Port> attach();
  /// Receives every frame, in both directions; null: none. Must live until replaced.
  void tap(can::Tap* tap) noexcept;
  [[nodiscard]] const can::Port& port() const noexcept;
  [[nodiscard]] std::size_t users() const noexcept;

 private:
  class Impl;
  class User;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::serve
