/// A queue that reuses its memory: it grows but never shrinks, and then needs no heap. Internal to room `io`.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace berth::io {

template <class T>
class Ring {
 public:
  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] T& front() noexcept { return places_[first_]; }
  /// Adds an element at the end; it holds the old content of its place.
  [[nodiscard]] T& push() {
    if (size_ == places_.size()) grow();
    return places_[(first_ + size_++) & (places_.size() - 1)];
  }
  void pop() noexcept {
    first_ = (first_ + 1) & (places_.size() - 1);
    --size_;
  }
  void clear() noexcept { first_ = size_ = 0; }

 private:
  void grow() {
    std::vector<T> larger(places_.empty() ? 8 : places_.size() * 2);
    for (std::size_t i = 0; i < size_; ++i) larger[i] = std::move(places_[(first_ + i) & (places_.size() - 1)]);
    places_.swap(larger);
    first_ = 0;
  }
  std::vector<T> places_;  // a power of two
  std::size_t first_ = 0;
  std::size_t size_ = 0;
};

}  // namespace berth::io
