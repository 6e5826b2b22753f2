#include "berth/manager/dictionary_manager.hpp"

#include <algorithm>

namespace berth::manager {
namespace {

using od::AbortCode;
using od::Access;
using od::DataType;
using od::Literal;

constexpr std::uint16_t nmt_startup = 0x1F80;
constexpr std::uint16_t request_configuration = 0x1F25;
constexpr std::uint16_t request_nmt = 0x1F82;
constexpr std::uint16_t request_guarding = 0x1F83;

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

// Sub-index 128 is all nodes; those between that and `most` are not there.
void add_requests(od::DescriptionBuilder& builder, const ArraySpec& spec, std::uint8_t most) {
  add_array(builder, spec, most);
  builder.sub(spec.index,
              {.sub = NetworkRequests::all_nodes, .name = "All nodes", .type = spec.type, .access = spec.access});
}

}  // namespace

void add_manager_objects(od::DescriptionBuilder& builder, const ManagerObjects& objects) {
  const std::uint8_t most = std::clamp<std::uint8_t>(objects.most, 1, 127);
  builder.variable(0x102A, {.name = "NMT inhibit time", .type = DataType::unsigned16});
  if (objects.longest_dcf != 0) {
    add_array(builder, {0x1F20, "Store DCF", DataType::domain, objects.longest_dcf}, most);
    add_array(builder, {0x1F21, "Storage format", DataType::unsigned8}, most);
  }
  if (objects.longest_concise != 0) {
    add_array(builder, {0x1F22, "Concise DCF", DataType::domain, objects.longest_concise}, most);
  }
  if (objects.longest_eds != 0) {
    add_array(builder, {0x1F23, "Store EDS", DataType::domain, objects.longest_eds}, most);
    add_array(builder, {0x1F24, "Storage format", DataType::unsigned8}, most);
  }
  if (objects.longest_program != 0) {
    add_array(builder, {0x1F58, "Program data of slave", DataType::domain, objects.longest_program}, most);
  }
  builder.variable(nmt_startup, {.name = "NMT startup", .initial = Literal::number(objects.startup)});
  for (const auto& array :
       {ArraySpec{0x1F26, "Expected configuration date"}, ArraySpec{0x1F27, "Expected configuration time"},
        ArraySpec{0x1F53, "Expected application software date"},
        ArraySpec{0x1F54, "Expected application software time"}, ArraySpec{0x1F55, "Expected software identification"},
        ArraySpec{0x1F81, "Slave assignment"}, ArraySpec{0x1F84, "Device type identification"},
        ArraySpec{0x1F85, "Vendor identification"}, ArraySpec{0x1F86, "Product code"},
        ArraySpec{0x1F87, "Revision number"}, ArraySpec{0x1F88, "Serial number"},
        ArraySpec{0x1F8A, "Restore configuration", DataType::unsigned8}}) {
    add_array(builder, array, most);
  }
  add_requests(builder, {.index = request_configuration, .name = "Request configuration", .access = Access::wo}, most);
  add_requests(builder, {request_nmt, "Request NMT", DataType::unsigned8}, most);
  add_requests(builder, {request_guarding, "Request guarding", DataType::unsigned8}, most);
  builder.variable(0x1F89, {.name = "Boot time"});
}

DictionaryManager::DictionaryManager(can::Dispatcher& dispatcher, od::Values& values,
                                     std::function<void(co::NmtCommand)> apply, const NetworkTiming& timing)
    : values_(&values),
      bus_(dispatcher),
      network_(dispatcher.executor(), bus_, timing),
      transfers_(dispatcher),
      configurations_(dispatcher.executor(), network_) {
  bus_.on_apply(std::move(apply));
  bus_.lead_to(&network_.error_control());
  values.attach(*this, nmt_startup);
  values.attach(*this, request_configuration);
  values.attach(*this, request_nmt, request_guarding);
}

void DictionaryManager::own_state(NmtState state, NodeId own) noexcept {
  const NmtState before = std::exchange(state_, state);
  if (state == NmtState::initialising) configurations_.end();
  if (state == NmtState::initialising) return network_.end();
  network_.own_state(state);
  if (before != NmtState::initialising) return;
  refused_.reset();
  const auto begun = begin(own);
  if (!begun) refused_ = begun.error();
}

Result<void> DictionaryManager::begin(NodeId own) {
  NetworkPlan plan;
  const auto startup = startup_of(*values_);
  if (!startup) return fail(startup.error());
  if (!startup->master) return {};
  plan.startup = *startup;
  plan.own = own;
  plan.boot_time = boot_time_of(*values_);
  bus_.nmt().set_inhibit(nmt_inhibit_time_of(*values_));
  for (std::uint8_t number = 1; number <= 127; ++number) {
    const NodeId node(number);
    const SlaveRules rules = slave_rules_of(*values_, node);
    if (!rules.assigned) continue;
    if (!sources_[number]) sources_[number] = std::make_unique<DictionarySource>(*values_, node);
    sources_[number]->share(&transfers_);
    plan.slaves.push_back({node, rules, &bus_.target(node), sources_[number].get()});
  }
  return network_.begin(std::move(plan));
}

AbortCode DictionaryManager::reading(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept {
  const bool plain = ref.index == nmt_startup || ref.index == request_configuration || ref.sub == 0;
  if (plain) return AbortCode::none;
  const auto shown = ref.index == request_nmt ? requests_.state(ref.sub) : requests_.guarding(ref.sub);
  if (!shown) return shown.error();
  shown_[0] = *shown;
  value = shown_;
  return AbortCode::none;
}

AbortCode DictionaryManager::writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  if (ref.index == nmt_startup) {
    const auto startup = startup_of(load_le<std::uint32_t>(value.data()));
    return startup && !startup->flying ? AbortCode::none : AbortCode::invalid_value;
  }
  if (ref.index == request_configuration) {
    return configurations_.request(ref.sub, load_le<std::uint32_t>(value.data()));
  }
  return ref.index == request_nmt ? requests_.nmt(ref.sub, value[0]) : requests_.guarding(ref.sub, value[0]);
}

}  // namespace berth::manager
