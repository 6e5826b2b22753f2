#include "berth/rt/task.hpp"

#include <array>
#include <new>

namespace berth::rt::detail {

#if defined(BERTH_SANITIZED)

void* allocate_frame(std::size_t size) { return ::operator new(size); }
void free_frame(void* frame, std::size_t) noexcept { ::operator delete(frame); }

#else

namespace {

// Free lists by size class of 64 bytes, up to 1 KiB; larger frames go to the heap. Each thread has its own, for one
// executor. A list keeps as many frames as the work of some buses needs: thousands of nodes are asked at once only at
// the start.
constexpr std::size_t step = 64;
constexpr std::size_t classes = 16;
constexpr std::size_t most_kept = 256;  // frames of each class
struct Free {
  Free* next;
};
struct List {
  Free* first = nullptr;
  std::size_t room = most_kept;
};
struct Pool {
  std::array<List, classes> lists{};
  ~Pool() {
    for (auto& list : lists) {
      while (list.first != nullptr) ::operator delete(std::exchange(list.first, list.first->next));
    }
  }
};
thread_local Pool pool;

constexpr std::size_t class_of(std::size_t size) noexcept { return (size + step - 1) / step - 1; }

}  // namespace

void* allocate_frame(std::size_t size) {
  const auto which = class_of(size);
  if (which >= classes) return ::operator new(size);
  auto& list = pool.lists[which];
  if (list.first == nullptr) return ::operator new((which + 1) * step);
  ++list.room;
  return std::exchange(list.first, list.first->next);
}

void free_frame(void* frame, std::size_t size) noexcept {
  const auto which = class_of(size);
  if (which >= classes) return ::operator delete(frame);
  auto& list = pool.lists[which];
  if (list.room == 0) return ::operator delete(frame);
  --list.room;
  list.first = new (frame) Free{list.first};
}

#endif

}  // namespace berth::rt::detail
