/// A port with a slow host: received frames wait in a receive buffer of bounded depth until the device's firmware
/// processes them. Stands between a real port and the device's dispatcher.
///
/// Frames are processed in the order of arrival. Without latency they pass directly. CANopen (CiA 301) devices do not
/// use FD frames of more than 8 bytes: such frames are dropped and count as lost.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/can/packed_frame.hpp"
#include "berth/can/port.hpp"
#include "berth/device/timing.hpp"

namespace berth::device {

class TimedPort final : public can::Port, private can::Listener, private rt::Job {
 public:
  /// `port` and `timing` must outlive it; `timing` may change at any time, except `rx_depth`.
  TimedPort(rt::Executor& executor, can::Port& port, const Timing& timing, Random random);
  TimedPort(rt::Executor&, can::Port&, Timing&&, Random) = delete;  // a temporary does not outlive it
  ~TimedPort() override;

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override;
  void withdraw(std::uint32_t tag) noexcept override { port_->withdraw(tag); }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override;
  [[nodiscard]] can::Status status() const noexcept override { return port_->status(); }
  /// Also empties the receive buffer.
  bool restart(std::uint32_t bit_rate) noexcept override;

  /// While any reason holds, the firmware receives nothing, and the buffer's content is lost too.
  enum class Deaf : std::uint8_t { storing = 1, booting = 2, fault = 4 };
  void deaf(Deaf why, bool on) noexcept;
  [[nodiscard]] bool deaf() const noexcept { return deaf_ != 0; }
  [[nodiscard]] bool deaf(Deaf why) const noexcept { return (deaf_ & static_cast<std::uint8_t>(why)) != 0; }
  /// Added to every latency: simulates a device that has become slow.
  void slow(rt::Duration extra) noexcept { extra_ = extra; }
  [[nodiscard]] rt::Duration slow() const noexcept { return extra_; }
  /// Power was lost or the firmware restarted: empties the buffer.
  void clear() noexcept;

  /// Bytes held outside the object.
  [[nodiscard]] std::size_t memory() const noexcept { return buffer_.capacity() * sizeof(Waiting); }
  /// Frames lost because the buffer was full or the device was deaf.
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }
  [[nodiscard]] std::uint64_t delivered() const noexcept { return delivered_; }

 private:
  struct Waiting {
    rt::Time due;
    rt::Time at;
    can::PackedFrame frame;
  };
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  bool put_by(const can::Frame& frame, rt::Time at) noexcept override;
  void sent(std::uint32_t tag, rt::Time at) noexcept override;
  void changed(const can::Status& status, rt::Time at) noexcept override;
  void run() noexcept override;
  [[nodiscard]] rt::Duration draw() noexcept;
  void queue(const can::Frame& frame, rt::Time at, rt::Duration latency) noexcept;
  [[nodiscard]] bool make_room() noexcept;
  /// The `i`th waiting place, or the next free one.
  [[nodiscard]] Waiting& waiting(std::size_t i) noexcept {
    const std::size_t place = first_ + i;
    return buffer_[place < buffer_.size() ? place : place - buffer_.size()];
  }

  rt::Executor* executor_;
  can::Port* port_;
  const Timing* timing_;
  can::Listener* listener_ = nullptr;
  Random random_;
  std::vector<Waiting> buffer_;  // ring; grows up to the depth of the receive buffer
  std::uint32_t first_ = 0;
  std::uint32_t count_ = 0;
  std::uint8_t deaf_ = 0;
  rt::Duration extra_{0};
  std::uint64_t delivered_ = 0;
  std::uint64_t lost_ = 0;
};

}  // namespace berth::device
