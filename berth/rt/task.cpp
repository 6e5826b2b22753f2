#include "berth/rt/task.hpp"

#include <array>
#include <new>

namespace berth::rt::detail {

#if defined(BERTH_SANITIZED)

void* allocate_frame(std::size_t size) { return ::operator new(size); }
void free_frame(void* frame, std::size_t) noexcept { ::operator delete(frame); }

#else

namespace {

// Free lists by size class of 64 bytes, up to 1 KiB; larger frames go to the heap. One executor's thread each.
constexpr std::size_t step = 64;
constexpr std::size_t classes = 16;
struct Free {
  Free* next;
};
struct Pool {
  std::array<Free*, classes> lists{};
  ~Pool() {
    for (auto* list : lists) {
      while (list != nullptr) ::operator delete(std::exchange(list, list->next));
    }
  }
};
thread_local Pool pool;

constexpr std::size_t class_of(std::size_t size) noexcept { return (size + step - 1) / step - 1; }

}  // namespace

void* allocate_frame(std::size_t size) {
  const auto which = class_of(size);
  if (which >= classes) return ::operator new(size);
  auto*& list = pool.lists[which];
  if (list == nullptr) return ::operator new((which + 1) * step);
  return std::exchange(list, list->next);
}

void free_frame(void* frame, std::size_t size) noexcept {
  const auto which = class_of(size);
  if (which >= classes) return ::operator delete(frame);
  auto*& list = pool.lists[which];
  list = new (frame) Free{list};
}

#endif

}  // namespace berth::rt::detail
