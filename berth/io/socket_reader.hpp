/// Reads for a SocketCAN port: in batches as large as what waits, with the loop's time of each frame. Internal to room
/// `io`.
#pragma once

#include <algorithm>
#include <ctime>

#include "berth/io/loop.hpp"
#include "berth/io/socketcan_codec.hpp"
#include "berth/io/socketcan_socket.hpp"

namespace berth::io {

class SocketReader {
 public:
  SocketReader(Loop& loop, CanSocket& socket) noexcept : loop_(&loop), socket_(&socket) {}

  /// Reads waiting frames, as long as `room()` allows more to be kept. Calls `arrived(received, at)` for each, and
  /// `down()` when the interface went down.
  template <class Room, class Arrived, class Down>
  void read(const Room& room, const Arrived& arrived, const Down& down) {
    bool all = false;
    for (unsigned i = 0; i < most_batches && room() > 0; ++i) {
      const std::size_t most = std::min(at_a_time_, room());
      int error = 0;
      const auto got = socket_->read(most, error);
      // It was there when the last batch was read.
      const bool backlog = !got.empty() && got.front().stamp && *got.front().stamp < stamps_.wall();
      if (!got.empty() && !stamps_.begin_as_before(loop_->woke(), got.back().stamp)) {
        stamps_.begin(loop_->clock(), wall_clock());
      }
      for (const auto& r : got) {
        last_ = stamps_.at(r.stamp, latest());
        arrived(r, last_);
      }
      all = got.size() < most;
      if (error != 0) down();
      // One by one while they come one by one: asking for more than there is makes the kernel look in vain.
      at_a_time_ = backlog ? std::min(at_a_time_ * 2, CanSocket::batch) : got.size() < most ? 1 : at_a_time_;
      if (error == 0 && (all || most == 1)) break;
    }
    if (!all) loop_->hold(last_ + rt::Duration{1});
  }
  /// Another event happened now: later frames get no earlier time.
  [[nodiscard]] rt::Time happens() noexcept { return stamps_.not_before(latest()); }

 private:
  static constexpr unsigned most_batches = 8;  // in a row, before others have their turn
  static std::int64_t wall_clock() noexcept {
    timespec time{};
    ::clock_gettime(CLOCK_REALTIME, &time);
    return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
  }
  // Before the end of this turn, so that it is delivered in it.
  [[nodiscard]] rt::Time latest() const noexcept {
    return std::max(loop_->woke(), loop_->executor().now()) - rt::Duration{1};
  }

  Loop* loop_;
  CanSocket* socket_;
  StampMap stamps_;
  rt::Time last_{};            // of what was read
  std::size_t at_a_time_ = 1;  // frames asked for
};

}  // namespace berth::io
