/// A Berth that can die at any point: its port is counted and cut off.
///
/// An `Axe` counts the points of one run of Berth and falls at a chosen one. From then on nothing that Berth does has
/// an effect, and nothing reaches Berth; the driver of the world ends the run after the instant.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "berth/can/port.hpp"

namespace berth::harness {

enum class PointKind : std::uint8_t {
  store_before,    // a writing call of the store begins
  store_after,     // it returned, and Berth does not yet know
  send_before,     // a frame is given to the controller
  send_after,      // it was acknowledged on the wire, and Berth does not yet know
  receive_before,  // a frame has come, and Berth does not yet know
  receive_after,   // Berth has handled that frame
  memory_begin,    // a device begins to write its memory
  memory_end,      // it is written, and the device has not reported it yet
  disk,            // a write, truncation, sync or deletion of the store's file
  memory_torn,     // one byte of a device's memory
  lost_by_device,  // a device loses a frame that Berth sent
  lost_by_berth,   // Berth loses a frame
  device_off,      // a device loses power when a frame was sent or has come
  count,
};
inline const char* name(PointKind k) {
  constexpr const char* names[] = {"store write, before",  "store write, after",     "frame sent, before",
                                   "frame sent, after",    "frame received, before", "frame received, after",
                                   "device memory, begin", "device memory, end",     "store file, write or sync",
                                   "device memory, torn",  "frame lost by a device", "frame lost by Berth",
                                   "device without power"};
  return names[static_cast<int>(k)];
}
inline constexpr int point_kinds = static_cast<int>(PointKind::count);

class Axe {
 public:
  // What happens at the chosen point instead of Berth's death.
  enum class Instead : std::uint8_t { nothing, lives, loses_frame };
  // A new run of Berth; the axe falls at its point `k`, from 0, unless `instead` says otherwise.
  void life(std::optional<std::uint64_t> k, std::function<Instead()> instead = {}) {
    trace_.clear();
    at_ = k;
    fallen_ = loses_ = false;
    instead_ = std::move(instead);
  }
  // One point; true if Berth is dead now. Memory points do not kill by themselves.
  bool point(PointKind kind) noexcept {
    if (fallen_) return true;
    if (!hit(kind)) return false;
    const Instead instead = instead_ ? instead_() : Instead::nothing;
    fallen_ = instead == Instead::nothing;
    loses_ = instead == Instead::loses_frame;
    return fallen_;
  }
  // The frame that has just come is lost.
  [[nodiscard]] bool loses() noexcept { return std::exchange(loses_, false); }
  // Counts one point; true if it is the chosen one.
  bool hit(PointKind kind) noexcept {
    trace_.push_back(kind);
    return at_ && trace_.size() == *at_ + 1;
  }
  void fall() noexcept { fallen_ = true; }
  [[nodiscard]] bool fallen() const noexcept { return fallen_; }
  [[nodiscard]] const std::vector<PointKind>& trace() const noexcept { return trace_; }

 private:
  std::vector<PointKind> trace_;
  std::optional<std::uint64_t> at_;
  std::function<Instead()> instead_;
  bool fallen_ = false;
  bool loses_ = false;
};

// Berth's port, between it and its controller. Frames that Berth gave to the controller before it died are sent, as by
// a driver, until the controller ends, too.
class MortalPort final : public can::Port, private can::Listener {
 public:
  MortalPort(Axe& axe, can::Port& beneath) : axe_(&axe), beneath_(&beneath) {}

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    if (axe_->point(PointKind::send_before)) return can::Queued::closed;
    const std::uint32_t own = ++last_;
    const auto queued = beneath_->send(frame, own);
    if (queued == can::Queued::yes) tags_[own] = tag;
    return queued;
  }
  void withdraw(std::uint32_t tag) noexcept override {
    if (axe_->fallen()) return;
    for (auto it = tags_.begin(); it != tags_.end(); ++it) {
      if (it->second != tag) continue;
      beneath_->withdraw(it->first);
      tags_.erase(it);
      return;
    }
  }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    beneath_->listen(this, accept);
  }
  [[nodiscard]] can::Status status() const noexcept override { return beneath_->status(); }
  bool restart(std::uint32_t bit_rate) noexcept override { return !axe_->fallen() && beneath_->restart(bit_rate); }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override {
    if (axe_->point(PointKind::receive_before) || axe_->loses() || listener_ == nullptr) return;
    listener_->received(frame, at);
    axe_->point(PointKind::receive_after);
  }
  void sent(std::uint32_t own, rt::Time at) noexcept override {
    const auto it = tags_.find(own);
    const std::uint32_t tag = it == tags_.end() ? 0 : it->second;
    if (it != tags_.end()) tags_.erase(it);
    if (axe_->point(PointKind::send_after) || listener_ == nullptr) return;
    if (tag != 0) listener_->sent(tag, at);
  }
  void changed(const can::Status& status, rt::Time at) noexcept override {
    if (!axe_->fallen() && listener_ != nullptr) listener_->changed(status, at);
  }
  Axe* axe_;
  can::Port* beneath_;
  can::Listener* listener_ = nullptr;
  std::map<std::uint32_t, std::uint32_t> tags_;
  std::uint32_t last_ = 0;
};

}  // namespace berth::harness
