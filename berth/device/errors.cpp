// What goes wrong in a device, and where it shows: EMCY, 1001h, 1003h, 1029h, the indicators.
#include "berth/co/cob_id.hpp"
#include "berth/device/device.hpp"

namespace berth::device {

namespace {
constexpr std::uint8_t communication_class = 1;  // 1029h:01
constexpr unsigned warning_limit = 96;
}  // namespace

bool Device::raise(std::uint16_t code, std::uint8_t register_bits, const std::array<std::uint8_t, 5>& info,
                   std::uint8_t source) noexcept {
  if (!emcy_.raise(code, register_bits, info, source)) return false;
  const auto shown = emcy_.error_register();
  values_.set({0x1001, 0}, shown);
  if (errors_) errors_->push({code, shown, info});
  value_changed({0x1001, 0});
  return true;
}

bool Device::clear(std::uint16_t code, const std::array<std::uint8_t, 5>& info, std::uint8_t source) noexcept {
  if (!emcy_.clear(code, info, source)) return false;
  values_.set({0x1001, 0}, emcy_.error_register());
  value_changed({0x1001, 0});
  return true;
}

void Device::error_behaviour(std::uint8_t error_class) noexcept {
  if (error_class == 0) return;  // 1029h:00 is a count
  nmt_.apply_error_behaviour(values_.get_or<std::uint8_t>({0x1029, error_class}, 0));
}

void Device::life_guarding(bool lost, rt::Time) noexcept {
  if (!lost) {
    clear(co::emcy_code::life_guard_or_heartbeat);
    return;
  }
  raise(co::emcy_code::life_guard_or_heartbeat, co::error_register::communication);
  error_behaviour(communication_class);
}

// One error for each node, so that one node's return is told while another is still away.
void Device::heartbeat(const co::HeartbeatEvent& event, rt::Time) noexcept {
  const std::uint8_t node = event.node.value();
  constexpr auto code = co::emcy_code::life_guard_or_heartbeat;
  if (event.kind == co::HeartbeatEvent::Kind::lost) {
    raise(code, co::error_register::communication, {node}, node);
    error_behaviour(communication_class);
  } else if (event.kind == co::HeartbeatEvent::Kind::recovered) {
    clear(code, {node}, node);
  }
  call(&Callbacks::heartbeat, event);
}

/// 1016h was written: a node that is not supervised any more is not missed any more.
void Device::forget_heartbeat_errors() noexcept {
  for (std::uint8_t node = 1; node <= 127; ++node) {
    if (!consumer_->lost(NodeId(node))) clear(co::emcy_code::life_guard_or_heartbeat, {node}, node);
  }
}

void Device::changed(const can::Status& status, rt::Time) noexcept {
  if (!powered_) return;
  if (status.bus_off && !recovery_.bus_off) {
    recovery_.bus_off = true;
    error_behaviour(communication_class);
    const auto wait = timing_.in_world(options_.bus_off_recovery);
    if (wait > rt::Duration::zero()) dispatcher_->executor().after(wait, recovery_);
    return;
  }
  if (status.bus_off) return;
  if (status.error_passive()) {
    raise(co::emcy_code::error_passive, co::error_register::communication);
  } else {
    clear(co::emcy_code::error_passive);
  }
}

void Device::recover() noexcept {
  if (!powered_ || !recovery_.bus_off) return;
  recovery_.bus_off = false;
  dispatcher_->port().restart(dispatcher_->port().status().bit_rate);
  raise(co::emcy_code::recovered_from_bus_off, co::error_register::communication);
  clear(co::emcy_code::recovered_from_bus_off);
}

LedInputs Device::led_inputs() const noexcept {
  const auto status = dispatcher_->port().status();
  return {.state = nmt_.state(),
          .lss = options_.lss.on && powered_ && !booting() && lss_->state() == lss::State::configuration,
          .program_download = programming_ && programming_->programs.downloading(),
          .bus_off = status.bus_off,
          .warning_limit = status.tec >= warning_limit || status.rec >= warning_limit,
          .error_control_event = emcy_.active(co::emcy_code::life_guard_or_heartbeat),
          .sync_missing = services_.sync && services_.sync->missing(),
          .event_timer_missed = emcy_.active(co::emcy_code::rpdo_timeout)};
}

// --- Identifiers of its own ------------------------------------------------------------------------------------------

template <class Visit>
void Device::for_each_own_id(const Visit& visit) const noexcept {
  const auto id = nmt_.node_id();
  if (!id.configured()) return;
  visit(co::sdo_response_id(id));
  visit(co::error_control_id(id));
  const co::CobId emcy(values_.get_or<std::uint32_t>({0x1014, 0}, co::emcy_id(id)));
  if (emcy.valid()) visit(emcy.key());
  for (const auto index : {std::uint16_t{0x1005}, std::uint16_t{0x1012}}) {
    const co::CobId produced(values_.get_or<std::uint32_t>({index, 0}, 0));
    if ((produced.raw() & co::CobId::second_bit) != 0) visit(produced.key());
  }
  for (unsigned index = 0x1201; index <= 0x127F; ++index) {
    const auto* const object = values_.description().find(static_cast<std::uint16_t>(index));
    if (object == nullptr) break;
    const co::CobId answers(values_.get_or<std::uint32_t>({object->index, 2}, std::uint32_t{co::CobId::invalid_bit}));
    if (answers.valid()) visit(answers.key());
  }
}

bool Device::is_mine(std::uint32_t key) const noexcept {
  bool mine = false;
  for_each_own_id([&](std::uint32_t own) { mine |= own == key; });
  return mine;
}

void Device::listen() noexcept {
  dispatcher_->remove(*this);
  if (options_.lss.on) dispatcher_->add(can::only(lss::master_cob_id), *this);
  methods_.listen(*dispatcher_, *this);
  const bool told_to_boot = habits_ && habits_->boots_by_nmt() && nmt_.state() == NmtState::initialising;
  if (told_to_boot) dispatcher_->add(can::only(co::nmt_command_id), *this);
  if (!options_.detect_collision) return;
  for_each_own_id([this](std::uint32_t own) { dispatcher_->add(can::only(own), *this); });
}

// --- What the services tell ------------------------------------------------------------------------------------------

void Device::received(unsigned rpdo, rt::Time) noexcept {
  if (writes_) writes_->mapped(values_, static_cast<std::uint16_t>(0x1600 + rpdo - 1));
  call(&Callbacks::rpdo, rpdo);
}

void Device::received_mpdo(ObjectRef object, rt::Time) noexcept {
  if (writes_) writes_->one(object);
}

void Device::synchronised(std::uint8_t counter, rt::Time) noexcept { call(&Callbacks::sync, counter); }

void Device::sync_missing(bool missing, rt::Time) noexcept { call(&Callbacks::sync_missing, missing); }

void Device::time_of_day(const co::TimeOfDay& time, rt::Time) noexcept { call(&Callbacks::time, time); }

void Device::emergency(NodeId node, const co::Emcy& message, rt::Time) noexcept {
  call(&Callbacks::emergency, node, message);
}

Callbacks& Device::on() {
  if (!callbacks_) callbacks_ = std::make_unique<Callbacks>();
  return *callbacks_;
}

void Device::on_write(ObjectRef ref, std::function<void()> call) {
  if (!writes_) writes_ = std::make_unique<WriteWatch>();
  writes_->add(values_, ref, std::move(call));
}

}  // namespace berth::device
