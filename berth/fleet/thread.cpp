#include "berth/fleet/thread.hpp"

#include <poll.h>

#include <algorithm>

#include "berth/base/thread.hpp"
#include "berth/fleet/hub_parts.hpp"

namespace berth::fleet {

Hub::Hub(std::unique_ptr<mqtt::Thread> connections) : connections_(std::move(connections)) {}

Hub::~Hub() {
  stop_.store(true, std::memory_order_relaxed);
  bell_.ring();
  if (thread_.joinable()) thread_.join();
}

bool Hub::start() noexcept {
  if (!bell_.good()) return false;
  thread_ = thread_without_signals([this] { run(); });
  return thread_.joinable();
}

void Hub::join(Turner& turner) {
  const std::scoped_lock lock(door_);
  turners_.push_back(&turner);
  bell_.ring();
}

void Hub::leave(Turner& turner) {
  const std::scoped_lock lock(door_);
  std::erase(turners_, &turner);
}

// A thousand edge nodes on one thread: only those that have something to do are asked.
void Hub::run() noexcept {
  using Steady = std::chrono::steady_clock;
  constexpr std::chrono::milliseconds longest{1000};
  while (!stop_.load(std::memory_order_relaxed)) {
    bell_.silence();
    const auto now = Steady::now();
    auto next = now + longest;
    {
      const std::scoped_lock lock(door_);
      for (Turner* const each : turners_) {
        const bool woken = each->woken_.exchange(false, std::memory_order_acquire);
        if (woken || each->due_ <= now) each->due_ = now + std::min(each->turn(), longest);
        next = std::min(next, each->due_);
      }
    }
    const auto patience = std::chrono::ceil<std::chrono::milliseconds>(next - Steady::now()).count();
    pollfd waits{.fd = bell_.descriptor(), .events = POLLIN, .revents = 0};
    ::poll(&waits, 1, static_cast<int>(std::max<std::int64_t>(patience, 0)));
  }
}

Thread::Thread(std::unique_ptr<Hub> hub) noexcept : hub_(std::move(hub)) {}
Thread::~Thread() = default;

tl::expected<std::unique_ptr<Thread>, std::string> Thread::start() {
  auto connections = mqtt::Thread::start();
  if (!connections) return tl::unexpected(connections.error());
  auto hub = std::make_unique<Hub>(std::move(*connections));
  if (!hub->start()) return tl::unexpected<std::string>("the system has no thread, or no descriptor, for MQTT");
  return std::unique_ptr<Thread>(new Thread(std::move(hub)));
}

}  // namespace berth::fleet
