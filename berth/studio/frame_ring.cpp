#include "berth/studio/frame_ring.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace berth::studio {
namespace {

constexpr std::uint64_t extended_bit = std::uint64_t{1} << 31U;
constexpr std::uint64_t remote_bit = std::uint64_t{1} << 30U;
constexpr std::uint64_t cut_bit = std::uint64_t{1} << 29U;
constexpr unsigned bus_at = 32;
constexpr unsigned size_at = 40;
constexpr std::uint64_t own_bit = std::uint64_t{1} << 48U;

std::uint64_t head_of(std::uint8_t bus, const can::Frame& frame, bool own) noexcept {
  std::uint64_t head = frame.id | std::uint64_t{bus} << bus_at;
  head |= std::uint64_t{std::min<std::uint8_t>(frame.size, 8)} << size_at;
  if (frame.extended) head |= extended_bit;
  if (frame.remote) head |= remote_bit;
  if (frame.size > 8) head |= cut_bit;
  if (own) head |= own_bit;
  return head;
}

}  // namespace

FrameRing::FrameRing(std::size_t most) : records_(std::bit_ceil(std::max<std::size_t>(most, 1))) {}

// A reader that sees one of the new words sees the stamp that was cleared before it, too: each word is released behind
// the stamp and acquired before the stamp is looked at again. Fences would do the same, but tsan does not know them.
void FrameRing::put(std::uint8_t bus, const can::Frame& frame, rt::Time at, bool own) noexcept {
  const std::uint64_t number = next_.load(std::memory_order_relaxed);
  Record& record = records_[number & (records_.size() - 1)];
  std::uint64_t data = 0;
  std::memcpy(&data, frame.data.data(), sizeof data);
  record.stamp.store(0, std::memory_order_relaxed);
  record.at.store(static_cast<std::uint64_t>(at.time_since_epoch().count()), std::memory_order_release);
  record.head.store(head_of(bus, frame, own), std::memory_order_release);
  record.data.store(data, std::memory_order_release);
  record.stamp.store(number + 1, std::memory_order_release);
  next_.store(number + 1, std::memory_order_release);
}

std::uint64_t FrameRing::first() const noexcept {
  const std::uint64_t next = this->next();
  return next > records_.size() ? next - records_.size() : 0;
}

bool FrameRing::read(std::uint64_t number, RingFrame& into) const noexcept {
  const Record& record = records_[number & (records_.size() - 1)];
  if (record.stamp.load(std::memory_order_acquire) != number + 1) return false;
  const auto at = record.at.load(std::memory_order_acquire);
  const auto head = record.head.load(std::memory_order_acquire);
  const auto data = record.data.load(std::memory_order_acquire);
  if (record.stamp.load(std::memory_order_relaxed) != number + 1) return false;
  into.number = number;
  into.at = rt::Time(rt::Duration(static_cast<std::int64_t>(at)));
  into.bus = static_cast<std::uint8_t>(head >> bus_at);
  into.own = (head & own_bit) != 0;
  into.cut = (head & cut_bit) != 0;
  into.frame = can::Frame();
  into.frame.id = static_cast<std::uint32_t>(head) & can::extended_mask;
  into.frame.extended = (head & extended_bit) != 0;
  into.frame.remote = (head & remote_bit) != 0;
  into.frame.size = static_cast<std::uint8_t>(head >> size_at);
  std::memcpy(into.frame.data.data(), &data, sizeof data);
  return true;
}

}  // namespace berth::studio
