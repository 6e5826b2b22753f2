/// The nodes of one segment that have a frame to send, in the order in which they win arbitration, and how often each
/// has lost it; `Segment::arbitrate` uses it. Nodes are slots here. Internal to `sim`.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace berth::sim {

class Contenders {
 public:
  /// Arbitration field and slot as one number, so that one comparison orders them.
  struct Contender {
    std::uint64_t order = 0;
    [[nodiscard]] std::uint32_t arbitration() const noexcept { return static_cast<std::uint32_t>(order >> 32U); }
    [[nodiscard]] std::uint32_t slot() const noexcept { return static_cast<std::uint32_t>(order); }
  };

  /// Sets the number of slots.
  void grow(std::size_t slots) {
    places_.resize(slots);
    heap_.resize(slots);
  }

  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  [[nodiscard]] bool contains(std::uint32_t slot) const noexcept { return places_[slot].at != nowhere; }
  [[nodiscard]] std::span<const Contender> all() const noexcept { return {heap_.data(), count_}; }
  /// The winner; of several with one arbitration field, that of the lowest slot.
  [[nodiscard]] Contender first() const noexcept { return heap_.front(); }
  /// True if only `first` wins.
  [[nodiscard]] bool one_wins() const noexcept {
    // Few share the lowest field, and they are at the top: the parents of one with the lowest value also have it.
    const std::uint32_t best = heap_.front().arbitration();
    return (count_ < 2 || heap_[1].arbitration() != best) && (count_ < 3 || heap_[2].arbitration() != best);
  }
  /// The slot offers a frame with this arbitration field: as a new contender, or instead of its former frame.
  void put(std::uint32_t slot, std::uint32_t arbitration) noexcept;
  /// The slot offers nothing more. Returns its losses since the last query; 0 for one that did not contend.
  std::uint64_t remove(std::uint32_t slot) noexcept;

  /// Number of frames begun.
  [[nodiscard]] std::uint64_t starts() const noexcept { return starts_; }
  /// Counts a start: a contender that does not begin it (`begin`, `excuse`) loses.
  void count_start() noexcept { ++starts_; }
  /// The slot also began the newest frame; returns its losses until then since the last query.
  std::uint64_t begin(std::uint32_t slot) noexcept {
    const std::uint64_t lost = starts_ - 1 - places_[slot].since;
    places_[slot].since = starts_;
    return lost;
  }
  /// The slot does not lose the next start, because it may not begin yet.
  void excuse(std::uint32_t slot) noexcept { ++places_[slot].since; }
  /// The slot offered its frame in time for the newest start.
  void in_time(std::uint32_t slot) noexcept { places_[slot].since = std::min(places_[slot].since, starts_ - 1); }
  [[nodiscard]] bool was_in_time(std::uint32_t slot) const noexcept { return places_[slot].since < starts_; }
  /// Its losses since the last query.
  [[nodiscard]] std::uint64_t take_losses(std::uint32_t slot) noexcept {
    return starts_ - std::exchange(places_[slot].since, starts_);
  }

 private:
  static constexpr std::uint32_t nowhere = 0xFFFF'FFFFU;
  struct Place {
    std::uint64_t since = 0;  // starts_ at the last query of its losses
    std::uint32_t at = nowhere;
  };
  void place(std::size_t at, Contender contender) noexcept;
  void rise(std::size_t at, Contender moving) noexcept;
  void sink(std::size_t at, Contender moving) noexcept;

  std::vector<Contender> heap_;  // the first `count_` of it
  std::size_t count_ = 0;
  std::vector<Place> places_;  // by slot
  std::uint64_t starts_ = 0;
};

}  // namespace berth::sim
