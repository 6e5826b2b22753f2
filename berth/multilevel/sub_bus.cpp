#include "berth/multilevel/sub_bus.hpp"

#include <algorithm>

#include "berth/od/paper3.hpp"

namespace berth::multilevel {
namespace {

constexpr std::uint16_t kinds = od::paper3::mandatory_buses;
constexpr std::uint16_t error_behaviour = 0x1029;
constexpr std::uint8_t failure_register = co::error_register::generic | co::error_register::manufacturer;

}  // namespace

SubBus::SubBus(rt::Executor& executor, EmcyGateway& emcy, std::function<void(co::NmtCommand)> apply)
    : emcy_(&emcy), apply_(std::move(apply)), act_(*this, executor) {
  emcy.on_drained([this] { drained(); });
}

void SubBus::settle() {
  if (std::exchange(settled_, true)) return;
  if (settled_call_) settled_call_();
}

void SubBus::booted() {
  failed_ = false;
  stops_ = false;
  if (told_ != 0) emcy_->report(by_, co::emcy_code::error_reset, 0, std::exchange(told_, std::uint16_t{0}));
  settle();
}

void SubBus::failed(NodeId node) {
  by_ = node;
  if (!std::exchange(failed_, true) && own_ == NmtState::operational) tell_failure();
  settle();
}

void SubBus::own_state(NmtState state) {
  own_ = state;
  if (state == NmtState::initialising) told_ = 0;
  if (state == NmtState::operational && failed_) tell_failure();
}

void SubBus::tell_failure() {
  stops_ = mandatory_;
  told_ = code();
  emcy_->report(by_, told_, failure_register);
}

void SubBus::heartbeat(const co::HeartbeatEvent& event) {
  if (event.kind == co::HeartbeatEvent::Kind::lost) effect_ = static_cast<bool>(lost_call_);
  emcy_->heartbeat(event);
}

void SubBus::drained() noexcept {
  if (stops_ || effect_) act_.post();
}

void SubBus::act() noexcept {
  if (std::exchange(effect_, false)) lost_call_();
  if (std::exchange(stops_, false)) apply_(co::NmtCommand::stop);
}

void add_sub_buses(od::DescriptionBuilder& builder, unsigned ports) {
  builder.object(kinds, od::ObjectCode::array, "Downstream bus is mandatory", od::DataType::unsigned8);
  builder.object(error_behaviour, od::ObjectCode::array, "Error behaviour", od::DataType::unsigned8);
  builder.sub(
      error_behaviour,
      {.sub = 1, .name = "Communication error", .type = od::DataType::unsigned8, .initial = od::Literal::number(0)});
  for (unsigned port = 1; port <= ports; ++port) {
    builder.sub(kinds, {.sub = static_cast<std::uint8_t>(port),
                        .name = "Downstream bus is mandatory",
                        .type = od::DataType::unsigned8,
                        .initial = od::Literal::number(0),
                        .high = od::Literal::number(1)});
    builder.sub(error_behaviour, {.sub = heartbeat_error_class(port),
                                  .name = "Downstream heartbeat error",
                                  .type = od::DataType::unsigned8,
                                  .initial = od::Literal::number(1)});
  }
}

bool is_mandatory(const od::Values& upper, unsigned port) noexcept {
  return upper.get_or<std::uint8_t>({kinds, static_cast<std::uint8_t>(port)}, std::uint8_t{0}) == 1;
}

rt::Duration net_boot_time(const BootNeed& bus) {
  rt::Duration longest{};
  for (const auto& each : bus.beneath) longest = std::max(longest, net_boot_time(each));
  return bus.own + longest;
}

std::vector<BootTimeTooShort> short_boot_times(const BootNeed& bus) {
  std::vector<BootTimeTooShort> found;
  const auto needed = net_boot_time(bus);
  if (bus.boot_time != rt::Duration::zero() && bus.boot_time < needed)
    found.push_back({bus.name, bus.boot_time, needed});
  for (const auto& each : bus.beneath) {
    auto more = short_boot_times(each);
    std::ranges::move(more, std::back_inserter(found));
  }
  return found;
}

}  // namespace berth::multilevel
