/// The command buffer of paper 5 §4 for an application in another thread than the manager's executor, for example a
/// run-time system. Any number of threads may fill it.
///
///     command::ThreadCommands commands(session, loop);              // the executor's thread
///
///     const auto number = commands.put({"configure", {{"slot", "press"}}});     // any thread
///     while (const auto done = commands.wait(1s)) use(done->number, done->reply.status, done->reply.json);
///
/// An application in another process has the control socket, which takes the same requests (docs/api.md).
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>

#include "berth/command/command_buffer.hpp"
#include "berth/io/loop.hpp"

namespace berth::command {

class ThreadCommands final : private io::Watcher {
 public:
  /// Call it in the executor's thread, like the destructor. `session` and `loop` must outlive this, and no thread may
  /// use it while it is destroyed.
  ThreadCommands(tree::Session& session, io::Loop& loop);
  ~ThreadCommands();
  ThreadCommands(const ThreadCommands&) = delete;
  ThreadCommands& operator=(const ThreadCommands&) = delete;

  /// False if the system could not create the loop's wake-up; then nothing is carried out.
  [[nodiscard]] bool good() const noexcept { return wake_ >= 0; }

  /// @name Any thread. Each waits for a lock that is only held for a few instructions
  /// @{
  /// Returns its number, from 1. Empty: `CommandBuffer::most` commands wait, are being carried out, or have
  /// confirmations not taken.
  std::optional<std::uint32_t> put(Request request);
  /// The oldest confirmation not taken yet.
  std::optional<CommandBuffer::Confirmation> take();
  /// The same, but waits for one. Empty: none came within `most`.
  std::optional<CommandBuffer::Confirmation> wait(std::chrono::nanoseconds most);
  /// @}

 private:
  void ready(std::uint32_t events) noexcept override;
  void confirmed();
  std::optional<CommandBuffer::Confirmation> take_locked();

  CommandBuffer buffer_;
  io::Loop& loop_;
  int wake_ = -1;
  std::map<std::uint32_t, std::uint32_t> numbers_;  // from the buffer's to ours; the executor's thread

  std::mutex lock_;
  std::condition_variable confirmation_;
  std::deque<std::pair<std::uint32_t, Request>> waiting_;
  std::deque<CommandBuffer::Confirmation> confirmed_;
  std::uint32_t last_ = 0;
  std::size_t not_taken_ = 0;
};

}  // namespace berth::command
