#include "berth/tree/beneath.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace berth::tree {
namespace {

using operate::EventKind;

constexpr auto shortest_period = std::chrono::milliseconds(200);  // of `watch`

// Sets the flag until the end of the block, or until the task is cancelled.
class While {
 public:
  explicit While(bool& flag) noexcept : flag_(&flag) { flag = true; }
  ~While() { *flag_ = false; }
  While(const While&) = delete;
  While& operator=(const While&) = delete;

 private:
  bool* flag_;
};

}  // namespace

Beneath::Beneath(rt::Executor& executor, const design::Bus& bus, Way way, std::vector<places::SlotSpec> slots,
                 const manager::SlotSettings& settings, multilevel::Routes& routes, operate::NetworkObserver observer)
    : executor_(executor),
      way_(std::move(way)),
      routes_(routes),
      slots_(executor, bus, std::move(slots), std::move(observer)),
      delivery_(executor, slots_, way_, settings, routes),
      watch_(slots_, way_, routes),
      wakes_(executor),
      scope_(executor) {
  watch_.set_ready([this](NodeId gateway) { return ready_beneath(gateway); });
}

void Beneath::know_gateway(std::function<bool()> runs, std::function<void()> operational) {
  gateway_runs_ = std::move(runs);
  operational_call_ = std::move(operational);
  slots_.on_operational([this] { tell_operational(); });
}

void Beneath::start() {
  if (scope_.running() == 0) scope_.spawn(watch());
}

void Beneath::stop() noexcept { scope_.cancel(); }

bool Beneath::ready_beneath(NodeId gateway) const {
  return std::ranges::all_of(delivery_.deeper(), [&](const Deeper& deeper) {
    return deeper.gateway.slot != gateway || !deeper.gateway.mandatory || deeper.operational();
  });
}

void Beneath::provide(bool provided) noexcept {
  const bool news = provided && !provided_;
  provided_ = provided;
  watch_.set_provided(provided);
  if (news) tell_operational();
}

void Beneath::tell_operational() {
  if (operational() && operational_call_) operational_call_();
}

rt::Task<Result<void>> Beneath::bring_up() {
  while (brings_up_) co_await rt::sleep_for(shortest_period);
  const While now(brings_up_);
  up_ = true;
  foreign_ = false;
  provide(false);
  slots_.say_of_unknown(fmt::format("gateway {} above is given the network list of this bus first",
                                    way_.gateways.back().gateway.value()));
  watch_.set_hurried(true);
  bool was_there = false;
  auto done = co_await delivery_.deliver(was_there);
  provide(done.has_value());
  again_at_ = executor_.now() + patience;
  again_early_ = !done;
  const rt::Duration boot_time = bus().startup.boot_time;
  const rt::Time deadline = executor_.now() + (boot_time.count() > 0 ? boot_time : patience);
  if (done) done = co_await watch_.await_operational(deadline);
  if (done && was_there) done = co_await delivery_.bring_up_deeper();
  watch_.set_hurried(false);
  if (!done && done.error().code == Errc::timeout) watch_.gateway_is_silent(done.error());
  co_return done;
}

// Looks at one slot after the other, but at once at those that a report is about.
rt::Task<void> Beneath::watch() {
  const rt::Duration period = std::max<rt::Duration>(bus().timing.heartbeat_period, shortest_period);
  for (;;) {
    const rt::Time deadline = executor_.now() + period;
    const auto wake = co_await wakes_.next(deadline);
    static_cast<void>(wake);
    wakes_.clear();
    if (slots_.all().empty()) continue;
    const bool runs = gateway_runs_ && gateway_runs_();
    const bool returned = watch_.set_gateway_runs(runs);
    if (brings_up_) {
      co_await watch_.look_at_asked();
    } else if (up_ && !provided_ && is_due_again()) {
      const auto done = co_await bring_up();
      again_at_ = executor_.now() + (done ? rt::Duration(0) : patience);
    } else if (up_) {
      if (runs) co_await look_at_list(returned);
      co_await watch_.look_around();
    } else if (runs) {
      co_await adopt();
    }
  }
}

// All slots run; perhaps only an answer of the gateway failed. Check before the next device is missed.
bool Beneath::is_due_again() noexcept {
  return executor_.now() >= again_at_ || (slots_.operational() && std::exchange(again_early_, false));
}

// Running nodes are not disturbed: a list other than the machine file's is only reported. But if Berth was interrupted,
// the list may be inactive, or lack its gateways; only the next run can finish that.
rt::Task<void> Beneath::adopt() {
  using Found = ListDelivery::Found;
  const Found found = co_await delivery_.look();
  up_ = true;
  if (found == Found::unused || found == Found::unfinished) {
    slots_.events().tell(EventKind::step, "",
                         fmt::format("finishing what an earlier run began: {}",
                                     found == Found::unused ? "its gateway has no node of its network list"
                                                            : "its gateway's network list is incomplete"));
    again_at_ = executor_.now();
    co_return;
  }
  foreign_ = found == Found::another;
  if (foreign_) {
    slots_.events().tell_once(
        EventKind::error,
        "its gateway runs with another network list than this machine file's: it gets the new one when the "
        "gateway boots");
  }
  provide(true);
}

// A gateway on this bus's own port is brought up when it boots. One beneath another gateway boots without Berth: it may
// have lost an unsaved list, or be a new one.
rt::Task<void> Beneath::look_at_list(bool returned) {
  const bool boots_unseen = way_.gateways.size() > 1;
  const bool due = returned || (!slots_.operational() && executor_.now() >= list_at_);
  if (!boots_unseen || !provided_ || foreign_ || !due) co_return;
  list_at_ = executor_.now() + patience;
  const bool lost = co_await delivery_.is_lost();
  if (!lost) co_return;
  slots_.events().tell(EventKind::step, "", "its gateway does not have its network list any more");
  provide(false);
  again_at_ = executor_.now();
}

void Beneath::ask(NodeId node, bool lost) {
  if (watch_.ask(node, lost)) wakes_.push(node);
}

void Beneath::ask_all() {
  for (const NodeId node : slots_.nodes()) ask(node, true);
}

void Beneath::collided(NodeId node) {
  if (auto* const place = slots_.at(node)) watch_.collided(*place);
}

void Beneath::stops_itself(NodeId gateway) noexcept {
  if (auto* const place = slots_.at(gateway)) place->stops_itself = executor_.now();
}

}  // namespace berth::tree
