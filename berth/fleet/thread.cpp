#include "berth/fleet/thread.hpp"

#include <poll.h>
#include <pthread.h>

#include <algorithm>
#include <csignal>
#include <system_error>

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
  // Signals are for the thread that waits for them.
  sigset_t all, before;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &before);
  try {
    thread_ = std::thread([this] { run(); });
  } catch (const std::system_error&) {
  }
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
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

void Hub::run() noexcept {
  constexpr std::chrono::milliseconds longest{1000};
  while (!stop_.load(std::memory_order_relaxed)) {
    auto patience = longest;
    bell_.silence();
    {
      const std::scoped_lock lock(door_);
      for (Turner* const each : turners_) patience = std::min(patience, each->turn());
    }
    pollfd waits{.fd = bell_.descriptor(), .events = POLLIN, .revents = 0};
    ::poll(&waits, 1, static_cast<int>(std::max<std::int64_t>(patience.count(), 0)));
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
