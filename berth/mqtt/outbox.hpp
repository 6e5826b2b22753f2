/// The accepted messages of one connection: those that wait, in their order, and those on their way. Pure; internal to
/// room `mqtt`.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>

#include "berth/mqtt/postbox.hpp"

namespace berth::mqtt {

class Outbox {
 public:
  struct Sending {
    Letter letter{};
    int packet = 0;  ///< identifier; 0: none yet
  };

  void add(Letter letter);
  [[nodiscard]] bool is_empty() const noexcept { return waiting_.empty() && sending_.empty(); }
  /// The first that waits may go: with QoS 1, fewer than `window` are unacknowledged. The order is kept, so QoS 0 waits
  /// behind it.
  [[nodiscard]] bool may_send(std::size_t window) const noexcept;
  /// The first that waits is on its way from now on. There must be one. Valid until it is `out` or `failed`.
  [[nodiscard]] Sending& send();
  /// The one on its way with this packet identifier is done; empty: there is none.
  [[nodiscard]] std::optional<Letter> out(int packet);
  /// The last of `send` could not be sent.
  [[nodiscard]] Letter failed();
  /// Takes one out, those on their way first, each kind in its order; empty: there is none.
  [[nodiscard]] std::optional<Letter> take_any();

 private:
  void done(const Letter& letter) noexcept;

  std::deque<Letter> waiting_;
  std::deque<Sending> sending_;
  std::size_t unacknowledged_ = 0;  // of sending_: those of QoS 1
};

}  // namespace berth::mqtt
