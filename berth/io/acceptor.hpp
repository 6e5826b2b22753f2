/// Accepts the connections of a listening socket, in an `io::Loop`.
#pragma once

#include <functional>

#include "berth/io/loop.hpp"

namespace berth::io {

class Acceptor final : private Watcher, private rt::Job {
 public:
  /// Owns `fd`, a listening, non-blocking socket (`listen_tcp`). `take` gets each connection's descriptor,
  /// non-blocking, and owns it. If the system has no descriptors left, it accepts nothing for a second; else the loop
  /// would never sleep.
  Acceptor(Loop& loop, int fd, std::function<void(int)> take);
  ~Acceptor();
  Acceptor(const Acceptor&) = delete;
  Acceptor& operator=(const Acceptor&) = delete;

 private:
  void ready(std::uint32_t events) noexcept override;
  void run() noexcept override;
  Loop* loop_;
  int fd_;
  std::function<void(int)> take_;
};

}  // namespace berth::io
