/// A queue of fixed length between two threads: one puts, the other takes, and neither ever waits for the other. No
/// allocation after construction (except by the items themselves).
#pragma once

#include <atomic>
#include <bit>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

namespace berth {

template <class T>
class Handover {
 public:
  /// Holds this number of items, rounded up to a power of two; at least 1.
  explicit Handover(std::size_t most) : places_(std::bit_ceil(most < 1 ? std::size_t{1} : most)) {}
  Handover(const Handover&) = delete;
  Handover& operator=(const Handover&) = delete;

  /// For the putting thread. False: it is full, and `item` is unchanged.
  [[nodiscard]] bool put(T& item) {
    const std::size_t put = put_.load(std::memory_order_relaxed);
    if (put - taken_.load(std::memory_order_acquire) == places_.size()) return false;
    places_[put & (places_.size() - 1)] = std::move(item);
    put_.store(put + 1, std::memory_order_release);
    return true;
  }
  /// For the taking thread. Empty: there is none now.
  [[nodiscard]] std::optional<T> take() {
    const std::size_t taken = taken_.load(std::memory_order_relaxed);
    if (taken == put_.load(std::memory_order_acquire)) return std::nullopt;
    T& place = places_[taken & (places_.size() - 1)];
    std::optional<T> item(std::move(place));
    place = T{};  // the taking thread frees its content
    taken_.store(taken + 1, std::memory_order_release);
    return item;
  }
  [[nodiscard]] std::size_t most() const noexcept { return places_.size(); }

 private:
  std::vector<T> places_;
  alignas(64) std::atomic<std::size_t> put_{0};    // ever
  alignas(64) std::atomic<std::size_t> taken_{0};  // ever
};

}  // namespace berth
