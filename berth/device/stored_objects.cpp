#include "berth/device/stored_objects.hpp"

#include <algorithm>

#include "berth/base/bytes.hpp"

namespace berth::device {
namespace {

constexpr std::uint16_t store_object = 0x1010;
constexpr std::uint16_t restore_object = 0x1011;
constexpr std::uint16_t verified_object = 0x1020;
constexpr std::uint16_t eds_object = 0x1021;
constexpr std::uint32_t save_signature = 0x6576'6173;  // "save"
constexpr std::uint32_t load_signature = 0x6461'6F6C;  // "load"

}  // namespace

StoredObjects::StoredObjects(od::Values& values, co::SdoServers& sdo, NvMemory* memory, const Options& options,
                             Host& host, const LssSlave& lss)
    : values_(&values), sdo_(&sdo), memory_(memory), options_(&options), host_(&host), lss_(&lss) {
  const auto& d = values.description();
  for (const auto index : {store_object, restore_object, eds_object}) {
    if (d.find(index) != nullptr) values.attach(*this, index);
  }
  if (memory != nullptr && d.find(store_object) != nullptr) {
    const GroupOf group_of = options.parameter_group;
    parameters_ = std::make_unique<ParameterStore>(*memory, parameters_at, options.presets,
                                                   static_cast<ParameterStore::Owner&>(*this), group_of,
                                                   ParameterStore::room_for(d, group_of));
    if (!parameters_->usable()) parameters_.reset();
  }
  if (d.find(verified_object) != nullptr) {
    configuration_ = std::make_unique<ConfigurationWatch>(options.parameter_group);
    values.attach(*configuration_, 0x1000, 0xFFFF);
  }
}

StoredObjects::~StoredObjects() {
  if (parameters_ && parameters_->busy()) memory_->forget();  // it would call an object that no longer exists
}

void StoredObjects::power_on() noexcept { saved_ = parameters_ && parameters_->load(); }

void StoredObjects::power_off() noexcept {
  if (parameters_) parameters_->forget();
}

void StoredObjects::resetting() noexcept {
  if (!parameters_ || !parameters_->busy()) return;
  parameters_->abandon();
  host_->storing(false);
}

void StoredObjects::reset_values(od::Area area) noexcept {
  const bool powered = lss_->powered();
  values_->reset(powered ? lss_->active().node_id : NodeId(), area);
  for (const auto& preset : options_->presets) {
    if (area == od::Area::all || od::area_of(preset.object.index) == area) values_->set(preset.object, preset.value);
  }
  if (parameters_ && powered) parameters_->apply(*values_, area);
  const auto& a = lss_->address();
  for (unsigned i = 0; i < 4; ++i) values_->set(ObjectRef{0x1018, static_cast<std::uint8_t>(i + 1)}, a.part(i));
  if (!options_->name.empty()) values_->set_text({0x1008, 0}, options_->name);
}

// --- Objects ---------------------------------------------------------------------------------------------------------

od::AbortCode StoredObjects::reading(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept {
  if (ref.index == eds_object) {
    if (!options_->eds.empty()) value = options_->eds;
  } else if (ref.sub != 0 && value.size() == shown_.size()) {
    shown_ = {};  // bit 0: on command; bit 1: by itself; the description's value does not count
    shown_[0] = parameters_ ? 1 : 0;
    value = shown_;
  }
  return od::AbortCode::none;
}

od::AbortCode StoredObjects::writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  if (ref.index == eds_object) return od::AbortCode::none;
  const bool saves = ref.index == store_object;
  const auto signature = value.size() == 4 ? load_le<std::uint32_t>(value.data()) : 0;
  if (ref.sub == 0 || !parameters_ || signature != (saves ? save_signature : load_signature)) {
    return od::AbortCode::not_stored;
  }
  if (storing()) return od::AbortCode::device_state;
  const bool begun = saves ? parameters_->save(*values_, ref.sub) : parameters_->restore(*values_, ref.sub);
  if (!begun) return od::AbortCode::hardware;
  storing_ = ref;
  host_->storing(true);
  return od::AbortCode::pending;
}

void StoredObjects::parameters_written(bool ok) noexcept {
  saved_ = saved_ || ok;
  host_->storing(false);
  // No answer if the client gave up, or if the device was in a state without SDO meanwhile.
  sdo_->complete(storing_, ok ? od::AbortCode::none : od::AbortCode::hardware);
}

od::AbortCode StoredObjects::ConfigurationWatch::writing(const od::Values& values, ObjectRef ref,
                                                         std::span<const std::uint8_t> value) noexcept {
  changes_ = !std::ranges::equal(values.bytes(ref), value);
  return od::AbortCode::none;
}

void StoredObjects::ConfigurationWatch::written(od::Values& values, ObjectRef ref) noexcept {
  if (!changes_ || ref.index == verified_object) return;
  const auto& description = values.description();
  const auto* const object = description.find(ref.index);
  const auto* const sub = object == nullptr ? nullptr : description.find(*object, ref.sub);
  if (sub == nullptr || group_of_(description, *object, *sub) == parameter_group::none) return;
  values.set({verified_object, 1}, 0U);
  values.set({verified_object, 2}, 0U);
}

}  // namespace berth::device
