#include "service.hpp"

#include <fmt/format.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "berth/base/words.hpp"

namespace berth::cli {

using namespace std::chrono_literals;

// By the clock: a simulated world that is paused is no process that hangs.
class Service::Beat final : private io::Watcher {
 public:
  Beat(io::Loop& loop, const io::ServiceManager& manager, std::chrono::microseconds limit)
      : loop_(loop), manager_(manager), fd_(::timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK)) {
    const auto period = std::chrono::nanoseconds(limit) / 2;
    const timespec every{period / 1s, (period % 1s).count()};
    const itimerspec spec{every, every};
    ::timerfd_settime(fd_, 0, &spec, nullptr);
    loop_.watch(fd_, *this, EPOLLIN);
    manager_.tell("WATCHDOG=1");
  }
  ~Beat() {
    loop_.forget(fd_);
    if (fd_ >= 0) ::close(fd_);
  }
  Beat(const Beat&) = delete;
  Beat& operator=(const Beat&) = delete;

 private:
  void ready(std::uint32_t) noexcept override {
    std::uint64_t times = 0;
    static_cast<void>(::read(fd_, &times, sizeof times) == 0);
    manager_.tell("WATCHDOG=1");
  }
  io::Loop& loop_;
  const io::ServiceManager& manager_;
  int fd_;
};

std::unique_ptr<Service> Service::start(std::optional<io::ServiceManager> manager, MachineRun& run,
                                        const Options& options, const std::optional<std::string>& start,
                                        Reload::Say say) {
  if (!manager || run.loop() == nullptr || options.dry_run) return nullptr;
  std::unique_ptr<Service> service(new Service(run, std::move(*manager), options.master.ready == "started"));
  if (!start) return service;
  Service* const self = service.get();
  service->reload_ = std::make_unique<Reload>(run, options.files.allow_outside, *start, std::move(say),
                                              [self] { self->manager_.tell("READY=1"); });
  run.interrupt().reload_by([self] { self->reload(); });
  return service;
}

Service::Service(MachineRun& run, io::ServiceManager manager, bool at_once)
    : run_(run), manager_(std::move(manager)), at_once_(at_once) {
  if (const auto limit = manager_.watchdog()) beat_ = std::make_unique<Beat>(*run.loop(), manager_, *limit);
}

Service::~Service() {
  run_.interrupt().reload_by({});
  manager_.tell("STOPPING=1\nSTATUS=ending");
}

void Service::reload() {
  manager_.tell_reloading();
  reload_->begin();
}

std::string Service::status() const {
  unsigned all = 0;
  unsigned good = 0;
  std::vector<std::string> wanting;
  for (const auto& slot : run_.session().slots()) {
    const design::Slot* const spec = run_.session().machine().slot(slot.bus, slot.id);
    const bool optional = spec != nullptr && spec->spec.optional;
    const bool operational = slot.state == places::SlotState::operational;
    if (optional && !operational) continue;
    ++all;
    good += operational ? 1U : 0U;
    if (!operational) wanting.push_back(fmt::format("{} {}", slot.name, places::name(slot.state)));
  }
  const std::string rest = wanting.empty() ? std::string() : "; " + some_of(wanting, 4);
  return io::status_line(fmt::format("{} of {} slots operational{}", good, all, rest));
}

void Service::look() {
  if (!changed_) return;
  const bool ready = !ready_ && (at_once_ || run_.session().operational());
  const auto now = std::chrono::steady_clock::now();
  if (!ready && now - told_at_ < 1s) return;
  changed_ = false;
  std::string status = this->status();
  if (!ready && status == told_) return;
  ready_ = ready_ || ready;
  manager_.tell((ready ? "READY=1\nSTATUS=" : "STATUS=") + status);
  told_ = std::move(status);
  told_at_ = now;
}

}  // namespace berth::cli
