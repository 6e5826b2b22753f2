#include "berth/device/error_control.hpp"

#include "berth/base/bytes.hpp"

namespace berth::device {
namespace {

constexpr std::uint16_t guard_time = 0x100C;
constexpr std::uint16_t life_time_factor = 0x100D;
constexpr std::uint16_t consumer_times = 0x1016;
constexpr std::uint16_t producer_time = 0x1017;
constexpr std::size_t bytes_of_a_node = 28;  // memory that a consumer takes for each node

}  // namespace

ErrorControl::ErrorControl(can::Dispatcher& dispatcher, od::Values& values, Errors& errors, const Host& host,
                           rt::Duration never_seen, co::HeartbeatConsumer::Observer& observer)
    : values_(&values),
      errors_(&errors),
      host_(&host),
      observer_(&observer),
      producer_(dispatcher),
      guarding_(dispatcher, static_cast<co::GuardingSlave::Observer&>(*this)) {
  const auto& d = values.description();
  if (const auto* object = d.find(consumer_times)) {
    const unsigned highest = d.subs(*object).empty() ? 1U : d.subs(*object).back().sub;
    consumer_ = std::make_unique<co::HeartbeatConsumer>(dispatcher,
                                                        static_cast<co::HeartbeatConsumer::Observer&>(*this), highest);
    consumer_->set_never_seen_time(host.in_world(never_seen));
    consumer_size_ = sizeof(co::HeartbeatConsumer) + (highest + 1) * bytes_of_a_node;
  }
  for (const auto index : {guard_time, life_time_factor, consumer_times, producer_time}) {
    if (d.find(index) != nullptr) values.attach(*this, index);
  }
}

void ErrorControl::start(NodeId id, NmtState state) noexcept {
  apply_period();
  apply_life_time();
  apply_entries();
  producer_.start(id, state);
  guarding_.start(id, state);
  guarding_.set_heartbeat_active(producer_.period() > rt::Duration::zero());
}

void ErrorControl::set_state(NmtState state) noexcept {
  producer_.set_state(state);
  guarding_.set_state(state);
}

void ErrorControl::stop() noexcept {
  producer_.stop();
  guarding_.stop();
  if (consumer_) consumer_->clear();
}

// --- Reports ---------------------------------------------------------------------------------------------------------

void ErrorControl::life_guarding(bool lost, rt::Time) noexcept {
  if (!lost) {
    errors_->clear(co::emcy_code::life_guard_or_heartbeat);
    return;
  }
  errors_->raise(co::emcy_code::life_guard_or_heartbeat, co::error_register::communication);
  errors_->behave(Errors::communication);
}

void ErrorControl::heartbeat(const co::HeartbeatEvent& event, rt::Time at) noexcept {
  const std::uint8_t node = event.node.value();
  constexpr auto code = co::emcy_code::life_guard_or_heartbeat;
  if (event.kind == co::HeartbeatEvent::Kind::lost) {
    errors_->raise(code, co::error_register::communication, {node}, node);
    errors_->behave(Errors::communication);
  } else if (event.kind == co::HeartbeatEvent::Kind::recovered) {
    errors_->clear(code, {node}, node);
  }
  observer_->heartbeat(event, at);
}

/// 1016h was written: a node that is no longer supervised has no error any more.
void ErrorControl::forget_errors() noexcept {
  for (std::uint8_t node = 1; node <= 127; ++node) {
    if (!consumer_->lost(NodeId(node))) errors_->clear(co::emcy_code::life_guard_or_heartbeat, {node}, node);
  }
}

// --- Objects ---------------------------------------------------------------------------------------------------------

od::AbortCode ErrorControl::writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  if (ref.index != consumer_times || ref.sub == 0 || value.size() != 4) return od::AbortCode::none;
  return consumer_->set_entry(ref.sub, load_le<std::uint32_t>(value.data()));
}

void ErrorControl::written(od::Values&, ObjectRef ref) noexcept {
  switch (ref.index) {
    case consumer_times: return forget_errors();
    case producer_time: return apply_period();
    default: return apply_life_time();
  }
}

void ErrorControl::apply_period() noexcept {
  const rt::Duration period = milliseconds(producer_time);
  const rt::Duration sent = host_->timing().heartbeat_sent;
  const bool other = period.count() > 0 && sent.count() > 0;
  producer_.set_period(other ? host_->in_world(sent) : period);
  guarding_.set_heartbeat_active(producer_.period() > rt::Duration::zero());
}

void ErrorControl::apply_life_time() noexcept {
  guarding_.set_life_time(milliseconds(guard_time),
                          values_->get_or<std::uint8_t>({life_time_factor, 0}, std::uint8_t{0}));
}

void ErrorControl::apply_entries() noexcept {
  const auto* object = consumer_ ? values_->description().find(consumer_times) : nullptr;
  if (object == nullptr) return;
  for (const auto& sub : values_->description().subs(*object)) {
    if (sub.sub == 0) continue;
    const auto value = values_->get_or<std::uint32_t>({consumer_times, sub.sub}, 0);
    if (value != 0) (void)consumer_->set_entry(sub.sub, value);
  }
}

rt::Duration ErrorControl::milliseconds(std::uint16_t index) const noexcept {
  return host_->in_world(std::chrono::milliseconds(values_->get_or<std::uint16_t>({index, 0}, 0)));
}

}  // namespace berth::device
