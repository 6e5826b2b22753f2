#include "berth/mqtt/thread.hpp"

#include <unistd.h>

#include <utility>

#include "berth/base/thread.hpp"
#include "berth/mqtt/core_parts.hpp"
#include "berth/mqtt/thread_parts.hpp"

namespace berth::mqtt {

Hub::Hub() : epoll_(::epoll_create1(EPOLL_CLOEXEC)), bell_(std::make_shared<Bell>()), names_(bell_) {}

Hub::~Hub() {
  if (thread_.joinable()) {
    stop_.store(true, std::memory_order_release);
    bell_->ring();
    thread_.join();
  }
  if (epoll_ >= 0) ::close(epoll_);
}

// A signal is for the program's own threads, and SIGPIPE would end it: OpenSSL writes to sockets as to files.
bool Hub::start() noexcept {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.ptr = nullptr;
  if (epoll_ < 0 || !bell_->good() || !dock_.good() ||
      ::epoll_ctl(epoll_, EPOLL_CTL_ADD, bell_->descriptor(), &event) != 0)
    return false;
  thread_ = thread_without_signals([this] { run(); });
  return thread_.joinable();
}

void Hub::join(std::shared_ptr<Core> core) {
  {
    const std::lock_guard lock(door_);
    joining_.push_back(std::move(core));
  }
  bell_->ring();
}

void Hub::leave(std::shared_ptr<Core> core) {
  {
    const std::lock_guard lock(door_);
    leaving_.push_back(std::move(core));
  }
  bell_->ring();
}

void Hub::wake(Core& core) noexcept {
  if (core.woken.flag.exchange(true, std::memory_order_acq_rel)) return;
  core.woken.below = woken_.load(std::memory_order_relaxed);
  while (!woken_.compare_exchange_weak(core.woken.below, &core, std::memory_order_release, std::memory_order_relaxed)) {
  }
  bell_->ring();
}

bool Hub::watch(Core& core, int fd, std::uint32_t events) noexcept {
  epoll_event event{};
  event.events = events;
  event.data.ptr = &core;
  return ::epoll_ctl(epoll_, EPOLL_CTL_ADD, fd, &event) == 0;
}

void Hub::change(Core& core, int fd, std::uint32_t events) noexcept {
  epoll_event event{};
  event.events = events;
  event.data.ptr = &core;
  ::epoll_ctl(epoll_, EPOLL_CTL_MOD, fd, &event);
}

void Hub::forget(int fd) noexcept { ::epoll_ctl(epoll_, EPOLL_CTL_DEL, fd, nullptr); }

int Hub::patience() const noexcept {
  if (next_due_ == Time::max()) return -1;
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(next_due_ - Clock::now()).count();
  constexpr std::int64_t longest = 60'000;
  return static_cast<int>(std::clamp<std::int64_t>(left, 0, longest));
}

void Hub::run() noexcept {
  std::array<epoll_event, 256> events{};
  while (!stop_.load(std::memory_order_acquire)) {
    const int count = ::epoll_wait(epoll_, events.data(), static_cast<int>(events.size()), patience());
    const Time now = Clock::now();
    bool rung = false;
    for (int i = 0; i < count; ++i) {
      const epoll_event& event = events[static_cast<std::size_t>(i)];
      auto* const core = static_cast<Core*>(event.data.ptr);
      rung = rung || core == nullptr;
      if (core != nullptr) core->ready(now);
    }
    if (rung) answer_bell(now);
    if (now >= next_due_) work_due(now);
    let_go(now);
  }
}

// Who leaves is looked at before the stack: what such a core's client has woken until then is in it.
void Hub::answer_bell(Time now) noexcept {
  bell_->silence();
  let_in(now);
  work_woken(now);
  if (!std::exchange(awaits_name_, false)) return;
  for (const auto& core : cores_) core->work(now);
}

void Hub::let_in(Time now) noexcept {
  std::vector<std::shared_ptr<Core>> in, out;
  {
    const std::lock_guard lock(door_);
    in.swap(joining_);
    out.swap(leaving_);
  }
  for (auto& core : in) {
    cores_.push_back(core);
    core->work(now);
  }
  for (auto& core : out) {
    core->postbox().ask_to_part(Parting::without_will);
    core->work(now);
    going_.push_back(std::move(core));
  }
}

void Hub::work_woken(Time now) noexcept {
  Core* core = woken_.exchange(nullptr, std::memory_order_acquire);
  while (core != nullptr) {
    Core* const below = core->woken.below;
    core->woken.flag.store(false, std::memory_order_release);
    core->work(now);
    core = below;
  }
}

void Hub::work_due(Time now) noexcept {
  next_due_ = Time::max();
  for (const auto& core : cores_) {
    if (core->due() <= now) core->work(now);
    due(core->due());
  }
}

void Hub::let_go(Time now) noexcept {
  std::erase_if(going_, [&](const std::shared_ptr<Core>& core) {
    if (!core->postbox().has_ended() || core->woken.flag.load(std::memory_order_acquire)) return false;
    core->work(now);  // what was put at the last moment is handed back
    std::erase(cores_, core);
    core->postbox().set_gone();
    return true;
  });
}

tl::expected<std::unique_ptr<Thread>, std::string> Thread::start() {
  auto hub = std::make_unique<Hub>();
  if (!hub->start()) return tl::unexpected(std::string("the system gives no thread or no descriptors for MQTT"));
  return std::unique_ptr<Thread>(new Thread(std::move(hub)));
}

Thread::Thread(std::unique_ptr<Hub> hub) noexcept : hub_(std::move(hub)) {}
Thread::~Thread() = default;

}  // namespace berth::mqtt
