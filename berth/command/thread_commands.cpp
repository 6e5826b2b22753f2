#include "berth/command/thread_commands.hpp"
#include "berth/command/confirm.hpp"

#include <sys/eventfd.h>
#include <unistd.h>

#include <utility>

namespace berth::command {

ThreadCommands::ThreadCommands(tree::Session& session, io::Loop& loop)
    : buffer_(session), loop_(loop), wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  buffer_.on_confirmation([this] { confirmed(); });
  if (wake_ < 0 || loop_.watch(wake_, *this, EPOLLIN)) return;
  ::close(wake_);
  wake_ = -1;
}

ThreadCommands::~ThreadCommands() {
  buffer_.on_confirmation({});
  if (wake_ < 0) return;
  loop_.forget(wake_);
  ::close(wake_);
}

std::optional<std::uint32_t> ThreadCommands::put(Request request) {
  std::uint32_t number = 0;
  {
    const std::lock_guard hold(lock_);
    if (not_taken_ >= CommandBuffer::most) return std::nullopt;
    ++not_taken_;
    number = ++last_;
    waiting_.emplace_back(number, std::move(request));
  }
  const std::uint64_t one = 1;
  // The write fails only if the counter would exceed 2^64 - 2; the loop has been woken by then.
  static_cast<void>(!::write(wake_, &one, sizeof(one)));
  return number;
}

std::optional<CommandBuffer::Confirmation> ThreadCommands::take_locked() {
  if (confirmed_.empty()) return std::nullopt;
  auto oldest = std::move(confirmed_.front());
  confirmed_.pop_front();
  --not_taken_;
  return oldest;
}

std::optional<CommandBuffer::Confirmation> ThreadCommands::take() {
  const std::lock_guard hold(lock_);
  return take_locked();
}

std::optional<CommandBuffer::Confirmation> ThreadCommands::wait(std::chrono::nanoseconds most) {
  std::unique_lock hold(lock_);
  confirmation_.wait_for(hold, most, [this] { return !confirmed_.empty(); });
  return take_locked();
}

void ThreadCommands::ready(std::uint32_t) noexcept {
  std::uint64_t count = 0;
  static_cast<void>(!::read(wake_, &count, sizeof(count)));
  std::deque<std::pair<std::uint32_t, Request>> came;
  {
    const std::lock_guard hold(lock_);
    came.swap(waiting_);
  }
  // The buffer has room: `put` accepts no more requests than it holds until their confirmations are taken.
  for (auto& [number, request] : came) {
    if (const auto its = buffer_.put(std::move(request))) numbers_.emplace(*its, number);
  }
}

void ThreadCommands::confirmed() {
  while (auto done = buffer_.take()) {
    const auto ours = numbers_.find(done->number);
    if (ours == numbers_.end()) continue;
    done->number = ours->second;
    numbers_.erase(ours);
    const std::lock_guard hold(lock_);
    confirmed_.push_back(std::move(*done));
  }
  confirmation_.notify_all();
}

}  // namespace berth::command
