/// A port that reports when it takes frames with chosen identifiers and when they are on the wire, to measure the delay
/// of a signal through a gateway. It is between a device's dispatcher and its port.
#pragma once

#include <vector>

#include "berth/can/port.hpp"

namespace berth::multilevel {

class PortMeter {
 public:
  /// The port took a frame with this key.
  virtual void submitted(std::uint32_t key, rt::Time at) noexcept = 0;
  /// The oldest of those frames is on the wire.
  virtual void on_the_wire(std::uint32_t key, rt::Time at) noexcept = 0;

 protected:
  ~PortMeter() = default;
};

class MeteredPort final : public can::Port, private can::Listener {
 public:
  /// `beneath` must outlive it.
  MeteredPort(rt::Executor& executor, can::Port& beneath) noexcept : executor_(&executor), beneath_(&beneath) {}
  /// From now on only `meter` gets reports for this key. Uses the heap.
  void watch(std::uint32_t key, PortMeter& meter);
  void forget(const PortMeter& meter) noexcept;

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override;
  void withdraw(std::uint32_t tag) noexcept override;
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override;
  [[nodiscard]] can::Status status() const noexcept override { return beneath_->status(); }
  bool restart(std::uint32_t bit_rate) noexcept override;

 private:
  struct Watched {
    std::uint32_t key;
    PortMeter* meter;
  };
  struct UnderWay {
    std::uint32_t tag;
    std::uint32_t key;
    bool own;  // the tag is this port's, and the listener does not know it
  };
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void sent(std::uint32_t tag, rt::Time at) noexcept override;
  void changed(const can::Status& status, rt::Time at) noexcept override;
  [[nodiscard]] PortMeter* meter(std::uint32_t key) const noexcept;

  rt::Executor* executor_;
  can::Port* beneath_;
  can::Listener* listener_ = nullptr;
  std::vector<Watched> watched_;
  std::vector<UnderWay> under_way_;
  std::uint32_t next_ = 0;
};

}  // namespace berth::multilevel
