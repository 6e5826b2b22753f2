// The clients' thread: who waits for what. Internal to room `mqtt`.
#pragma once

#include <sys/epoll.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "berth/base/bell.hpp"
#include "berth/mqtt/dock.hpp"
#include "berth/mqtt/names.hpp"
#include "berth/mqtt/tls_cache.hpp"

namespace berth::mqtt {

class Core;
using Clock = std::chrono::steady_clock;
using Time = Clock::time_point;

class Hub {
 public:
  Hub();
  ~Hub();
  Hub(const Hub&) = delete;
  Hub& operator=(const Hub&) = delete;
  /// False: the system refused.
  [[nodiscard]] bool start() noexcept;

  // Any thread.
  void join(std::shared_ptr<Core> core);
  /// The core ends, and is let go when it has. `wake` must not be called for it any more, except by itself.
  void leave(std::shared_ptr<Core> core);
  /// `Core::work` is called soon. Takes no lock.
  void wake(Core& core) noexcept;
  [[nodiscard]] bool is_here() const noexcept { return std::this_thread::get_id() == thread_.get_id(); }

  // This thread.
  bool watch(Core& core, int fd, std::uint32_t events) noexcept;
  void change(Core& core, int fd, std::uint32_t events) noexcept;
  void forget(int fd) noexcept;
  /// `Core::work` is called at `Core::due`, which is not before `at`.
  void due(Time at) noexcept { next_due_ = std::min(next_due_, at); }
  /// `Core::work` is called when a name is known.
  void await_name() noexcept { awaits_name_ = true; }
  [[nodiscard]] Names& names() noexcept { return names_; }
  [[nodiscard]] TlsCache& tls() noexcept { return tls_; }
  [[nodiscard]] const Dock& dock() const noexcept { return dock_; }

 private:
  void run() noexcept;
  [[nodiscard]] int patience() const noexcept;
  void answer_bell(Time now) noexcept;
  void let_in(Time now) noexcept;
  void work_woken(Time now) noexcept;
  void work_due(Time now) noexcept;
  void let_go(Time now) noexcept;

  int epoll_;
  std::shared_ptr<Bell> bell_;
  Names names_;
  TlsCache tls_;
  Dock dock_;
  bool awaits_name_ = false;
  std::vector<std::shared_ptr<Core>> cores_;
  std::vector<std::shared_ptr<Core>> going_;  // of cores_: their clients are being destroyed
  Time next_due_ = Time::max();

  std::atomic<Core*> woken_{nullptr};  // a stack, in which each core stands once at most
  std::atomic<bool> stop_{false};
  std::mutex door_;  // of joining_ and leaving_
  std::vector<std::shared_ptr<Core>> joining_;
  std::vector<std::shared_ptr<Core>> leaving_;
  std::thread thread_;
};

}  // namespace berth::mqtt
