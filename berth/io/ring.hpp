/// A queue that reuses its room: grows, never shrinks, and after that needs no heap. Inside of room `io`.
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
  /// A new last one, which holds whatever its place held before.
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
