#include "berth/io/kernel_queue.hpp"

#include <sys/epoll.h>

#include <algorithm>

namespace berth::io {

using namespace std::chrono_literals;

can::Queued KernelQueue::push(const can::Frame& frame, std::uint32_t tag) noexcept {
  // Frames are written when the job that sends them is over. By then, a service that announces itself has also said
  // what it wants to hear, and the answer passes the kernel's filter.
  if (waiting_.empty()) write_.post();
  if (waiting_.size() >= depth_ && !stuck_) flush();
  if (waiting_.size() >= depth_) return can::Queued::full;
  waiting_.push_back({frame, tag});
  return can::Queued::yes;
}

void KernelQueue::withdraw(std::uint32_t tag) noexcept {
  std::erase_if(waiting_, [tag](const Given& g) { return g.tag == tag; });
}

void KernelQueue::clear() noexcept {
  waiting_.clear();
  stuck_ = false;
  retry_.cancel();
  write_.cancel();
  if (socket_->fd() >= 0) try_when_writable(false);
}

void KernelQueue::try_later() noexcept { retry_.arm(std::max<rt::Duration>(status_->frame_time(), 250us)); }

void KernelQueue::try_when_writable(bool on) noexcept {
  if (watches_out_ == on) return;
  watches_out_ = loop_->watch(socket_->fd(), *watcher_, on ? EPOLLIN | EPOLLOUT : EPOLLIN) && on;
  if (on && !watches_out_) try_later();
}

void KernelQueue::flush() noexcept {
  stuck_ = true;  // false again when all is written
  while (!waiting_.empty() && status_->now().up && !status_->now().bus_off) {
    KernelFrame bytes;
    const std::size_t size = encode_frame(waiting_.front().frame, bytes);
    switch (socket_->write(bytes, size)) {
      case CanSocket::Wrote::yes: owner_->wrote(waiting_.front().frame, waiting_.front().tag); break;
      case CanSocket::Wrote::full: return try_later();
      case CanSocket::Wrote::waiting: return try_when_writable(true);
      case CanSocket::Wrote::down: return owner_->goes_down();
      case CanSocket::Wrote::refused: break;
    }
    waiting_.pop_front();
  }
  stuck_ = false;
  try_when_writable(false);
}

}  // namespace berth::io
