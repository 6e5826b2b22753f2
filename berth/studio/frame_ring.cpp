#include "berth/studio/frame_ring.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

namespace berth::studio {
namespace {

constexpr std::uint64_t extended_bit = std::uint64_t{1} << 31U;
constexpr std::uint64_t remote_bit = std::uint64_t{1} << 30U;
constexpr std::uint64_t error_bit = std::uint64_t{1} << 29U;
constexpr unsigned bus_at = 32;
constexpr unsigned size_at = 40;
constexpr std::uint64_t size_mask = 0x7F;
constexpr std::uint64_t fd_bit = std::uint64_t{1} << 47U;
constexpr std::uint64_t own_bit = std::uint64_t{1} << 48U;
constexpr std::uint64_t brs_bit = std::uint64_t{1} << 49U;
constexpr std::uint64_t esi_bit = std::uint64_t{1} << 50U;
constexpr unsigned words_at = 51;  // of an error: 0, or the number of its words, from 1
static_assert(FrameRing::most_words < std::size_t{1} << (64U - words_at));

std::uint64_t head_of(std::uint8_t bus, const can::Frame& frame, bool own) noexcept {
  std::uint64_t head = frame.id | std::uint64_t{bus} << bus_at;
  head |= std::uint64_t{frame.size} << size_at;
  if (frame.extended) head |= extended_bit;
  if (frame.remote) head |= remote_bit;
  if (own) head |= own_bit;
  if (!frame.fd) return head;
  return head | fd_bit | (frame.brs ? brs_bit : 0) | (frame.esi ? esi_bit : 0);
}

std::uint8_t size_of(std::uint64_t head) noexcept { return static_cast<std::uint8_t>(head >> size_at & size_mask); }

can::Frame frame_of(std::uint64_t head, std::uint64_t data) noexcept {
  can::Frame frame;
  frame.id = static_cast<std::uint32_t>(head) & can::extended_mask;
  frame.extended = (head & extended_bit) != 0;
  frame.remote = (head & remote_bit) != 0;
  frame.size = std::min<std::uint8_t>(size_of(head), 8);
  std::memcpy(frame.data.data(), &data, sizeof data);
  return frame;
}

}  // namespace

FrameRing::FrameRing(std::size_t most)
    : records_(std::bit_ceil(std::max<std::size_t>(most, 1))),
      rests_(std::max<std::size_t>(records_.size() / 16, 1)),
      words_(most_words) {}

void FrameRing::put(std::uint8_t bus, const can::Frame& frame, rt::Time at, bool own) noexcept {
  if (frame.size > 8) [[unlikely]]
    put_rest(next_.load(std::memory_order_relaxed), frame);
  put(head_of(bus, frame, own), at, frame);
}

void FrameRing::put_error(std::uint8_t bus, const can::Frame& report, rt::Time at, std::string_view about) {
  put(head_of(bus, report, false) | error_bit | word_of(about) << words_at, at, report);
}

// A reader that sees a new word also sees the stamp that was cleared before it: each word is released after the stamp
// and acquired before the stamp is read again. Fences would do the same, but tsan does not support them.
void FrameRing::put(std::uint64_t head, rt::Time at, const can::Frame& frame) noexcept {
  const std::uint64_t number = next_.load(std::memory_order_relaxed);
  Record& record = records_[number & (records_.size() - 1)];
  std::uint64_t data = 0;
  std::memcpy(&data, frame.data.data(), sizeof data);
  record.stamp.store(0, std::memory_order_relaxed);
  record.at.store(static_cast<std::uint64_t>(at.time_since_epoch().count()), std::memory_order_release);
  record.head.store(head, std::memory_order_release);
  record.data.store(data, std::memory_order_release);
  record.stamp.store(number + 1, std::memory_order_release);
  next_.store(number + 1, std::memory_order_release);
}

void FrameRing::put_rest(std::uint64_t number, const can::Frame& frame) noexcept {
  Rest& rest = rests_[number & (rests_.size() - 1)];
  rest.stamp.store(0, std::memory_order_relaxed);
  for (std::size_t i = 0; i < rest.data.size() && 8 * (i + 1) < frame.size; ++i) {
    std::uint64_t word = 0;
    std::memcpy(&word, frame.data.data() + 8 * (i + 1), std::min<std::size_t>(frame.size - 8 * (i + 1), 8));
    rest.data[i].store(word, std::memory_order_release);
  }
  rest.stamp.store(number + 1, std::memory_order_release);
}

std::uint64_t FrameRing::word_of(std::string_view about) {
  if (about.empty()) return 0;
  const auto known = known_words_.find(about);
  if (known != known_words_.end()) return known->second;
  const auto there = words_there_.load(std::memory_order_relaxed);
  if (there == words_.size()) return 0;
  words_[there] = about;
  words_there_.store(there + 1, std::memory_order_release);
  known_words_.emplace(about, there + 1);
  return there + 1;
}

std::uint64_t FrameRing::first() const noexcept {
  const std::uint64_t next = this->next();
  return next > records_.size() ? next - records_.size() : 0;
}

bool FrameRing::take(std::uint64_t number, Words& into) const noexcept {
  const Record& record = records_[number & (records_.size() - 1)];
  if (record.stamp.load(std::memory_order_acquire) != number + 1) return false;
  into.at = record.at.load(std::memory_order_acquire);
  into.head = record.head.load(std::memory_order_acquire);
  into.data = record.data.load(std::memory_order_acquire);
  if (record.stamp.load(std::memory_order_relaxed) != number + 1) return false;
  return true;
}

bool FrameRing::read(std::uint64_t number, RingFrame& into) const noexcept {
  Words words;
  if (!take(number, words)) return false;
  const std::uint64_t head = words.head;
  into.number = number;
  into.at = rt::Time(rt::Duration(static_cast<std::int64_t>(words.at)));
  into.bus = static_cast<std::uint8_t>(head >> bus_at);
  into.own = (head & own_bit) != 0;
  into.cut = size_of(head) > 8;
  into.fd = (head & fd_bit) != 0;
  into.error = (head & error_bit) != 0;
  into.about = {};
  if (const auto word = head >> words_at;
      into.error && word > 0 && word <= words_there_.load(std::memory_order_acquire))
    into.about = words_[word - 1];
  into.frame = frame_of(head, words.data);
  return true;
}

bool FrameRing::whole(std::uint64_t number, can::Frame& into) const noexcept {
  Words words;
  if (!take(number, words)) return false;
  const std::uint64_t head = words.head;
  const Rest& rest = rests_[number & (rests_.size() - 1)];
  into = frame_of(head, words.data);
  const std::size_t size = size_of(head);
  into.fd = (head & fd_bit) != 0;
  into.brs = (head & brs_bit) != 0;
  into.esi = (head & esi_bit) != 0;
  if (size <= 8) return true;
  if (rest.stamp.load(std::memory_order_acquire) != number + 1) return false;
  for (std::size_t i = 0; 8 * (i + 1) < size && i < rest.data.size(); ++i) {
    const auto word = rest.data[i].load(std::memory_order_acquire);
    std::memcpy(into.data.data() + 8 * (i + 1), &word, std::min<std::size_t>(size - 8 * (i + 1), 8));
  }
  into.size = static_cast<std::uint8_t>(size);
  return rest.stamp.load(std::memory_order_relaxed) == number + 1;
}

}  // namespace berth::studio
