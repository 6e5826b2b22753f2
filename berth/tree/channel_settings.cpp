#include "berth/tree/channel_settings.hpp"

#include <algorithm>

#include "berth/co/cob_id.hpp"
#include "berth/od/cia301.hpp"

namespace berth::tree {
namespace {

constexpr std::uint8_t request_id = 1, response_id = 2, other_node = 3;

manager::Setting part(std::uint16_t object, std::uint8_t sub, std::uint32_t value) {
  const bool is_node = sub == other_node;
  return {.object = {object, sub},
          .type = is_node ? od::DataType::unsigned8 : od::DataType::unsigned32,
          .value = od::Literal::number(value),
          .name = is_node ? "Node-ID of the other end" : "COB-ID of an SDO channel"};
}

// A device may have saved the channels of an earlier machine file, whose CAN-IDs now belong to another channel.
void close_others(const od::Description& description, manager::Configuration& made) {
  for (const auto& object : description.objects()) {
    const auto planned = [&](const manager::Setting& s) { return s.object.index == object.index; };
    if (!od::cia301::is_additional_channel(object.index) || std::ranges::any_of(made.settings, planned)) continue;
    for (const std::uint8_t sub : {request_id, response_id}) {
      const auto* const id = description.find(ObjectRef{object.index, sub});
      if (id != nullptr && od::writable(id->access))
        made.settings.push_back(part(object.index, sub, co::CobId::invalid_bit));
    }
  }
}

// A server may lack the sub-object for the client's node-ID; only its description says so.
bool names_client(const design::Slot& server, std::uint16_t object) {
  return server.description && server.description->find(ObjectRef{object, other_node}) != nullptr;
}

manager::Configuration channels_of(const design::Bus& bus, const design::Slot& slot, const std::string& file) {
  manager::Configuration made;
  made.file = file;
  for (const auto& channel : bus.channels) {
    const bool is_client = channel.client == slot.spec.id;
    if (!is_client && channel.server != slot.spec.id) continue;
    const std::uint16_t object = is_client ? channel.client_object : channel.server_object;
    const NodeId other = is_client ? channel.server : channel.client;
    made.settings.push_back(part(object, request_id, channel.request));
    made.settings.push_back(part(object, response_id, channel.request + 1));
    if (is_client || names_client(slot, object)) made.settings.push_back(part(object, other_node, other.value()));
  }
  // A slot's own configuration file defines its other channels.
  if (slot.description && slot.spec.config.empty()) close_others(*slot.description, made);
  std::ranges::sort(made.settings, {}, &manager::Setting::object);
  return made;
}

}  // namespace

bool has_channels(const design::Machine& machine, const design::Slot& slot) {
  const design::Bus* const line = machine.bus(slot.spec.name.bus);
  return line != nullptr && !line->channels.empty() && !channels_of(*line, slot, machine.file).settings.empty();
}

manager::SlotSettings with_channels(const design::Machine& machine, const std::string& bus,
                                    manager::SlotSettings settings) {
  const design::Bus* const line = machine.bus(bus);
  if (line == nullptr || line->channels.empty()) return settings;
  for (const auto& slot : machine.slots) {
    if (slot.spec.name.bus != bus) continue;
    const auto own = channels_of(*line, slot, machine.file);
    if (own.settings.empty()) continue;
    auto& place = settings[slot.spec.name.name];
    place = std::make_shared<const manager::Configuration>(place ? manager::joined(*place, own) : own);
  }
  return settings;
}

}  // namespace berth::tree
