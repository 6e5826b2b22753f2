/// The timers of an executor, the earliest first. Internal to `rt`.
///
/// A heap of four children a node, and the keys stand in it: with thousands of devices the jobs themselves are in no
/// cache, and to find the next one must not look at those that it passes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "berth/rt/time.hpp"

namespace berth::rt {

class Job;

class TimerHeap {
 public:
  /// Names a timer from `add` to `remove`.
  using Handle = std::uint32_t;

  TimerHeap() {
    heap_.reserve(usual);
    timers_.reserve(usual);
  }

  [[nodiscard]] bool empty() const noexcept { return heap_.empty(); }
  /// The time of the first one; `never`: there is none.
  [[nodiscard]] Time earliest() const noexcept { return earliest_; }
  /// Of the first one.
  [[nodiscard]] Job& job() const noexcept { return *timers_[heap_.front().handle].job; }
  [[nodiscard]] std::uint64_t order() const noexcept { return heap_.front().order; }
  [[nodiscard]] Time time(Handle handle) const noexcept { return heap_[timers_[handle].place].time; }

  /// Of equal times the lower `order` is the earlier.
  Handle add(Time time, std::uint64_t order, Job& job);
  void remove(Handle handle) noexcept;
  /// The first one has this time and order from now on, not earlier than it had.
  void move_first(Time time, std::uint64_t order) noexcept {
    sink(0, {time, order, heap_.front().handle});
    changed();
  }

 private:
  struct Entry {
    Time time;
    std::uint64_t order;
    Handle handle;
  };
  struct Timer {
    Job* job;             // null: free
    std::uint32_t place;  // in `heap_`; of a free one: the next free one
  };
  static constexpr std::size_t usual = 32;  // of a device; room for them is there from the beginning
  static constexpr Handle none = ~Handle{0};
  // Compared at once: that needs no branch.
  __extension__ using Whole = __int128;

  static Whole whole(const Entry& e) noexcept {
    return (static_cast<Whole>(e.time.time_since_epoch().count()) << 64U) | static_cast<Whole>(e.order);
  }
  static bool before(const Entry& a, const Entry& b) noexcept { return whole(a) < whole(b); }
  void set(std::size_t place, const Entry& entry) noexcept {
    heap_[place] = entry;
    timers_[entry.handle].place = static_cast<std::uint32_t>(place);
  }
  void changed() noexcept { earliest_ = heap_.empty() ? never : heap_.front().time; }
  [[nodiscard]] std::size_t first_of_four(std::size_t place) const noexcept;
  void rise(std::size_t place, const Entry& entry, std::size_t top) noexcept;
  void sink(std::size_t from, const Entry& entry) noexcept;

  std::vector<Entry> heap_;
  std::vector<Timer> timers_;
  Handle free_ = none;
  Time earliest_ = never;
};

// Puts `entry` at `place`, which is free, or at one above it, `top` the last.
inline void TimerHeap::rise(std::size_t place, const Entry& entry, std::size_t top) noexcept {
  while (place > top) {
    const std::size_t parent = (place - 1) / 4;
    if (!before(entry, heap_[parent])) break;
    set(place, heap_[parent]);
    place = parent;
  }
  set(place, entry);
}

// The one of four neighbours that is first. Without branches: which it is cannot be predicted.
inline std::size_t TimerHeap::first_of_four(std::size_t place) const noexcept {
  const Entry* const four = &heap_[place];
  const std::size_t low = before(four[1], four[0]) ? 1 : 0;
  const std::size_t high = before(four[3], four[2]) ? 3 : 2;
  return place + (before(four[high], four[low]) ? high : low);
}

// Puts `entry` at `from`, which is free, or at one beneath it. It came from the bottom and most likely goes back there:
// the free place sinks to the bottom first, and the entry rises from there.
inline void TimerHeap::sink(const std::size_t from, const Entry& entry) noexcept {
  const std::size_t size = heap_.size();
  std::size_t place = from;
  std::size_t child = 4 * place + 1;
  for (; child + 4 <= size; child = 4 * place + 1) {
    const std::size_t least = first_of_four(child);
    set(place, heap_[least]);
    place = least;
  }
  if (child < size) {
    std::size_t least = child;
    for (std::size_t other = child + 1; other < size; ++other) {
      if (before(heap_[other], heap_[least])) least = other;
    }
    set(place, heap_[least]);
    place = least;
  }
  rise(place, entry, from);
}

inline TimerHeap::Handle TimerHeap::add(Time time, std::uint64_t order, Job& job) {
  if (free_ == none) {
    free_ = static_cast<Handle>(timers_.size());
    timers_.push_back({nullptr, none});
  }
  const Handle handle = free_;
  Timer& timer = timers_[handle];
  free_ = timer.place;
  timer.job = &job;
  heap_.emplace_back();
  rise(heap_.size() - 1, {time, order, handle}, 0);
  changed();
  return handle;
}

inline void TimerHeap::remove(Handle handle) noexcept {
  Timer& timer = timers_[handle];
  const std::size_t place = timer.place;
  timer = {nullptr, free_};
  free_ = handle;
  const Entry last = heap_.back();
  heap_.pop_back();
  if (place == heap_.size()) {
    // It was the last.
  } else if (place > 0 && before(last, heap_[(place - 1) / 4])) {
    rise(place, last, 0);
  } else {
    sink(place, last);
  }
  changed();
}

}  // namespace berth::rt
