#include "berth/network/managed_bus.hpp"

#include <algorithm>

#include "berth/co/cob_id.hpp"

namespace berth::network {
namespace {

constexpr auto guard_answer_time = std::chrono::milliseconds(100);

}  // namespace

class ManagedBus::Next final : public rt::Operation<Next>, private rt::Job {
 public:
  Next(ManagedBus& bus, NodeId node, rt::Time deadline) noexcept : bus_(&bus), deadline_(deadline), node_(node) {}
  ~Next() { leave(); }
  bool start() noexcept {
    if (deadline_ <= executor().now()) return false;
    next_ = bus_->waiting_;
    bus_->waiting_ = this;
    waits_ = true;
    if (deadline_ != rt::never) executor().at(deadline_, *this);
    return true;
  }
  std::optional<Heard> await_resume() const noexcept { return heard_; }

  static void tell(ManagedBus& bus, NodeId node, const Heard& heard) noexcept {
    for (Next* each = bus.waiting_; each != nullptr;) {
      Next* const next = each->next_;
      if (each->node_ == node) each->hear(heard);
      each = next;
    }
  }

 private:
  void hear(const Heard& heard) noexcept {
    leave();
    cancel();
    heard_ = heard;
    finish();
  }
  void run() noexcept override {
    leave();
    finish();
  }
  void leave() noexcept {
    if (!waits_) return;
    waits_ = false;
    Next** place = &bus_->waiting_;
    while (*place != this) place = &(*place)->next_;
    *place = next_;
  }
  ManagedBus* bus_;
  Next* next_ = nullptr;
  rt::Time deadline_;
  std::optional<Heard> heard_;
  NodeId node_;
  bool waits_ = false;
};

class ManagedBus::Target final : public BootTarget {
 public:
  Target(ManagedBus& bus, NodeId node) noexcept : bus_(&bus), access_(*bus.sdo_, node), node_(node) {}
  co::SdoAccess& objects() noexcept override { return access_; }
  rt::Task<Result<rt::Time>> command(co::NmtCommand command) override { return bus_->command(command, node_); }
  rt::Task<bool> boots(rt::Time since, rt::Time deadline) override;
  rt::Task<std::optional<NmtState>> heartbeat(rt::Duration within) override;
  rt::Task<std::optional<NmtState>> guard() override;
  void supervise(const manager::SlaveRules& rules) override { bus_->supervise(node_, rules); }
  void expect_boot_up() noexcept override { bus_->reset_.set(node_.value()); }

