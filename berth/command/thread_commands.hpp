/// The command buffer of paper 5 §4 for an application in another thread than the manager's executor: a run-time
/// system's, say. Any number of threads may fill it.
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
  /// Of the executor's thread, as its destructor. `session` and `loop` must stay, and no thread may use it any more
  /// when it is destroyed.
  ThreadCommands(tree::Session& session, io::Loop& loop);
  ~ThreadCommands();
  ThreadCommands(const ThreadCommands&) = delete;
  ThreadCommands& operator=(const ThreadCommands&) = delete;

  /// False when the system refused to make what wakes the loop; then nothing is carried out.
  [[nodiscard]] bool good() const noexcept { return wake_ >= 0; }

  /// @name Any thread. Each waits for a lock that is held for the time of a few instructions
  /// @{
  /// Its number, from 1. Empty: `CommandBuffer::most` wait, are carried out, or are confirmed and were not taken.
  std::optional<std::uint32_t> put(Request request);
  /// The oldest confirmation that was not taken yet.
  std::optional<CommandBuffer::Confirmation> take();
  /// The same, and waits for one. Empty: there was none for so long.
  std::optional<CommandBuffer::Confirmation> wait(std::chrono::nanoseconds most);
  /// @}

 private:
  void ready(std::uint32_t events) noexcept override;
  void confirmed();
  std::optional<CommandBuffer::Confirmation> take_locked();

  CommandBuffer buffer_;
  io::Loop& loop_;
  int wake_ = -1;
  std::map<std::uint32_t, std::uint32_t> numbers_;  // of the buffer's, ours; the executor's thread

  std::mutex lock_;
  std::condition_variable confirmation_;
  std::deque<std::pair<std::uint32_t, Request>> waiting_;
  std::deque<CommandBuffer::Confirmation> confirmed_;
  std::uint32_t last_ = 0;
  std::size_t not_taken_ = 0;
};

}  // namespace berth::command
