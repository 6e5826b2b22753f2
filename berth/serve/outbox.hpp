/// The frames of a socketcand client on their way to the bus: at most one without room, those queued there until they
/// are sent, and the echoes (`< echo >`) that wait for them. Internal to room `serve`.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "berth/can/port.hpp"

namespace berth::serve {

class Outbox {
 public:
  static constexpr rt::Duration echo_wait = std::chrono::milliseconds(100);
  static constexpr std::size_t most_on_the_way = 1024;  ///< remembered until sent
  static constexpr std::size_t most_echoes = 256;       ///< pending; beyond this the client waits

  can::Queued send(can::Port& port, const can::Frame& frame) {
    const auto queued = port.send(frame, last_tag_ + 1);
    if (queued != can::Queued::yes) return queued;
    if (on_the_way_.size() >= most_on_the_way) on_the_way_.erase(on_the_way_.begin());  // a port that drops frames
    on_the_way_.push_back({++last_tag_, frame.size});
    if (last_tag_ == 0xFFFF'FFFEU) last_tag_ = 0;
    return queued;
  }
  /// There is no room on the bus for it now.
  void keep(const can::Frame& frame) noexcept { kept_ = frame; }
  void drop_kept() noexcept { kept_.reset(); }
  [[nodiscard]] const std::optional<can::Frame>& kept() const noexcept { return kept_; }
  /// The size of the sent frame; empty: it was not from here.
  std::optional<std::uint8_t> sent(std::uint32_t tag) noexcept {
    const auto it = std::ranges::find(on_the_way_, tag, &OnTheWay::tag);
    if (it == on_the_way_.end()) return std::nullopt;
    const auto size = it->size;
    on_the_way_.erase(it);
    return size;
  }
  /// The frames queued on the bus will not be sent.
  void lose() noexcept { on_the_way_.clear(); }

  /// It is answered when no earlier frame is outstanding, or after `echo_wait`.
  void ask_echo(rt::Time now) { echoes_.push_back({last_tag_, now + echo_wait}); }
  /// Takes one that is to be answered now; false: none.
  bool take_echo(rt::Time now) {
    if (echoes_.empty()) return false;
    const auto echo = echoes_.front();
    const auto before = [&](const OnTheWay& f) { return f.tag <= echo.after; };
    const bool done = std::ranges::none_of(on_the_way_, before);
    if (!done && now < echo.deadline) return false;
    if (!done) std::erase_if(on_the_way_, before);
    echoes_.pop_front();
    return true;
  }
  [[nodiscard]] std::optional<rt::Time> echo_deadline() const noexcept {
    return echoes_.empty() ? std::nullopt : std::optional(echoes_.front().deadline);
  }

  /// The client has to wait.
  [[nodiscard]] bool stalled() const noexcept { return kept_.has_value() || echoes_.size() >= most_echoes; }
  [[nodiscard]] bool empty() const noexcept { return !kept_ && on_the_way_.empty(); }

 private:
  struct OnTheWay {
    std::uint32_t tag = 0;
    std::uint8_t size = 0;
  };
  struct Echo {
    std::uint32_t after = 0;  // answered when no frame up to this tag is outstanding
    rt::Time deadline{};
  };
  std::optional<can::Frame> kept_;
  std::vector<OnTheWay> on_the_way_;
  std::uint32_t last_tag_ = 0;
  std::deque<Echo> echoes_;
};

}  // namespace berth::serve
