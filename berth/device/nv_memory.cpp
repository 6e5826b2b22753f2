#include "berth/device/nv_memory.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "berth/base/bytes.hpp"
#include "berth/base/crc.hpp"

namespace berth::device {

bool NvRecord::read_slot(unsigned slot, std::span<std::uint8_t> into, std::uint32_t& sequence) const noexcept {
  std::array<std::uint8_t, most + 9> raw{};
  const std::span bytes(raw.data(), slot_size());
  memory_->read(at_ + slot * slot_size(), bytes);
  const auto body = bytes.first(payload_ + 5);
  if (load_le<std::uint32_t>(raw.data() + body.size()) != crc32(body) || raw[4] != payload_) return false;
  sequence = load_le<std::uint32_t>(raw.data());
  std::copy_n(raw.begin() + 5, std::min<std::size_t>(into.size(), payload_), into.begin());
  return true;
}

bool NvRecord::load(std::span<std::uint8_t> into) noexcept {
  std::array<std::uint8_t, most> other{};
  std::uint32_t first = 0;
  std::uint32_t second = 0;
  const bool has_first = read_slot(0, into, first);
  const bool has_second = read_slot(1, other, second);
  sequence_ = 0;
  slot_ = 1;
  if (!has_first && !has_second) return false;
  // The difference shows which is newer, so that the number may wrap.
  const bool take_second = has_second && (!has_first || static_cast<std::int32_t>(second - first) > 0);
  if (take_second) std::copy_n(other.begin(), std::min<std::size_t>(into.size(), payload_), into.begin());
  slot_ = take_second ? 1 : 0;
  sequence_ = take_second ? second : first;
  return true;
}

bool NvRecord::save(std::span<const std::uint8_t> payload, NvMemory::Done& done) noexcept {
  if (busy() || payload.size() != payload_) return false;
  store_le<std::uint32_t>(buffer_.data(), sequence_ + 1);
  buffer_[4] = payload_;
  std::copy(payload.begin(), payload.end(), buffer_.begin() + 5);
  const std::span body(buffer_.data(), payload_ + 5);
  store_le<std::uint32_t>(buffer_.data() + body.size(), crc32(body));
  done_ = &done;  // set before the write: power may fail when it begins, and `forget` must find it
  if (memory_->write(at_ + (1 - slot_) * slot_size(), std::span(buffer_.data(), slot_size()), *this)) return true;
  done_ = nullptr;
  return false;
}

void NvRecord::forget() noexcept {
  memory_->forget();
  done_ = nullptr;
}

void NvRecord::written(bool ok) noexcept {
  if (ok) {
    slot_ = slot_ == 0 ? 1 : 0;
    ++sequence_;
  }
  std::exchange(done_, nullptr)->written(ok);
}

SimFlash::SimFlash(rt::Executor& executor, std::size_t size, rt::Duration duration)
    : executor_(&executor), duration_(duration), size_(size), bytes_(std::min(size, at_once), 0xFF) {}

void SimFlash::read(std::size_t at, std::span<std::uint8_t> into) const noexcept {
  std::ranges::fill(into, std::uint8_t{0xFF});
  if (at >= bytes_.size()) return;
  std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at), std::min(into.size(), bytes_.size() - at),
              into.begin());
}

bool SimFlash::write(std::size_t at, std::span<const std::uint8_t> bytes, Done& done) noexcept {
  const rt::Duration takes = duration_ + static_cast<std::int64_t>(bytes.size()) * times_.byte;
  if (!begin(at, bytes.size(), takes, done)) return false;
  source_ = bytes;
  return true;
}

bool SimFlash::erase(std::size_t at, std::size_t count, Done& done) noexcept {
  const std::size_t sectors = (count + times_.sector_size - 1) / times_.sector_size;
  if (!begin(at, count, static_cast<std::int64_t>(sectors) * times_.sector, done)) return false;
  source_ = {};
  return true;
}

bool SimFlash::begin(std::size_t at, std::size_t count, rt::Duration takes, Done& done) noexcept {
  if (writing() || at > size_ || count > size_ - at) return false;
  done_ = &done;
  at_ = at;
  count_ = count;
  put_ = 0;
  takes_ = takes;
  began_ = executor_->now();
  ++begun_;
  executor_->after(takes, *this);
  if (watcher_ != nullptr) watcher_->write_began();
  return true;
}

void SimFlash::put(std::size_t count) noexcept {
  if (broken_) return;
  const bool erases = source_.empty();
  if (!erases && at_ + count > bytes_.size()) bytes_.resize(at_ + count, 0xFF);
  for (; put_ < count; ++put_) {
    const std::size_t at = at_ + put_;
    if (cuts_ && left_ == 0) {
      if (torn_ >= 0 && at < bytes_.size()) bytes_[at] = static_cast<std::uint8_t>(torn_);
      return;
    }
    if (!erases) bytes_[at] = source_[put_];
    if (erases && at < bytes_.size()) bytes_[at] = 0xFF;
    if (cuts_) --left_;
  }
}

void SimFlash::forget() noexcept {
  if (!writing()) return;
  cancel();
  const auto passed = executor_->now() - began_;
  const auto share =
      takes_.count() > 0 ? static_cast<double>(passed.count()) / static_cast<double>(takes_.count()) : 0.0;
  put(std::min(count_, static_cast<std::size_t>(share * static_cast<double>(count_))));
  done_ = nullptr;
}

void SimFlash::run() noexcept {
  if (!writing()) return;
  put(count_);
  if (!broken_ && put_ < count_) {
    done_ = nullptr;
    cuts_ = false;
    if (watcher_ != nullptr) watcher_->cut();
    return;
  }
  if (!broken_) ++ended_;
  if (watcher_ != nullptr) watcher_->write_ended();
  // The watcher may have cut the power: then the device does not hear of the end.
  if (done_ != nullptr) std::exchange(done_, nullptr)->written(!broken_);
}

void SimFlash::cut_after(std::uint64_t bytes, int torn) noexcept {
  cuts_ = true;
  left_ = bytes;
  torn_ = torn;
}

void SimFlash::restore(std::span<const std::uint8_t> image) noexcept {
  const auto taken = image.first(std::min(image.size(), size_));
  erase();
  if (taken.size() > bytes_.size()) bytes_.resize(taken.size());
  std::ranges::copy(taken, bytes_.begin());
}

void SimFlash::erase(std::size_t count) noexcept {
  std::ranges::fill(std::span(bytes_).first(std::min(count, bytes_.size())), std::uint8_t{0xFF});
}

}  // namespace berth::device
