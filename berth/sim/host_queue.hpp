/// The pending reports of one controller to its host: frames received and sent, and changes of its state. Internal to
/// `sim`.
#pragma once

#include <cstdint>
#include <vector>

#include "berth/can/packed_frame.hpp"
#include "berth/can/port.hpp"
#include "berth/rt/executor.hpp"

namespace berth::sim {

/// Each call of the `Listener` comes in its own job, except for frames that it puts by; the host needs `rx_service` for
/// each received frame.
class HostQueue final : private rt::Job {
 public:
  /// `port`: its status is read when a change is reported to the host. `rx_depth`: received frames that can wait, at
  /// least one; `rx_service` 0: the buffer never overruns.
  HostQueue(rt::Executor& executor, const can::Port& port, unsigned rx_depth, rt::Duration rx_service);

  /// Null: no listener. Pending reports for another listener are dropped.
  void listen(can::Listener* listener) noexcept;
  [[nodiscard]] bool listened() const noexcept { return listener_ != nullptr; }
  /// On: the host reads nothing.
  void deaf(bool on) noexcept { deaf_ = on; }

  /// False: the receive buffer loses it. Only while `listened`.
  [[nodiscard]] bool received(const can::Frame& frame, rt::Time at) noexcept {
    if (deaf_ || rx_waiting_ >= rx_depth_) return false;
    if (count_ == 0 && rx_service_.count() == 0 && listener_->put_by(frame, at)) return true;
    ++rx_waiting_;
    push(What::received, at).frame = can::PackedFrame(frame);
    if (frame.fd) [[unlikely]]
      keep_fd(frame);
    return true;
  }
  /// Not reported for tag 0 or without a listener; `changed` neither.
  void sent(std::uint32_t tag, rt::Time at) noexcept {
    if (tag != 0 && listener_ != nullptr) push(What::sent, at).tag = tag;
  }
  void changed() noexcept;
  void forget() noexcept;

 private:
  enum class What : std::uint8_t { received, sent, changed };
  struct Event {
    can::PackedFrame frame;
    rt::Time at{};
    std::uint32_t tag = 0;
    What what = What::received;
  };
  void run() noexcept override;
  Event& push(What what, rt::Time at) noexcept {
    if (count_ == events_.size()) [[unlikely]]
      grow();
    Event& event = events_[(first_ + count_) & (events_.size() - 1)];
    event.what = what;
    event.at = at;
    if (count_++ == 0) schedule(what);
    return event;
  }
  // `first`: the kind of the first event.
  void schedule(What first) noexcept {
    if (rx_service_.count() == 0 || first != What::received) {
      executor_->post(*this);
    } else {
      executor_->after(rx_service_, *this);
    }
  }
  [[gnu::cold]] void grow();
  [[gnu::cold]] void keep_fd(const can::Frame& frame);
  [[gnu::cold]] void receive_fd(rt::Time at) noexcept;

  rt::Executor* executor_;
  const can::Port* port_;
  can::Listener* listener_ = nullptr;
  bool deaf_ = false;
  unsigned rx_depth_;
  unsigned rx_waiting_ = 0;  // received frames among events_
  rt::Duration rx_service_;
  std::vector<Event> events_;  // ring, its size a power of two
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  std::vector<can::Frame> fd_received_;  // the FD frames among events_
};

}  // namespace berth::sim
