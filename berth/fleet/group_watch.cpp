#include "berth/fleet/group_watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>

#include "berth/base/thread.hpp"
#include "berth/fleet/watch.hpp"

namespace berth::fleet {
namespace {

using namespace std::chrono_literals;
using SteadyClock = std::chrono::steady_clock;

constexpr SteadyClock::duration look_pace = 500ms;
constexpr SteadyClock::duration again_after = 10s;  // after a refusal that does not end by itself

}  // namespace

/// `mutex_` guards what both threads use, and is held for some pointers' time only.
class GroupWatch::Impl {
 public:
  Impl(Options options, Random random) : options_(std::move(options)), random_(random) {}
  ~Impl() {
    {
      const std::scoped_lock lock(mutex_);
      stop_ = true;
    }
    bell_.notify_one();
    if (thread_.joinable()) thread_.join();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  std::string answer(std::uint64_t since) {
    if (!thread_.joinable()) begin();
    Seen seen;
    {
      const std::scoped_lock lock(mutex_);
      asked_at_ = SteadyClock::now();
      seen = seen_;
    }
    bell_.notify_one();
    const auto part = seen.list ? seen.list->since(since) : MachineList().since(since);
    const auto trouble = nlohmann::json(seen.trouble).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    std::string json =
        fmt::format(R"({{"changes":{},"connected":{},"trouble":{})", part.changes, seen.connected, trouble);
    if (!part.machines.empty())
      json += fmt::format(R"(,"whole":{},"more":{},"machines":{})", part.whole, part.more, part.machines);
    return json + '}';
  }

 private:
  struct Seen {
    bool connected = false;
    std::string trouble{};
    std::shared_ptr<const MachineList> list{};
  };

  void begin() {
    asked_at_ = SteadyClock::now();
    thread_ = thread_without_signals([this] { run(); });
    if (!thread_.joinable()) seen_.trouble = "the system has no thread for it";
  }

  // ---- on its thread

  void run() noexcept {
    std::unique_lock lock(mutex_);
    while (!stop_) {
      const bool wanted = SteadyClock::now() - asked_at_ < options_.idle;
      if (!wanted && !watch_) {
        bell_.wait(lock);
        continue;
      }
      lock.unlock();
      auto pause = look_pace;
      if (wanted) {
        pause = look();
      } else {
        end({});
        again_at_ = {};
      }
      lock.lock();
      if (wanted) bell_.wait_for(lock, pause, [this] { return stop_; });
    }
    lock.unlock();
    watch_.reset();
    connections_.reset();
  }

  /// The time until the next look.
  SteadyClock::duration look() {
    const auto begun = SteadyClock::now();
    if (!watch_ && begun >= again_at_) connect();
    if (!watch_) return look_pace;
    const auto status = watch_->status();
    if (status.gave_up) {
      again_at_ = begun + again_after;
      end(status.trouble);
      return look_pace;
    }
    std::shared_ptr<const MachineList> list;
    if (status.changes != looked_at_) {
      looked_at_ = status.changes;
      std::vector<MachineView> machines;
      watch_->look([&](const sparkplug::Fleet& fleet) { machines = machines_of(fleet); });
      list = lister_.take(std::move(machines));
    }
    tell(status.connected, status.trouble, std::move(list));
    // A look at thousands of machines takes a tenth of a processor at most.
    return std::max(look_pace, 9 * (SteadyClock::now() - begun));
  }

  void connect() {
    again_at_ = SteadyClock::now() + again_after;
    auto connections = Thread::start();
    if (!connections) return tell(false, connections.error(), nullptr);
    WatchOptions wanted{.connection = options_.connection, .groups = {options_.id.group}};
    // The same at each start: the broker keeps the last STATE of each host.
    wanted.host = fmt::format("berth-studio-{}-{}", options_.id.group, options_.id.node);
    wanted.connection.client_id = wanted.host;
    auto watch = Watch::start(**connections, std::move(wanted), clock_, random_.fork());
    if (!watch) return tell(false, watch.error(), nullptr);
    connections_ = std::move(*connections);
    watch_ = std::move(*watch);
    looked_at_ = 0;
  }

  // Told first: who asks meanwhile must not take the old list for how things are.
  void end(const std::string& trouble) {
    tell(false, trouble, lister_.forget());
    watch_.reset();
    connections_.reset();
  }

  /// `list`: null: as before.
  void tell(bool connected, const std::string& trouble, std::shared_ptr<const MachineList> list) {
    const std::scoped_lock lock(mutex_);
    seen_.connected = connected;
    seen_.trouble = trouble;
    if (list) seen_.list = std::move(list);
  }

  Options options_;
  // Both threads.
  std::mutex mutex_;
  std::condition_variable bell_;
  Seen seen_;
  SteadyClock::time_point asked_at_{};
  bool stop_ = false;
  // Of its thread alone.
  Random random_;
  SystemClock clock_;
  std::unique_ptr<Thread> connections_;
  std::unique_ptr<Watch> watch_;
  MachineLister lister_;
  std::uint64_t looked_at_ = 0;
  SteadyClock::time_point again_at_{};
  std::thread thread_;
};

GroupWatch::GroupWatch(Options options, Random random) : impl_(std::make_unique<Impl>(std::move(options), random)) {}
GroupWatch::~GroupWatch() = default;
std::string GroupWatch::answer(std::uint64_t since) { return impl_->answer(since); }

}  // namespace berth::fleet
