#include "berth/network/dictionary_manager.hpp"

#include <algorithm>

#include "berth/od/cia302.hpp"
#include "berth/od/paper3.hpp"

namespace berth::network {
namespace {

namespace cia302 = od::cia302;
using od::AbortCode;
using od::Access;
using od::DataType;
using od::Literal;

constexpr std::uint16_t flying_timing = 0x1F90;
constexpr std::uint8_t priority_sub = 3;
constexpr std::uint8_t cycle_sub = 6;

struct ArraySpec {
  std::uint16_t index;
  std::string_view name;
  DataType type = DataType::unsigned32;
  std::uint32_t capacity = 0;
  Access access = Access::rw;
};

void add_array(od::DescriptionBuilder& builder, const ArraySpec& spec, std::uint8_t most) {
  builder.object(spec.index, od::ObjectCode::array, spec.name, spec.type);
  for (std::uint8_t sub = 1; sub <= most; ++sub) {
    builder.sub(spec.index,
                {.sub = sub, .name = spec.name, .type = spec.type, .access = spec.access, .capacity = spec.capacity});
  }
}

// Sub-index 128 is all nodes; the sub-indices between `most` and 128 do not exist.
void add_requests(od::DescriptionBuilder& builder, const ArraySpec& spec, std::uint8_t most) {
  add_array(builder, spec, most);
  builder.sub(spec.index, {.sub = cia302::all_nodes, .name = "All nodes", .type = spec.type, .access = spec.access});
}

void add_flying(od::DescriptionBuilder& builder, std::uint8_t priority) {
  struct Sub {
    std::string_view name;
    std::uint16_t value;
  };
  constexpr std::array<Sub, cycle_sub> subs{
      Sub{"NMT master timeout", 100},      Sub{"NMT master negotiation time delay", 500},
      Sub{"NMT master priority", 0},       Sub{"Priority time slot", 1500},
      Sub{"CANopen device time slot", 10}, Sub{"Multiple NMT master detect cycle time", 0}};
  builder.object(flying_timing, od::ObjectCode::record, "NMT flying master timing parameters");
  for (std::uint8_t sub = 1; sub <= cycle_sub; ++sub) {
    const auto value = sub == priority_sub ? priority : subs.at(sub - 1U).value;
    builder.sub(
        flying_timing,
        {.sub = sub, .name = subs.at(sub - 1U).name, .type = DataType::unsigned16, .initial = Literal::number(value)});
  }
}

}  // namespace

void add_manager_objects(od::DescriptionBuilder& builder, const ManagerObjects& objects) {
  const std::uint8_t most = std::clamp<std::uint8_t>(objects.most, 1, 127);
  builder.variable(0x102A, {.name = "NMT inhibit time", .type = DataType::unsigned16});
  if (objects.longest_dcf != 0) {
    add_array(builder, {cia302::store_dcf, "Store DCF", DataType::domain, objects.longest_dcf}, most);
    add_array(builder, {cia302::dcf_format, "Storage format", DataType::unsigned8}, most);
    add_requests(builder, {.index = ConfigurationUploads::object, .name = "Upload configuration"}, most);
  }
  if (objects.longest_concise != 0) {
    add_array(builder, {cia302::concise_dcf, "Concise DCF", DataType::domain, objects.longest_concise}, most);
  }
  if (objects.longest_eds != 0) {
    add_array(builder, {cia302::store_eds, "Store EDS", DataType::domain, objects.longest_eds}, most);
    add_array(builder, {cia302::eds_format, "Storage format", DataType::unsigned8}, most);
  }
  if (objects.longest_program != 0) {
    add_array(builder, {cia302::program_of_slave, "Program data of slave", DataType::domain, objects.longest_program},
              most);
  }
  builder.variable(cia302::nmt_startup, {.name = "NMT startup", .initial = Literal::number(objects.startup)});
  for (const auto& array :
       {ArraySpec{cia302::configuration_date, "Expected configuration date"},
        ArraySpec{cia302::configuration_time, "Expected configuration time"},
        ArraySpec{cia302::expected_program_date, "Expected application software date"},
        ArraySpec{cia302::expected_program_time, "Expected application software time"},
        ArraySpec{cia302::expected_program, "Expected software identification"},
        ArraySpec{cia302::slave_assignment, "Slave assignment"},
        ArraySpec{cia302::expected_type, "Device type identification"},
        ArraySpec{cia302::expected_vendor, "Vendor identification"},
        ArraySpec{cia302::expected_product, "Product code"}, ArraySpec{cia302::expected_revision, "Revision number"},
        ArraySpec{cia302::expected_serial, "Serial number"},
        ArraySpec{cia302::restore_configuration, "Restore configuration", DataType::unsigned8}}) {
    add_array(builder, array, most);
  }
  add_requests(builder, {.index = cia302::request_configuration, .name = "Request configuration", .access = Access::wo},
               most);
  add_requests(builder, {cia302::request_nmt, "Request NMT", DataType::unsigned8}, most);
  add_requests(builder, {cia302::request_guarding, "Request guarding", DataType::unsigned8}, most);
  builder.variable(cia302::boot_time, {.name = "Boot time"});
  if (objects.flying) add_flying(builder, objects.priority);
  if (objects.sdo_manager) manager::add_sdo_manager_objects(builder, most);
  if (objects.node_ids) {
    add_array(builder, {.index = manager::NodeIdSource::object, .name = "Node-ID", .type = DataType::unsigned64}, most);
    std::uint8_t sub = cia302::all_nodes;
    for (const char* const name : {"Devices without a place", "Told of nodes 1 to 64", "Told of nodes 65 to 127"}) {
      builder.sub(manager::NodeIdSource::object,
                  {.sub = sub++, .name = name, .type = DataType::unsigned64, .access = Access::ro});
    }
    add_array(builder, {.index = od::paper3::fixed_node_ids, .name = "Fixed node-IDs"}, 4);
  }
}

DictionaryManager::DictionaryManager(can::Dispatcher& dispatcher, od::Values& values,
                                     std::function<void(co::NmtCommand)> apply, const NetworkTiming& timing)
    : values_(&values),
      bus_(dispatcher),
      network_(dispatcher.executor(), bus_, timing),
      flying_(dispatcher, *this),
      transfers_(dispatcher),
      configurations_(dispatcher.executor(), network_),
      uploads_(dispatcher.executor(), network_, values),
      assigning_(dispatcher.executor()) {
  bus_.on_apply(std::move(apply));
  bus_.lead_to(&network_.error_control());
  values.attach(*this, cia302::nmt_startup);
  values.attach(*this, cia302::request_configuration);
  values.attach(*this, ConfigurationUploads::object);
  values.attach(*this, cia302::request_nmt, cia302::request_guarding);
  values.attach(*this, flying_timing);
  const bool gives_channels = values.description().find(cia302::request_sdo) != nullptr;
  if (gives_channels) sdo_requests_ = std::make_unique<manager::SdoRequests>(dispatcher, bus_.sdo(), values);
}

void DictionaryManager::assign_by(manager::NodeIdSource* source) noexcept {
  assigning_.cancel();
  if (node_ids_ != nullptr) node_ids_->used_by(nullptr);
  node_ids_ = source;
  if (node_ids_ != nullptr) node_ids_->used_by(this);
}

void DictionaryManager::own_state(NmtState state, NodeId own) noexcept {
  const NmtState before = std::exchange(state_, state);
  if (state == NmtState::initialising) {
    leads_ = false;
    assigning_.cancel();
    configurations_.end();
    uploads_.end();
    flying_.end();
    if (sdo_requests_) sdo_requests_->end();
    return network_.end();
  }
  network_.own_state(state);
  if (before != NmtState::initialising) return;
  refused_.reset();
  const auto begun = begin(own);
  if (!begun) refused_ = begun.error();
}

void DictionaryManager::power_off() noexcept {
  state_ = NmtState::initialising;
  leads_ = false;
  assigning_.cancel();
  configurations_.end();
  uploads_.end();
  if (sdo_requests_) sdo_requests_->end();
  flying_.power_off();
  network_.end();
}

Result<void> DictionaryManager::begin(NodeId own) {
  own_ = own;
  const auto startup = manager::startup_of(*values_);
  if (!startup) return fail(startup.error());
  if (!startup->master) return {};
  if (!startup->flying && node_ids_ != nullptr) {
    node_ids_->begin(own);
    assigning_.spawn(assign_and_lead());
    return {};
  }
  if (!startup->flying) return lead(own, false);
  return flying_.begin(manager::flying_options_of(*values_, own),
                       [this](NodeId master) { return manager::master_heartbeat_of(*values_, master); });
}

// Runs LSS again and again: it may succeed later, for a device plugged in later or after an interruption of the bus.
rt::Task<void> DictionaryManager::assign_and_lead() {
  std::bitset<128> there;
  const auto first = co_await node_ids_->run(there);
  static_cast<void>(first);
  const auto begun = lead(own_, false);
  if (!begun) refused_ = begun.error();
  while (begun) {
    co_await rt::sleep_for(node_ids_->pause());
    there.reset();
    for (const auto& slave : network_.plan().slaves) {
      const auto* const status = network_.find(slave.node);
      there[slave.node.value()] = status != nullptr && status->ready();
    }
    const auto again = co_await node_ids_->run(there);
    static_cast<void>(again);
    reset_unheard(node_ids_->answered());
    for (const auto& slave : network_.plan().slaves) {
      if (node_ids_->silent()[slave.node.value()]) network_.error_control().silent(slave.node);
    }
  }
}

// Resets slaves that LSS reaches, but of which neither a boot-up message nor a heartbeat was heard: perhaps they were
// reset while the bus was cut, or were silent for a while. They are on the bus and wait to be booted.
void DictionaryManager::reset_unheard(std::bitset<128> answered) {
  for (const auto& slave : network_.plan().slaves) {
    const auto* const status = network_.find(slave.node);
    if (status == nullptr || !answered[slave.node.value()]) continue;
    const bool silent =
        status->phase == SlavePhase::failed && (status->result.status == manager::BootStatus::b || !status->state);
    if (silent || status->phase == SlavePhase::awaited) network_.command(co::NmtCommand::reset_node, slave.node);
  }
}

void DictionaryManager::role_changed() noexcept {
  const bool led = std::exchange(leads_, flying_.is_master());
  if (leads_ && !led) {
    const auto begun = lead(own_, flying_.took_over());
    if (!begun) refused_ = begun.error();
  } else if (led && !leads_) {
    if (sdo_requests_) sdo_requests_->end();
    configurations_.end();
    uploads_.end();
    network_.end(true);
  }
  if (on_role_) on_role_();
}

void DictionaryManager::reset_all() noexcept {
  network_.command(co::NmtCommand::reset_communication, co::NmtTarget::all(), true);
}

Result<void> DictionaryManager::lead(NodeId own, bool taken_over) {
  NetworkPlan plan;
  const auto startup = manager::startup_of(*values_);
  if (!startup) return fail(startup.error());
  plan.startup = *startup;
  plan.own = own;
  plan.taken_over = taken_over;
  plan.boot_time = manager::boot_time_of(*values_);
  bus_.nmt().set_inhibit(manager::nmt_inhibit_time_of(*values_));
  for (std::uint8_t number = 1; number <= 127; ++number) {
    const NodeId node(number);
    const manager::SlaveRules rules = manager::slave_rules_of(*values_, node);
    if (!rules.assigned) continue;
    if (!sources_[number]) sources_[number] = std::make_unique<DictionarySource>(*values_, node);
    sources_[number]->share(&transfers_);
    plan.slaves.push_back({node, rules, &bus_.target(node), sources_[number].get()});
  }
  if (sdo_requests_) {
    manager::SdoManagerOptions options;
    for (const auto& slave : plan.slaves) {
      options.nodes.push_back(slave.node);
      options.heartbeat = std::max(options.heartbeat, slave.rules.heartbeat);
    }
    sdo_requests_->begin(std::move(options));
  }
  return network_.begin(std::move(plan));
}

AbortCode DictionaryManager::reading(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept {
  if (ref.index == flying_timing) {
    const bool by_default = ref.sub == cycle_sub && load_le<std::uint16_t>(value.data()) == 0 && own_.configured();
    if (!by_default) return AbortCode::none;
    const auto cycle = std::chrono::duration_cast<std::chrono::milliseconds>(manager::FlyingTiming{}.cycle_of(own_));
    store_le(shown_.data(), static_cast<std::uint16_t>(cycle.count()));
    value = std::span(shown_).first(2);
    return AbortCode::none;
  }
  const bool plain = ref.index == cia302::nmt_startup || ref.index == cia302::request_configuration || ref.sub == 0;
  if (plain) return AbortCode::none;
  if (ref.index == ConfigurationUploads::object) {
    if (ref.sub > 127) return AbortCode::write_only;
    store_le(shown_.data(), static_cast<std::uint32_t>(uploads_.state(NodeId(ref.sub))));
    value = shown_;
    return AbortCode::none;
  }
  const auto shown = ref.index == cia302::request_nmt ? requests_.state(ref.sub) : requests_.guarding(ref.sub);
  if (!shown) return shown.error();
  shown_[0] = *shown;
  value = std::span(shown_).first(1);
  return AbortCode::none;
}

AbortCode DictionaryManager::writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  if (ref.index == cia302::nmt_startup) {
    const auto startup = manager::startup_of(load_le<std::uint32_t>(value.data()));
    const bool times = values_->description().find(flying_timing) != nullptr;
    return startup && (!startup->flying || times) ? AbortCode::none : AbortCode::invalid_value;
  }
  if (ref.index == flying_timing) {
    constexpr std::uint16_t lowest_priority = 2;
    const bool too_low = ref.sub == priority_sub && load_le<std::uint16_t>(value.data()) > lowest_priority;
    return too_low ? AbortCode::invalid_value : AbortCode::none;
  }
  if (ref.index == cia302::request_configuration) {
    const bool of_itself = own_.configured() && ref.sub == own_.value();
    const bool asked = load_le<std::uint32_t>(value.data()) == ConfigurationRequests::signature;
    if (of_itself && asked) return manager::configure_itself(*values_, own_);
    return configurations_.request(ref.sub, load_le<std::uint32_t>(value.data()));
  }
  if (ref.index == ConfigurationUploads::object) return uploads_.request(ref.sub, load_le<std::uint32_t>(value.data()));
  return ref.index == cia302::request_nmt ? requests_.nmt(ref.sub, value[0]) : requests_.guarding(ref.sub, value[0]);
}

}  // namespace berth::network
