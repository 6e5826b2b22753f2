// What fuzz targets of single services share: the input as a stream, and a port that nobody else is on.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "fuzz/require.hpp"

namespace berth::fuzz {

class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  [[nodiscard]] bool empty() const { return size_ == 0; }
  std::uint8_t byte() {
    if (size_ == 0) return 0;
    --size_;
    return *data_++;
  }
  std::uint16_t half() { return static_cast<std::uint16_t>(number(2)); }
  std::uint32_t word() { return number(4); }
  /// At most 8 data bytes; the length byte also says remote (80h) and FD (40h).
  can::Frame frame(std::uint32_t key) {
    can::Frame frame;
    frame.id = key & ~can::extended_flag;
    frame.extended = (key & can::extended_flag) != 0;
    const std::uint8_t kind = byte();
    frame.remote = (kind & 0x80U) != 0;
    frame.fd = !frame.remote && (kind & 0x40U) != 0;
    frame.size = kind % 9;
    if (frame.remote) return frame;
    for (std::size_t i = 0; i < frame.size; ++i) frame.data[i] = byte();
    return frame;
  }

 private:
  std::uint32_t number(int bytes) {
    std::uint32_t value = 0;
    for (int i = 0; i < bytes; ++i) value = value << 8 | byte();
    return value;
  }
  const std::uint8_t* data_;
  std::size_t size_;
};

/// A bus with one node: every frame is on the wire 100 us after the one before. `hear` is what others send.
class BenchPort final : public can::Port, private rt::Job {
 public:
  explicit BenchPort(rt::Executor& executor) : executor_(executor) {}
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    if (refuses) return can::Queued::bus_off;
    if (queue_.size() >= capacity) return can::Queued::full;
    queue_.push_back({frame, tag});
    if (!timed() && !ready()) executor_.after(std::chrono::microseconds(100), *this);
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t tag) noexcept override {
    std::erase_if(queue_, [tag](const Item& item) { return item.tag == tag; });
  }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    accept_.assign(accept.begin(), accept.end());
  }
  [[nodiscard]] can::Status status() const noexcept override { return {.up = true, .knows_sent = true}; }
  bool restart(std::uint32_t) noexcept override {
    queue_.clear();
    return true;
  }
  void hear(const can::Frame& frame) {
    for (const auto range : accept_) {
      if (range.contains(frame.key())) return listener_->received(frame, executor_.now());
    }
  }

  std::size_t capacity = 32;
  bool refuses = false;
  std::function<void(const can::Frame&)> on_sent;

 private:
  struct Item {
    can::Frame frame;
    std::uint32_t tag;
  };
  void run() noexcept override {
    if (queue_.empty()) return;
    const Item item = queue_.front();
    queue_.erase(queue_.begin());
    if (on_sent) on_sent(item.frame);
    if (!queue_.empty()) executor_.after(std::chrono::microseconds(100), *this);
    if (item.tag != 0) listener_->sent(item.tag, executor_.now());
  }
  rt::Executor& executor_;
  can::Listener* listener_ = nullptr;
  std::vector<can::IdRange> accept_;
  std::vector<Item> queue_;
};

}  // namespace berth::fuzz
