/// A port that tells when frames of chosen identifiers are handed to it and when they are on the wire: what the delay
/// of a signal through a gateway is measured by. It stands between a device's dispatcher and its port.
#pragma once

#include <vector>

#include "berth/can/port.hpp"

namespace berth::multilevel {

class PortMeter {
 public:
  /// A frame with this key was taken by the port.
  virtual void submitted(std::uint32_t key, rt::Time at) noexcept = 0;
  /// The oldest of those is on the wire.
  virtual void on_the_wire(std::uint32_t key, rt::Time at) noexcept = 0;

 protected:
  ~PortMeter() = default;
};

class MeteredPort final : public can::Port, private can::Listener {
 public:
  /// `beneath` must stay.
  MeteredPort(rt::Executor& executor, can::Port& beneath) noexcept : executor_(&executor), beneath_(&beneath) {}
  /// From now on `meter` is told of this key, nobody else of it. Uses the heap.
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
    bool own;  // the tag is this port's, and the listener knows nothing of it
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
