/// The thread that clients live on: one client, or a thousand (bench: tests/mqtt/many_test.cpp).
///
///     auto thread = mqtt::Thread::start();
///     auto client = mqtt::Client::start(**thread, options, random, handler);
///
/// It waits by epoll for all of its clients, and no client makes another wait: libmosquitto is used without blocking,
/// names are looked up elsewhere, and each client gets one turn after another. It blocks all signals.
///
/// A client takes five file descriptors while it is connected: its socket, a pair between it and libmosquitto, and
/// another pair that libmosquitto makes, does not need here, and fills with up to 208 KiB in the kernel.
#pragma once

#include <memory>
#include <string>
#include <tl/expected.hpp>

namespace berth::mqtt {

class Hub;

class Thread {
 public:
  /// Errors as text: the system has no thread or no descriptors.
  [[nodiscard]] static tl::expected<std::unique_ptr<Thread>, std::string> start();
  /// Its clients must have been destroyed. Joins.
  ~Thread();
  Thread(const Thread&) = delete;
  Thread& operator=(const Thread&) = delete;

 private:
  friend class Client;
  explicit Thread(std::unique_ptr<Hub> hub) noexcept;
  std::unique_ptr<Hub> hub_;
};

}  // namespace berth::mqtt
