#include "berth/operate/manager_objects.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/base/bytes.hpp"
#include "berth/base/counted.hpp"
#include "berth/manager/boot_rules.hpp"
#include "berth/network/configuration_requests.hpp"
#include "berth/network/configuration_uploads.hpp"
#include "berth/network/network_requests.hpp"
#include "berth/od/cia302.hpp"
#include "berth/operate/manager_views.hpp"
#include "berth/text/printable.hpp"

namespace berth::operate {
namespace {

namespace cia302 = od::cia302;
using od::AbortCode;
using od::Access;
using od::DataType;
using places::SlotState;

constexpr std::uint16_t consumer_heartbeat = 0x1016;
constexpr std::uint16_t os_command = 0x1023;
constexpr std::uint16_t manager_status = 0x5F00;
constexpr std::uint16_t bus_status = 0x5F01;
constexpr std::uint16_t slot_state = 0x5F02;
constexpr std::uint16_t boot_letter = 0x5F03;
constexpr std::uint16_t configuration_status = 0x5F04;
constexpr std::uint16_t last_emergency = 0x5F05;
constexpr std::uint16_t emergencies = 0x5F06;
constexpr std::uint16_t losses = 0x5F07;
constexpr std::uint16_t boots = 0x5F08;
constexpr std::uint16_t emergency_history = 0x5F09;

constexpr std::uint16_t upload_configuration = network::ConfigurationUploads::object;

constexpr std::uint32_t conf = network::ConfigurationRequests::signature;
constexpr std::uint32_t upld = network::ConfigurationUploads::signature;
constexpr std::uint32_t longest_command = 1000;
constexpr std::uint32_t longest_reply = 65'536;

// 1023h:02 (CiA 301 §7.5.2.27).
constexpr std::uint8_t done_with_reply = 1;
constexpr std::uint8_t failed_with_reply = 3;
constexpr std::uint8_t executing = 0xFF;

enum class ConfigurationProgress : std::uint8_t { none, not_yet, under_way, as_it_shall_be, needs_power, failed };

struct Array {
  std::uint16_t index;
  const char* name;
  const char* part;
  DataType type;
  std::uint8_t most;
  Access access;
};
constexpr std::array arrays{
    Array{cia302::store_dcf, "Store DCF", "Node-ID", DataType::domain, 127, Access::rw},
    Array{cia302::dcf_format, "Storage format", "Node-ID", DataType::unsigned8, 127, Access::ro},
    Array{cia302::concise_dcf, "Concise DCF", "Node-ID", DataType::domain, 127, Access::rw},
    Array{cia302::configuration_date, "Expected configuration date", "Node-ID", DataType::unsigned32, 127, Access::ro},
    Array{cia302::configuration_time, "Expected configuration time", "Node-ID", DataType::unsigned32, 127, Access::ro},
    Array{cia302::expected_program, "Expected software identification", "Node-ID", DataType::unsigned32, 127,
          Access::ro},
    Array{cia302::program_of_slave, "Program of the slave", "Node-ID", DataType::domain, 127, Access::ro},
    Array{consumer_heartbeat, "Consumer heartbeat time", "Consumer", DataType::unsigned32, 127, Access::ro},
    Array{upload_configuration, "Upload configuration", "Node-ID", DataType::unsigned32, cia302::all_nodes, Access::rw},
    Array{cia302::request_configuration, "Request configuration", "Node-ID", DataType::unsigned32, cia302::all_nodes,
          Access::wo},
    Array{cia302::slave_assignment, "Slave assignment", "Node-ID", DataType::unsigned32, 127, Access::ro},
    Array{cia302::request_nmt, "Request NMT", "Node-ID", DataType::unsigned8, cia302::all_nodes, Access::rw},
    Array{cia302::request_guarding, "Request guarding", "Node-ID", DataType::unsigned8, 127, Access::ro},
    Array{cia302::expected_type, "Device type identification", "Node-ID", DataType::unsigned32, 127, Access::ro},
    Array{cia302::expected_vendor, "Vendor identification", "Node-ID", DataType::unsigned32, 127, Access::ro},
    Array{cia302::expected_product, "Product code", "Node-ID", DataType::unsigned32, 127, Access::ro},
    Array{cia302::expected_revision, "Revision number", "Node-ID", DataType::unsigned32, 127, Access::ro},
    Array{cia302::expected_serial, "Serial number", "Node-ID", DataType::unsigned32, 127, Access::ro},
    Array{slot_state, "Slot state", "Node-ID", DataType::unsigned8, 127, Access::ro},
    Array{boot_letter, "Boot-up error status", "Node-ID", DataType::unsigned8, 127, Access::ro},
    Array{configuration_status, "Configuration status", "Node-ID", DataType::unsigned8, 127, Access::ro},
    Array{last_emergency, "Present emergency", "Node-ID", DataType::unsigned32, 127, Access::ro},
    Array{emergencies, "Emergencies", "Node-ID", DataType::unsigned16, 127, Access::ro},
    Array{losses, "Heartbeats lost", "Node-ID", DataType::unsigned16, 127, Access::ro},
    Array{boots, "Boot-ups", "Node-ID", DataType::unsigned16, 127, Access::ro},
    Array{emergency_history, "Emergency history", "Emergency", DataType::unsigned64, BusStatistics::most_emergencies,
          Access::ro}};

struct Part {
  const char* name;
  DataType type;
};
constexpr std::array manager_parts{Part{"Phase", DataType::unsigned8},        Part{"Slots", DataType::unsigned8},
                                   Part{"Operational", DataType::unsigned8},  Part{"Absent", DataType::unsigned8},
                                   Part{"Failed", DataType::unsigned8},       Part{"Questions", DataType::unsigned8},
                                   Part{"All operational", DataType::boolean}};
constexpr std::array bus_parts{
    Part{"Bit rate", DataType::unsigned32},        Part{"State", DataType::unsigned8},
    Part{"Transmit errors", DataType::unsigned16}, Part{"Receive errors", DataType::unsigned16},
    Part{"Errors", DataType::unsigned32},          Part{"Frames lost", DataType::unsigned32},
    Part{"Emergencies", DataType::unsigned16},     Part{"Heartbeats lost", DataType::unsigned16},
    Part{"Boot-ups", DataType::unsigned16}};

template <class NetworkParts>
void add_record(od::DescriptionBuilder& b, std::uint16_t index, const char* name, const NetworkParts& parts) {
  b.object(index, od::ObjectCode::record, name);
  std::uint8_t sub = 0;
  for (const Part& part : parts) {
    b.sub(index, {.sub = ++sub, .name = part.name, .type = part.type, .access = Access::ro});
  }
}

// No room is reserved for stream objects: that would be 16 KiB for each.
constexpr std::uint32_t of_stream(DataType type) noexcept { return type == DataType::domain ? 1 : 0; }

// A counter in an object of 16 bits stands still at its end: it must not seem to begin again.
std::uint64_t of_16_bits(std::uint64_t count) noexcept { return std::min<std::uint64_t>(count, 0xFFFF); }

// The wanted configuration changed since the device was configured.
bool is_due(const Seat& seat) noexcept {
  const auto& noted = seat.slot.record.configured;
  const auto& sits = seat.slot.record.confirmed;
  return noted && sits && noted->device == sits->device && noted->stage == places::Configured::Stage::writing;
}

ConfigurationProgress configured(const Seat& seat) noexcept {
  if (!seat.configuration.any()) return ConfigurationProgress::none;
  switch (seat.state()) {
    case SlotState::configuring: return ConfigurationProgress::under_way;
    case SlotState::power_cycle: return ConfigurationProgress::needs_power;
    case SlotState::failed: return ConfigurationProgress::failed;
    case SlotState::operational:
      return is_due(seat) ? ConfigurationProgress::not_yet : ConfigurationProgress::as_it_shall_be;
    default: break;
  }
  const auto& noted = seat.slot.record.configured;
  const bool done = noted && noted->stage == places::Configured::Stage::done && seat.slave.status.ready();
  return done ? ConfigurationProgress::as_it_shall_be : ConfigurationProgress::not_yet;
}

std::uint32_t assignment(const Seat& seat) noexcept {
  constexpr std::uint32_t assigned = 1U << 0U;
  constexpr std::uint32_t boots_it = 1U << 2U;
  constexpr std::uint32_t mandatory = 1U << 3U;
  constexpr std::uint32_t keep_alive = 1U << 4U;
  return assigned | boots_it | keep_alive | (seat.slot.spec.mandatory ? mandatory : 0U);
}

std::uint32_t expected(const Seat& seat, std::uint16_t index) noexcept {
  const auto& spec = seat.slot.spec;
  switch (index) {
    case cia302::expected_type: return spec.device_type;
    case cia302::expected_vendor: return spec.type.vendor;
    case cia302::expected_product: return spec.type.product;
    case cia302::expected_revision: return spec.rule == places::RevisionRule::exact ? spec.revision.value_or(0) : 0;
    default: return seat.slot.record.device() ? seat.slot.record.device()->address.serial : 0;
  }
}

}  // namespace

void ManagerObjects::describe(od::DescriptionBuilder& b) {
  b.object(os_command, od::ObjectCode::record, "OS command");
  b.sub(os_command, {.sub = 1, .name = "Command", .type = DataType::octet_string, .capacity = longest_command});
  b.sub(os_command, {.sub = 2, .name = "Status", .type = DataType::unsigned8, .access = Access::ro});
  b.sub(os_command, {.sub = 3, .name = "Reply", .type = DataType::octet_string, .access = Access::ro});
  b.variable(cia302::nmt_startup, {.name = "NMT startup", .access = Access::ro});
  b.variable(cia302::boot_time, {.name = "Boot time", .access = Access::ro});
  for (const Array& each : arrays) {
    b.object(each.index, od::ObjectCode::array, each.name, each.type);
    for (unsigned sub = 1; sub <= each.most; ++sub) {
      b.sub(each.index, {.sub = static_cast<std::uint8_t>(sub),
                         .name = fmt::format("{} {}", each.part, sub),
                         .type = each.type,
                         .access = each.access,
                         .capacity = of_stream(each.type)});
    }
  }
  add_record(b, manager_status, "Manager status", manager_parts);
  add_record(b, bus_status, "Bus status", bus_parts);
}

ManagerObjects::ManagerObjects(od::Values& values, BusServices& services, SlotTable& slots, Agenda& agenda,
                               Requests& requests)
    : s_(services), slots_(slots), agenda_(agenda), requests_(requests), dcfs_(*this) {
  values.attach(*this, os_command, os_command);
  values.attach(*this, cia302::request_configuration, cia302::request_configuration);
  values.attach(*this, cia302::nmt_startup, cia302::boot_time);
  values.attach(*this, consumer_heartbeat, consumer_heartbeat);
  values.attach(*this, cia302::dcf_format, cia302::dcf_format);
  dcfs_.attach_to(values);
  values.attach(*this, cia302::configuration_date, cia302::configuration_time);
  values.attach(*this, cia302::expected_program, cia302::expected_program);
  values.attach(*this, cia302::program_of_slave, cia302::program_of_slave);
  values.attach(*this, manager_status, upload_configuration);
}

bool ManagerObjects::is_slot(std::uint8_t sub) const {
  const auto id = NodeId::make(sub);
  return id && id->configured() && slots_.at(*id) != nullptr;
}

std::uint64_t ManagerObjects::of_node(std::uint16_t index, NodeId node) const {
  const auto& tally = slots_.diagnosis().tallies[node.value()];
  switch (index) {
    case emergencies: return of_16_bits(tally.emergencies);
    case losses: return of_16_bits(tally.losses);
    case boots: return of_16_bits(tally.boots);
    default: break;
  }
  const Seat* const seat = slots_.at(node);
  if (seat == nullptr) return 0;
  switch (index) {
    case cia302::slave_assignment: return assignment(*seat);
    case cia302::request_nmt: {
      constexpr std::uint64_t missing = 1;
      const bool there = seat->there() && s_.boots.heard(node).has_value();
      return there ? static_cast<std::uint64_t>(s_.boots.state(node)) : missing;
    }
    case cia302::request_guarding: return seat->there() && !seat->guarded ? 1 : 0;
    case slot_state: return static_cast<std::uint64_t>(seat->shown_state());
    case boot_letter: return static_cast<std::uint8_t>(manager::letter(seat->letter()));
    case cia302::configuration_date: return expected_date(*seat).days;
    case cia302::configuration_time: return expected_date(*seat).ms;
    case cia302::expected_program: return expected_program(*seat);
    case upload_configuration: return static_cast<std::uint64_t>(seat->configuration.upload);
    case cia302::dcf_format: return 0;
    case configuration_status: return static_cast<std::uint64_t>(configured(*seat));
    case last_emergency: {
      const auto& told = seat->last.emergency;
      return told ? told->message.code | std::uint64_t{told->message.error_register} << 16U : 0U;
    }
    default: return expected(*seat, index);
  }
}

std::uint64_t ManagerObjects::of_manager(std::uint8_t sub) const {
  const auto count = [&](auto&& is) {
    return static_cast<std::uint64_t>(
        std::ranges::count_if(slots_.seats(), [&](const auto& s) { return is(s->shown_state()); }));
  };
  switch (sub) {
    case 1: return static_cast<std::uint64_t>(agenda_.phase);
    case 2: return slots_.seats().size();
    case 3: return count([](SlotState s) { return s == SlotState::operational; });
    case 4: return count([](SlotState s) { return s == SlotState::absent || s == SlotState::empty; });
    case 5:
      return count([](SlotState s) {
        return s == SlotState::failed || s == SlotState::wrong_type || s == SlotState::duplicate;
      });
    case 6: return count([](SlotState s) { return s == SlotState::question; });
    default: return slots_.operational() ? 1 : 0;
  }
}

std::uint64_t ManagerObjects::of_bus(std::uint8_t sub) const {
  const can::Status status = s_.port.status();
  const auto sum = slots_.diagnosis().sum();
  enum class State : std::uint8_t { active, passive, bus_off, down };
  switch (sub) {
    case 1: return status.bit_rate != 0 ? status.bit_rate : s_.bus.bitrate;
    case 2:
      return static_cast<std::uint64_t>(!status.up               ? State::down
                                        : status.bus_off         ? State::bus_off
                                        : status.error_passive() ? State::passive
                                                                 : State::active);
    case 3: return status.tec;
    case 4: return status.rec;
    case 5: return status.errors;
    case 6: return status.lost;
    case 7: return of_16_bits(sum.emergencies);
    case 8: return of_16_bits(sum.losses);
    default: return of_16_bits(sum.boots);
  }
}

// Node-ID, code, register, and the time in ms since the main job's world began.
std::uint64_t ManagerObjects::emergency(std::uint8_t sub) const {
  const auto& told = slots_.diagnosis().emergencies;
  if (sub > told.size()) return 0;
  const auto& each = told[sub - 1U];
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(each.at.time_since_epoch()).count();
  return each.node.value() | std::uint64_t{each.message.code} << 8U |
         std::uint64_t{each.message.error_register} << 24U | static_cast<std::uint64_t>(ms) << 32U;
}

AbortCode ManagerObjects::reading(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept {
  if (ref.index == os_command) {
    if (ref.sub == 2) {
      number_[0] = status_;
      value = std::span(number_).first(1);
    } else if (ref.sub == 3) {
      value = {reinterpret_cast<const std::uint8_t*>(reply_.data()), reply_.size()};
    }
    return AbortCode::none;
  }
  if (ref.index == cia302::program_of_slave && ref.sub != 0) {
    const Seat* const seat = is_slot(ref.sub) ? slots_.at(NodeId(ref.sub)) : nullptr;
    domain_ = seat != nullptr ? program_of(*seat) : std::vector<std::uint8_t>();
    if (domain_.empty()) return AbortCode::no_data;
    value = domain_;
    return AbortCode::none;
  }
  std::uint64_t number = 0;
  if (ref.index == cia302::nmt_startup) {
    number = manager::value_of(s_.bus.startup.rules) | (s_.may_command() ? 1U : 0U);
  } else if (ref.index == cia302::boot_time) {
    number = static_cast<std::uint64_t>(
        std::chrono::duration_cast<std::chrono::milliseconds>(s_.bus.startup.boot_time).count());
  } else if (ref.sub == 0) {
    return AbortCode::none;
  } else if (ref.index == manager_status) {
    number = of_manager(ref.sub);
  } else if (ref.index == bus_status) {
    number = of_bus(ref.sub);
  } else if (ref.index == consumer_heartbeat) {
    const auto& seats = slots_.seats();
    number = ref.sub <= seats.size() ? consumer_of(s_.bus.timing, *seats[ref.sub - 1U]) : 0;
  } else if (ref.index == emergency_history) {
    number = emergency(ref.sub);
  } else if (ref.sub <= 127) {
    number = of_node(ref.index, NodeId(ref.sub));
  }
  for (std::size_t i = 0; i < number_.size(); ++i) number_[i] = static_cast<std::uint8_t>(number >> 8U * i);
  value = std::span<const std::uint8_t>(number_).first(std::min(value.size(), number_.size()));
  return AbortCode::none;
}

AbortCode ManagerObjects::writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  if (ref.index == os_command) return ref.sub == 1 ? ask_command(value) : AbortCode::none;
  if (ref.index == cia302::request_nmt && value.size() == 1) return ask_nmt(ref.sub, value[0]);
  if (ref.index == cia302::request_configuration && value.size() == 4) {
    return ask_configuration(ref.sub, load_le<std::uint32_t>(value.data()));
  }
  if (ref.index == upload_configuration && value.size() == 4) {
    return ask_upload(ref.sub, load_le<std::uint32_t>(value.data()));
  }
  return AbortCode::none;
}

AbortCode ManagerObjects::ask_nmt(std::uint8_t sub, std::uint8_t state) {
  if (!s_.may_command() || !s_.bus.commands.allow("nmt")) return AbortCode::local_control;
  const bool all = sub == cia302::all_nodes;
  if (!all && !is_slot(sub)) return AbortCode::invalid_value;
  const auto wanted = network::requested_nmt(state);
  if (!wanted || (wanted->others && !all)) return AbortCode::invalid_value;
  if (!note(fmt::format("1F82h:{:02X} = {}", sub, state))) return AbortCode::device_state;
  if (wanted->others) {
    command_slots(wanted->command);
  } else {
    requests_.command_nmt(wanted->command, all ? co::NmtTarget::all() : co::NmtTarget(NodeId(sub)));
  }
  return AbortCode::none;
}

// An SDO server does not know its client: a node without a slot is not commanded, because it may be the client.
void ManagerObjects::command_slots(co::NmtCommand command) {
  for (const auto& seat : slots_.seats()) requests_.command_nmt(command, co::NmtTarget(seat->id()));
}

AbortCode ManagerObjects::ask_configuration(std::uint8_t sub, std::uint32_t word) {
  if (word != conf) return AbortCode::not_stored;
  if (!s_.may_command() || !s_.bus.commands.allow("configure")) return AbortCode::local_control;
  if (sub != cia302::all_nodes && !is_slot(sub)) return AbortCode::invalid_value;
  if (!note(fmt::format("1F25h:{:02X} = \"conf\"", sub))) return AbortCode::device_state;
  requests_.configure(sub == cia302::all_nodes ? NodeId() : NodeId(sub));
  return AbortCode::none;
}

AbortCode ManagerObjects::ask_upload(std::uint8_t sub, std::uint32_t word) {
  if (word != upld) return AbortCode::not_stored;
  if (s_.only_observes() || !s_.bus.commands.allow("upload")) return AbortCode::local_control;
  const bool all = sub == cia302::all_nodes;
  if (!all && !is_slot(sub)) return AbortCode::invalid_value;
  const Seat* const seat = all ? nullptr : slots_.at(NodeId(sub));
  if (seat != nullptr && seat->configuration.upload == Uploading::under_way) return AbortCode::device_state;
  if (!note(fmt::format("5F0Ah:{:02X} = \"upld\"", sub))) return AbortCode::device_state;
  requests_.upload(all ? NodeId() : NodeId(sub));
  return AbortCode::none;
}

std::vector<std::uint8_t> ManagerObjects::dcf(ObjectRef ref) {
  const Seat* const seat = is_slot(ref.sub) ? slots_.at(NodeId(ref.sub)) : nullptr;
  if (seat == nullptr) return {};
  if (ref.index == cia302::concise_dcf) return concise_dcf_of(*seat);
  const std::string dcf = dcf_of(*seat);
  return {dcf.begin(), dcf.end()};
}

AbortCode ManagerObjects::may_store(ObjectRef ref) {
  if (s_.only_observes() || !s_.bus.commands.allow("configure")) return AbortCode::local_control;
  if (!is_slot(ref.sub)) return AbortCode::invalid_value;
  const Seat& seat = *slots_.at(NodeId(ref.sub));
  const bool busy = seat.state() == SlotState::configuring || seat.configuration.upload == Uploading::under_way;
  return busy ? AbortCode::device_state : AbortCode::none;
}

AbortCode ManagerObjects::store(ObjectRef ref, std::span<const std::uint8_t> bytes) {
  const AbortCode may = may_store(ref);
  if (may != AbortCode::none) return may;
  if (!note(fmt::format("{:04X}h:{:02X} = {}", ref.index, ref.sub, counted(bytes.size(), "byte"))))
    return AbortCode::device_state;
  const auto form = ref.index == cia302::store_dcf ? WrittenFiles::Form::dcf : WrittenFiles::Form::concise;
  return requests_.store(NodeId(ref.sub), form, bytes);
}

AbortCode ManagerObjects::ask_command(std::span<const std::uint8_t> text) {
  if (s_.bus.commands.verbs.empty()) return AbortCode::local_control;
  if (status_ == executing) return AbortCode::device_state;
  if (!note(fmt::format("1023h:01 = {}", text::one_line({reinterpret_cast<const char*>(text.data()), text.size()}))))
    return AbortCode::device_state;
  status_ = executing;
  reply_.clear();
  if (requests_.command(std::string(text.begin(), text.end()))) return AbortCode::none;
  status_ = 0;
  return AbortCode::local_control;
}

// Writes to the history, where a user sees what a node did. The client is unknown to an SDO server: the frame does not
// name it. So that a node cannot fill the disk, more than ten commands a second are refused, after an initial burst.
// False: it is refused.
bool ManagerObjects::note(const std::string& what) {
  constexpr rt::Duration pause = std::chrono::milliseconds(100);
  constexpr unsigned at_once = 32;
  const rt::Time now = s_.executor.now();
  if (next_command_ > now + at_once * pause) return false;
  next_command_ = std::max(next_command_, now) + pause;
  places::HistoryEntry entry;
  entry.event = "commanded by a node";
  entry.reason = what;
  entry.on = slots_.bus();
  const auto noted = slots_.store().note(entry);
  if (!noted)
    slots_.events().tell(EventKind::error, "", "the slot table cannot be written: " + berth::describe(noted.error()));
  slots_.events().tell(EventKind::step, "", "a node of this bus commands: " + what);
  return true;
}

void ManagerObjects::answer(bool good, std::string reply) {
  if (reply.size() > longest_reply) reply.resize(longest_reply);
  reply_ = std::move(reply);
  status_ = good ? done_with_reply : failed_with_reply;
}

}  // namespace berth::operate
