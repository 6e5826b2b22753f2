#include "berth/script/meter_parts.hpp"

#include <time.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <utility>

namespace berth::script {
namespace {

// Of this thread only: the time of other processes does not count.
std::chrono::nanoseconds processor_time() noexcept {
  timespec time{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
}

}  // namespace

Meter::Meter(const Limits& limits, std::function<bool()> must_end) : limits_(limits), must_end_(std::move(must_end)) {
  begin();
}

void Meter::begin() noexcept {
  left_ = limits_.instructions;
  look_at_ = left_ - looked_after;
  began_ = std::chrono::nanoseconds{0};
  end_ = End::none;
}

bool Meter::refuse(End why) noexcept {
  end_ = why;
  return false;
}

// A short call never reads the clock: the first check starts the count.
void Meter::ask_host() noexcept {
  const auto now = processor_time();
  if (began_.count() == 0) began_ = now;
  const bool too_long = now - began_ > limits_.processor;
  if (!too_long && !(must_end_ && must_end_())) return;
  end_ = too_long ? End::processor : End::host;
  left_ = std::numeric_limits<std::int64_t>::min() / 2;
}

void Meter::look() noexcept {
  if (left_ > look_at_) return;
  look_at_ = left_ - looked_after;
  ask_host();
}

bool Meter::compile_byte() noexcept {
  if (++compiled_ % looked_after == 0) ask_host();
  return !over();
}

bool Meter::run(unsigned instructions) noexcept {
  if (!bound_) return true;
  left_ -= weight_ * instructions;
  if (!over()) look();
  return !over();
}

bool Meter::may_take(std::size_t had, std::size_t size) noexcept {
  if (over()) return false;
  charge((size - had) / bytes_an_instruction);
  if (size <= limits_.block && used_ - had + size <= limits_.memory) return true;
  // Lua collects all of its memory before it tries again.
  charge(used_ / bytes_an_instruction);
  return refuse(size > limits_.block ? End::block : End::memory);
}

void* Meter::allocate(void* old, std::size_t old_size, std::size_t size, bool text) noexcept {
  const std::size_t had = old == nullptr ? 0 : old_size;
  if (size == 0) {
    give_back(old, had);
    return nullptr;
  }
  if (bound_ && size > had && !may_take(had, size)) return nullptr;
  const bool stack = old != nullptr && old == stack_;
  void* const fresh = std::realloc(old, size);
  if (fresh == nullptr) return nullptr;
  used_ += size - had;
  newest_ = {fresh, size};
  if (text) longest_text_ = std::max(longest_text_, size);
  if (stack) move_stack();
  if (text) weigh();
  return fresh;
}

// Lua allocates the larger stack, copies, and then frees the smaller one.
void Meter::give_back(void* old, std::size_t size) noexcept {
  const bool stack = old != nullptr && (finding_stack_ || old == stack_);
  std::free(old);
  used_ -= size;
  if (stack) move_stack();
}

void Meter::move_stack() noexcept {
  stack_ = newest_.at;
  stack_size_ = newest_.size;
  weigh();
}

// The cost of an operator grows with the longest text (`<`, `==`), and with the square of the number of values on the
// stack (a chain of __call moves them once for each of its tables).
void Meter::weigh() noexcept {
  const auto deep = static_cast<std::int64_t>(stack_size_ / bytes_of_stack);
  weight_ = 1 + static_cast<std::int64_t>(longest_text_ / bytes_of_text) + deep * deep;
}

}  // namespace berth::script
