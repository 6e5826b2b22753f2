/// The thread of `fleet::Thread`. Internal to room `fleet`.
#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "berth/base/bell.hpp"
#include "berth/mqtt/thread.hpp"

namespace berth::fleet {

/// Has work now and then.
class Turner {
 public:
  /// Does what there is; gives the longest time until the next call.
  virtual std::chrono::milliseconds turn() noexcept = 0;

 protected:
  ~Turner() = default;
};

class Hub {
 public:
  explicit Hub(std::unique_ptr<mqtt::Thread> connections);
  ~Hub();
  Hub(const Hub&) = delete;
  Hub& operator=(const Hub&) = delete;
  [[nodiscard]] bool start() noexcept;

  // Any thread.
  void join(Turner& turner);
  /// It is not called any more when this returns. Not from within `turn`.
  void leave(Turner& turner);
  /// All are called soon. Never waits.
  void wake() const noexcept { bell_.ring(); }
  [[nodiscard]] mqtt::Thread& connections() noexcept { return *connections_; }

 private:
  void run() noexcept;

  std::unique_ptr<mqtt::Thread> connections_;
  Bell bell_;
  std::mutex door_;  // of turners_, held while they are called
  std::vector<Turner*> turners_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace berth::fleet
