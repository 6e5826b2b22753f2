/// A port with a slow host behind it: what the controller received waits in a receive buffer of bounded depth until
/// the device's firmware gets to it. Stands between a real port and the device's dispatcher.
///
/// Frames are dealt with in the order in which they came. With no latency they pass straight through. FD frames of more
/// than 8 bytes are none of a CANopen (CiA 301) device's: they are dropped and count as lost.
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
  /// `port` and `timing` must outlive it; `timing` may be changed at any time, its `rx_depth` not.
  TimedPort(rt::Executor& executor, can::Port& port, const Timing& timing, Random random);
  TimedPort(rt::Executor&, can::Port&, Timing&&, Random) = delete;  // a temporary does not outlive it
  ~TimedPort() override;

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override;
  void withdraw(std::uint32_t tag) noexcept override { port_->withdraw(tag); }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override;
  [[nodiscard]] can::Status status() const noexcept override { return port_->status(); }
  /// Forgets the receive buffer too.
  bool restart(std::uint32_t bit_rate) noexcept override;

  /// The firmware hears nothing while any reason holds; what waits in the buffer is lost too.
  enum class Deaf : std::uint8_t { storing = 1, booting = 2, fault = 4 };
  void deaf(Deaf why, bool on) noexcept;
  [[nodiscard]] bool deaf() const noexcept { return deaf_ != 0; }
  [[nodiscard]] bool deaf(Deaf why) const noexcept { return (deaf_ & static_cast<std::uint8_t>(why)) != 0; }
  /// Added to every latency; a device that has become slow.
  void slow(rt::Duration extra) noexcept { extra_ = extra; }
  [[nodiscard]] rt::Duration slow() const noexcept { return extra_; }
  /// Power lost or firmware started anew: the buffer is empty.
  void clear() noexcept;

  /// Bytes that it takes beyond itself.
  [[nodiscard]] std::size_t memory() const noexcept { return buffer_.capacity() * sizeof(Waiting); }
  /// Frames lost because the buffer was full, or the device deaf.
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
  /// The place of the `i`th that waits, or of the next one.
  [[nodiscard]] Waiting& waiting(std::size_t i) noexcept {
    const std::size_t place = first_ + i;
    return buffer_[place < buffer_.size() ? place : place - buffer_.size()];
  }

  rt::Executor* executor_;
  can::Port* port_;
  const Timing* timing_;
  can::Listener* listener_ = nullptr;
  Random random_;
  std::vector<Waiting> buffer_;  // ring; grows to the depth of the receive buffer when so much waits
  std::uint32_t first_ = 0;
  std::uint32_t count_ = 0;
  std::uint8_t deaf_ = 0;
  rt::Duration extra_{0};
  std::uint64_t delivered_ = 0;
  std::uint64_t lost_ = 0;
};

}  // namespace berth::device