 private:
  ManagedBus* bus_;
  co::NodeAccess access_;
  NodeId node_;
};

rt::Task<bool> ManagedBus::Target::boots(rt::Time since, rt::Time deadline) {
  for (;;) {
    const auto booted = bus_->booted_[node_.value()];
    if (booted && *booted >= since) co_return true;
    Next next(*bus_, node_, deadline);
    const auto heard = co_await next;
    if (!heard) co_return false;
  }
}

rt::Task<std::optional<NmtState>> ManagedBus::Target::heartbeat(rt::Duration within) {
  const rt::Time deadline = bus_->dispatcher_->executor().now() + within;
  for (;;) {
    Next next(*bus_, node_, deadline);
    const auto heard = co_await next;
    if (!heard) co_return std::nullopt;
    if (heard->state != NmtState::initialising) co_return heard->state;
  }
}

rt::Task<std::optional<NmtState>> ManagedBus::Target::guard() {
  const auto answer = co_await co::guard_once(*bus_->dispatcher_, node_, guard_answer_time, 1);
  if (!answer) co_return std::nullopt;
  co_return answer->state;
}

ManagedBus::ManagedBus(can::Dispatcher& dispatcher)
    : ManagedBus(dispatcher, std::make_unique<co::SdoClient>(dispatcher), nullptr) {}

ManagedBus::ManagedBus(can::Dispatcher& dispatcher, co::SdoClient& sdo) : ManagedBus(dispatcher, nullptr, &sdo) {}

ManagedBus::ManagedBus(can::Dispatcher& dispatcher, std::unique_ptr<co::SdoClient> own, co::SdoClient* shared)
    : dispatcher_(&dispatcher),
      own_sdo_(std::move(own)),
      sdo_(own_sdo_ ? own_sdo_.get() : shared),
      nmt_(dispatcher),
      heartbeats_(dispatcher, *this),
      guarding_(dispatcher, *this) {
  dispatcher.add(co::all_error_control, *this);
}

ManagedBus::~ManagedBus() = default;

BootTarget& ManagedBus::target(NodeId node) {
  auto& target = targets_[node.value()];
  if (!target) target = std::make_unique<Target>(*this, node);
  return *target;
}

rt::Task<Result<rt::Time>> ManagedBus::command(co::NmtCommand command, co::NmtTarget target) {
  const bool resets = command == co::NmtCommand::reset_node || command == co::NmtCommand::reset_communication;
  const auto sent = co_await nmt_.send(command, target);
  // Noted only after sending, which is soon enough: a device's boot-up takes longer than this task's next step.
  if (sent && resets && target.node != 0) reset_.set(target.node);
  if (sent && resets && target.node == 0) reset_.set();
  co_return sent;
}

void ManagedBus::received(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.remote || frame.size != 1) return;
  const auto state = co::nmt_state(frame.data[0]);
  const NodeId node(static_cast<std::uint8_t>(frame.id & 0x7FU));
  if (!state) return;
  const bool boot_up = *state == NmtState::initialising;
  const bool expected = boot_up && reset_.test(node.value());
  if (boot_up) {
    booted_[node.value()] = at;
    reset_.reset(node.value());
  }
  Next::tell(*this, node, {*state, at});
  if (listener_ == nullptr) return;
  if (boot_up) return listener_->boot_up(node, expected);
  listener_->told(node, *state);
}

void ManagedBus::heartbeat(const co::HeartbeatEvent& event, rt::Time) noexcept {
  using Kind = co::HeartbeatEvent::Kind;
  switch (event.kind) {
    case Kind::lost:
    case Kind::never_seen: return is_lost(event.node);
    case Kind::recovered:
    case Kind::started: return is_back(event.node);
    case Kind::boot_up: lost_.reset(event.node.value()); return;
    case Kind::state_changed: return;
  }
}

void ManagedBus::guarding(const co::GuardingEvent& event, rt::Time) noexcept {
  using Kind = co::GuardingEvent::Kind;
  switch (event.kind) {
    case Kind::lost: return is_lost(event.node);
    case Kind::recovered: return is_back(event.node);
    case Kind::boot_up: lost_.reset(event.node.value()); return;
    default: return;
  }
}

void ManagedBus::is_lost(NodeId node) noexcept {
  lost_.set(node.value());
  if (listener_ != nullptr) listener_->lost(node);
}

void ManagedBus::is_back(NodeId node) noexcept {
  if (!lost_.test(node.value())) return;
  lost_.reset(node.value());
  if (listener_ != nullptr) listener_->back(node);
}

void ManagedBus::supervise(NodeId node, const manager::SlaveRules& rules) {
  lost_.reset(node.value());
  const bool by_heartbeat = rules.heartbeat.count() > 0;
  const bool by_guarding = !by_heartbeat && rules.guard_time.count() > 0;
  // Also reports a device that fails between the heartbeat that ended its boot-up and the next one.
  longest_ = std::max(longest_, rules.heartbeat);
  heartbeats_.set_never_seen_time(longest_);
  heartbeats_.supervise(node, rules.heartbeat);
  if (by_guarding) {
    guarding_.guard(node, rules.guard_time, std::max<std::uint8_t>(rules.retry_factor, 1));
  } else {
    guarding_.end(node);
  }
}

}  // namespace berth::network
