#include "berth/device/device.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "berth/base/bytes.hpp"
#include "berth/od/cia302.hpp"

namespace berth::device {
namespace {

constexpr std::size_t record_size = 4;  // node-ID, bit rate index, two bytes for later
constexpr std::array<std::uint16_t, 3> hooked_objects{0x1010, 0x1011, 0x1021};
constexpr unsigned warning_limit = 96;

// What is longer than this needs an `od::Stream`.
constexpr std::size_t longest_buffer = 65536;

// A download must fit the server's buffer whole: as long as the longest thing that can be written here.
std::size_t sdo_buffer(const od::Description& description) noexcept {
  std::size_t longest = 32;
  for (const auto& sub : description.subs()) {
    if (od::writable(sub.access)) longest = std::max<std::size_t>(longest, sub.capacity);
  }
  return std::min(longest, longest_buffer);
}

lss::BitRateMask bit_rates(std::uint32_t bit_rate) noexcept {
  return lss::bit_rate_index(bit_rate) ? lss::all_fixed_bit_rates : lss::BitRateMask{0};
}

bool has_any(const od::Description& description, std::uint16_t first, std::uint16_t last) noexcept {
  const auto it = std::ranges::lower_bound(description.objects(), first, {}, &od::Object::index);
  return it != description.objects().end() && it->index <= last;
}

}  // namespace

Device::Device(can::Dispatcher& dispatcher, std::shared_ptr<const od::Description> description, NvMemory* memory,
               Options options, TimedPort* host, const Timing& timing, const ProgramOptions& programs)
    : dispatcher_(&dispatcher),
      host_(host, timing),
      options_(std::move(options)),
      values_(std::move(description)),
      lss_answers_(dispatcher),
      methods_({.address = options_.address,
                .rand = options_.rand,
                .rand_resume = options_.rand_resume,
                .and_protocol = options_.and_protocol}),
      nmt_(dispatcher, *this),
      sdo_(dispatcher, values_, sdo_buffer(values_.description())),
      application_(values_),
      errors_(dispatcher, values_, nmt_, host_, static_cast<Errors::Owner&>(*this)),
      error_control_(dispatcher, values_, errors_, host_, options_.never_seen, application_),
      bus_off_(dispatcher, host_, errors_, options_.bus_off_recovery),
      own_identifiers_(dispatcher, values_, nmt_, errors_, static_cast<OwnIdentifiers::Owner&>(*this),
                       options_.detect_collision),
      bit_rates_(bit_rates(options_.bit_rate)) {
  if (memory != nullptr) record_.emplace(*memory, 0, record_size);
  const auto& d = values_.description();
  for (const std::uint16_t index : hooked_objects) {
    if (d.find(index) != nullptr) values_.attach(*this, index);
  }
  if (options_.node_id_object) values_.attach(*this, options_.node_id_object->index);
  const bool other = options_.node_id_signature && options_.node_id_object &&
                     options_.node_id_signature->object.index != options_.node_id_object->index;
  if (other) values_.attach(*this, options_.node_id_signature->object.index);
  make_services(memory);
  const bool programmed = programs.memory != nullptr && d.find(od::cia302::program_data) != nullptr &&
                          d.find(od::cia302::program_control) != nullptr;
  if (programmed) {
    const TypeCode type{options_.address.vendor, options_.address.product};
    programming_ = std::make_unique<Programming>(*this, programs, type);
  }
  load_settings();
  lss_.emplace(dispatcher_->executor(), static_cast<lss::SlaveOwner&>(*this),
               lss::SlaveOptions{.address = options_.address}, memory_);
  if (options_.lss.on && options_.lss.habit != LssHabit::none) {
    habits_ =
        std::make_unique<LssHabits>(options_.lss.habit, dispatcher_->executor(), lss_answers_, options_.lss.habit_seed);
  }
  reset_values(od::Area::all);
}

void Device::make_services(NvMemory* memory) {
  const auto& d = values_.description();
  if (has_any(d, 0x1400, 0x1BFF)) {
    const co::Pdos::Options options{.send_at_start = options_.send_tpdos_at_start,
                                    .detect_collision = options_.detect_collision};
    services_.pdos = std::make_unique<co::Pdos>(*dispatcher_, values_, errors_, options);
    services_.pdos->observe(&application_);
  }
  if (d.find(0x1005) != nullptr) {
    services_.sync = std::make_unique<co::Sync>(*dispatcher_, values_, errors_, services_.pdos.get());
    services_.sync->observe(&application_);
  }
  if (d.find(0x1012) != nullptr) {
    services_.time = std::make_unique<co::TimeStamp>(*dispatcher_, values_);
    services_.time->observe(&application_);
  }
  if (d.find(0x1028) != nullptr) {
    services_.emcy_list = std::make_unique<co::EmcyList>(*dispatcher_, values_, application_);
  }
  if (memory != nullptr && d.find(0x1010) != nullptr) {
    parameters_ = std::make_unique<ParameterStore>(
        *memory, parameters_at, options_.presets, static_cast<ParameterStore::Owner&>(*this), options_.parameter_group);
    if (!parameters_->usable()) parameters_.reset();
  }
  make_negotiation(memory);
  if (d.find(0x1020) != nullptr) {
    configuration_ = std::make_unique<ConfigurationWatch>(*this);
    values_.attach(*configuration_, 0x1000, 0xFFFF);
  }
}

Device::~Device() {
  observer_ = nullptr;
  application_.silence();
  stop_services();                   // says nothing on the bus
  if (storing()) record_->forget();  // whatever the memory writes for: it would call what is gone
}

// --- Power and NMT ---------------------------------------------------------------------------------------------------

void Device::power_on() noexcept {
  if (powered_) power_off();
  powered_ = true;
  load_settings();
  if (parameters_) parameters_->load();
  const lss::SlaveOptions options{.address = options_.address,
                                  .bit_rates = bit_rates_,
                                  .can_store = record_.has_value(),
                                  .change_at_waiting = options_.lss.changes_at_waiting,
                                  .fastscan = options_.lss.fastscan,
                                  .feedback = options_.lss.feedback,
                                  .feedback_base = options_.lss.feedback_base};
  lss_.emplace(dispatcher_->executor(), static_cast<lss::SlaveOwner&>(*this), options, memory_);
  if (habits_) habits_->reset();
  methods_.power_on(options_.address);
  if (negotiation_) negotiation_->power_on(options_.address);
  if (claiming_) claiming_->power_on(options_.address);
  if (programming_) programming_->programs.power_on();
  bus_off_.power_on();
  begin_ = Begin::power_on;
  nmt_.power_on();
  tell();
}

void Device::power_off() noexcept {
  powered_ = false;
  keeps_node_id_ = false;
  begin_ = Begin::nothing;
  cancel();
  bus_off_.power_off();
  stop_services();
  lss_answers_.drop();
  if (habits_) habits_->reset();
  nmt_.power_off();
  dispatcher_->remove(*this);
  own_identifiers_.stop();
  if (negotiation_) negotiation_->power_off();
  if (claiming_) claiming_->power_off();
  if (record_) record_->forget();  // stops the memory, whatever it writes for
  if (parameters_) parameters_->forget();
  if (programming_) programming_->programs.power_off();
  load_settings();
  lss_->power_on(memory_);
  methods_.power_on(lss_->address());
  host_.clear();
  tell();
}

void Device::reset(co::NmtReset what, rt::Time) noexcept {
  stop_services();
  if (begin_ == Begin::power_on) {
    begin(Begin::power_on, host_.timing().boot);
  } else {
    begin(what == co::NmtReset::node ? Begin::reset_node : Begin::reset_communication, host_.timing().reset);
  }
}

void Device::begin(Begin what, rt::Duration own_time) noexcept {
  begin_ = what;
  dispatcher_->remove(*this);
  own_identifiers_.stop();
  if (negotiation_) negotiation_->resetting();
  if (claiming_) claiming_->resetting();
  lss_answers_.drop();
  if (habits_) habits_->reset();
  // An LSS store goes on during a reset; its end is then no request's answer any more. Parameters would be stored in
  // part with their values of after the reset: given up.
  if (parameters_ && parameters_->busy()) {
    parameters_->abandon();
    host_.storing(false);
  }
  host_.booting(true);
  dispatcher_->executor().after(host_.in_world(own_time), *this);
  tell();
}

void Device::run() noexcept {
  if (powered_ && begin_ != Begin::nothing) finish_reset();
}

void Device::finish_reset() noexcept {
  const auto what = std::exchange(begin_, Begin::nothing);
  const bool keep = host_.timing().power_cycle_after_store && what != Begin::power_on;
  if (what == Begin::reset_communication) {
    if (!keep) lss_->reset_communication();
  } else {
    const auto settings = keep ? lss_->active() : memory_;
    lss_->power_on(settings);
  }
  use_bit_rate();
  reset_values(what == Begin::reset_communication ? od::Area::communication : od::Area::all);
  host_.booting(false);
  if (programming_ && what == Begin::reset_node) programming_->programs.restarted();
  if (programming_) nmt_.hold(!programming_->programs.runs());
  if (what != Begin::reset_communication) application_.tell(&Callbacks::start);
  nmt_.initialised(lss_->active().node_id);
  if (nmt_.state() == NmtState::initialising) listen();
  if (negotiation_) negotiation_->ready(lss_->active().node_id);
  if (claiming_) claiming_->ready(lss_->active().node_id);
  tell();
}

void Device::load_settings() noexcept {
  memory_.node_id = options_.node_id;
  memory_.bit_rate = lss::bit_rate_index(options_.bit_rate).value_or(lss::BitRateIndex::kbit_125);
  std::array<std::uint8_t, record_size> raw{};
  if (!record_ || record_->busy() || !record_->load(raw)) return;
  const auto id = NodeId::make(raw[0]);
  if (id && options_.source == NodeIdSource::nonvolatile) memory_.node_id = *id;
  if (lss::contains(bit_rates_, raw[1])) memory_.bit_rate = static_cast<lss::BitRateIndex>(raw[1]);
}

void Device::set_blank(NodeId id, std::uint32_t bit_rate) noexcept {
  options_.node_id = id;
  options_.bit_rate = bit_rate;
  bit_rates_ = bit_rates(bit_rate);
}

lss::Settings Device::persistent() noexcept {
  if (!powered_) load_settings();
  return memory_;
}

void Device::reset_values(od::Area area) noexcept {
  values_.reset(powered_ ? lss_->active().node_id : NodeId(), area);
  for (const auto& preset : options_.presets) {
    if (area == od::Area::all || od::area_of(preset.object.index) == area) values_.set(preset.object, preset.value);
  }
  if (parameters_ && powered_) parameters_->apply(values_, area);
  const auto& a = lss_->address();
  for (unsigned i = 0; i < 4; ++i) values_.set(ObjectRef{0x1018, static_cast<std::uint8_t>(i + 1)}, a.part(i));
  if (options_.node_id_object) values_.set(*options_.node_id_object, lss_->active().node_id.value());
  if (!options_.name.empty()) values_.set_text({0x1008, 0}, options_.name);
  application_.tell(&Callbacks::parameters);
}

void Device::state_changed(NmtState from, NmtState to, rt::Time) noexcept {
  if (to == NmtState::initialising) {
    stop_services();
  } else if (from == NmtState::initialising) {
    start_services();
    self_start();
  } else {
    error_control_.set_state(to);
    set_services(co::services_in(from), co::services_in(to));
  }
  application_.tell(&Callbacks::state, to);
  tell();
}

// 1F80h of a device that is no master (bit 0 = 0): bit 3 "may start itself", bit 2 "waits to be started"
// (docs/protocols/cia301.md §NMT).
void Device::self_start() noexcept {
  if (values_.description().find(od::cia302::nmt_startup) == nullptr) return;
  if ((values_.get_or<std::uint32_t>({od::cia302::nmt_startup, 0}, 0) & 0x0DU) == 0x08U)
    nmt_.apply(co::NmtCommand::start);
}

void Device::start_services() noexcept {
  listen();
  own_identifiers_.listen();
  errors_.start();
  error_control_.start(nmt_.node_id(), nmt_.state());
  set_services({}, nmt_.services());
}

void Device::set_services(const co::Services& was, const co::Services& now) noexcept {
  errors_.enable(now.emcy);
  if (now.sdo && !was.sdo) sdo_.start(nmt_.node_id());
  if (!now.sdo) sdo_.stop();
  services_.change(was, now, nmt_.node_id());
}

void Device::stop_services() noexcept {
  error_control_.stop();
  set_services(nmt_.services(), {});
  errors_.reset();
}

// --- LSS and RAND ----------------------------------------------------------------------------------------------------

void Device::received(const can::Frame& frame, rt::Time) noexcept {
  if (!powered_) return;
  std::optional<can::Frame> answer;
  if (frame.key() == lss::master_cob_id) {
    const auto answers = answer_lss(frame);
    note_other_schemes(answers.has_value());
    lss_answers_.send(answers);
  } else if (frame.key() == co::nmt_command_id) {
    boot_by_nmt(frame);
  } else if (methods_.hears(frame.key())) {
    answer = methods_.handle(frame, options_.lss.on && lss_->state() == lss::State::configuration);
    note_other_schemes(answer.has_value());
  }
  if (answer && !lss_->silent()) dispatcher_->send(*answer);
}

// As a stack does that takes 255 for its node-ID until it has another.
void Device::boot_by_nmt(const can::Frame& frame) noexcept {
  const bool reset = frame.size == 2 && (frame.data[0] == 0x81 || frame.data[0] == 0x82);
  const bool mine = frame.data[1] == 0 || frame.data[1] == NodeId::unconfigured_value;
  if (reset && mine && nmt_.state() == NmtState::initialising) nmt_.apply(static_cast<co::NmtCommand>(frame.data[0]));
}

lss::Answers Device::answer_lss(const can::Frame& frame) noexcept {
  if (lss_->silent()) return {};
  const bool configures =
      lss::is_lss(frame, lss::master_cob_id) && lss::command(frame) == lss::Command::configure_node_id;
  if (configures && options_.source == NodeIdSource::fixed && lss_->state() == lss::State::configuration) {
    return std::optional(lss::answer(lss::Command::configure_node_id, lss::error::out_of_range));
  }
  auto answer = habits_ ? habits_->handle(frame, *lss_) : lss_->handle(frame);
  if (configures) tell();
  return answer;
}

std::optional<lss::StoreResult> Device::store(const lss::Settings& settings) noexcept {
  const std::array<std::uint8_t, record_size> raw{settings.node_id.value(),
                                                  static_cast<std::uint8_t>(settings.bit_rate), 0, 0};
  if (!record_ || !record_->save(raw, *this)) return lss::StoreResult{lss::error::storage, 0};
  being_stored_ = settings;
  host_.storing(true);
  return std::nullopt;
}

void Device::written(bool ok) noexcept {
  host_.storing(false);
  if (keeps_node_id_) node_id_kept(ok);
  if (ok) {
    memory_ = being_stored_;
    if (options_.source == NodeIdSource::fixed) memory_.node_id = options_.node_id;
  }
  // Without an answer when a reset came in between: no master waits any more.
  if (const auto answer = lss_->stored({ok ? lss::error::ok : lss::error::storage, 0})) dispatcher_->send(*answer);
  tell();
}

void Device::wants_reset_communication() noexcept {
  if (habits_ && habits_->boots_by_nmt() && lss_->initialising()) return;
  if (!host_.timing().power_cycle_after_store) nmt_.apply(co::NmtCommand::reset_communication);
}

void Device::switch_bit_rate(lss::BitRateIndex index) noexcept {
  if (const auto rate = lss::bit_rate(index); rate && *rate != 0) dispatcher_->port().restart(*rate);
  error_control_.hush();
  set_services(nmt_.services(), {});
}

void Device::silence_over() noexcept {
  if (nmt_.state() == NmtState::initialising) return;
  error_control_.speak(nmt_.node_id(), nmt_.state());
  set_services({}, nmt_.services());
}

void Device::use_bit_rate() noexcept {
  const auto now = dispatcher_->port().status().bit_rate;
  const auto rate = lss::bit_rate(lss_->active().bit_rate).value_or(0);
  if (bit_rates_ != 0 && now != 0 && rate != 0 && rate != now) dispatcher_->port().restart(rate);
}

void Device::listen() noexcept {
  dispatcher_->remove(*this);
  if (options_.lss.on) dispatcher_->add(can::only(lss::master_cob_id), *this);
  methods_.listen(*dispatcher_, *this);
  const bool told_to_boot = habits_ && habits_->boots_by_nmt() && nmt_.state() == NmtState::initialising;
  if (told_to_boot) dispatcher_->add(can::only(co::nmt_command_id), *this);
}

LedInputs Device::led_inputs() const noexcept {
  const auto status = dispatcher_->port().status();
  return {.state = nmt_.state(),
          .lss = options_.lss.on && powered_ && !booting() && lss_->state() == lss::State::configuration,
          .program_download = programming_ && programming_->programs.downloading(),
          .bus_off = status.bus_off,
          .warning_limit = status.tec >= warning_limit || status.rec >= warning_limit,
          .error_control_event = errors_.active(co::emcy_code::life_guard_or_heartbeat),
          .sync_missing = services_.sync && services_.sync->missing(),
          .event_timer_missed = errors_.active(co::emcy_code::rpdo_timeout)};
}

std::size_t Device::memory() const noexcept {
  return sizeof(Device) - sizeof(od::Values) + values_.memory() + sdo_.memory() + options_.name.capacity() +
         options_.presets.capacity() * sizeof(Preset) + errors_.memory() + error_control_.memory() +
         application_.memory() + services_.memory() + (parameters_ ? sizeof(ParameterStore) : 0) +
         (configuration_ ? sizeof(ConfigurationWatch) : 0) + (negotiation_ ? sizeof(Negotiation) : 0) +
         (claiming_ ? sizeof(Claiming) : 0) + (programming_ ? sizeof(Programming) : 0) +
         (habits_ ? sizeof(LssHabits) : 0);
}

}  // namespace berth::device
