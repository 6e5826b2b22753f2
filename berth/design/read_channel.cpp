// `[[channel]]` of the machine file: docs/machine-file.md.
#include <fmt/format.h>

#include <algorithm>

#include "berth/base/words.hpp"
#include "berth/design/read_parts.hpp"
#include "berth/od/cia301.hpp"
#include "berth/od/notation.hpp"

namespace berth::design {
namespace {

using text::Table;

using od::cia301::first_client, od::cia301::first_server;

const Slot* read_party(const Machine& machine, Table& table, const char* key) {
  if (!table.require(key, "name a [[slot]] of this file")) return nullptr;
  const auto word = table.string(key);
  if (!word) return nullptr;
  const auto meant = machine.slots_named({}, *word);
  if (meant.size() == 1) return meant.front();
  std::vector<std::string> names;
  for (const auto* const slot : meant) names.push_back(slot->spec.name.bus + "/" + slot->spec.name.name);
  std::vector<std::string_view> known;
  for (const auto& slot : machine.slots) known.push_back(slot.spec.name.name);
  const auto near = closest(*word, known);
  table.error(key,
              meant.empty() ? fmt::format("there is no slot {}", text::quoted(*word))
                            : fmt::format("{} can be {}", text::quoted(*word), some_of(names)),
              !meant.empty() ? "name it with its bus"
              : near.empty() ? "name a [[slot]] of this file"
                             : fmt::format("did you mean {}?", text::quoted(near)));
  return nullptr;
}

// If the device has a description, it must have this channel.
void check_object(Table& table, const char* key, const Slot& slot, std::uint16_t object, const char* what) {
  if (!slot.description) return;
  const auto* const id = slot.description->find(ObjectRef{object, 1});
  if (id != nullptr && !od::writable(id->access)) {
    return table.error(key,
                       fmt::format("{:04X}h:01 of slot {} cannot be written: Berth cannot assign its CAN-IDs", object,
                                   text::quoted(slot.spec.name.name)),
                       "leave the channel out, or name another device");
  }
  if (id != nullptr) return;
  table.error(key,
              fmt::format("the description of slot {} has no {:04X}h: its device has no SDO {} for this channel",
                          text::quoted(slot.spec.name.name), object, what),
              "leave the channel out, or name another device");
}

std::uint16_t next_object(const std::vector<Channel>& channels, NodeId Channel::*party, NodeId node,
                          std::uint16_t first) {
  return static_cast<std::uint16_t>(first + std::ranges::count(channels, node, party));
}

}  // namespace

void read_channel(Machine& machine, Table& table) {
  const Slot* const client = read_party(machine, table, "client");
  const Slot* const server = read_party(machine, table, "server");
  table.finish();
  if (client == nullptr || server == nullptr) return;
  if (client == server) return table.error("server", "client and server are one slot", "name another one");
  const auto& on = client->spec.name.bus;
  if (server->spec.name.bus != on) {
    return table.error("server", fmt::format("it is on bus {}, and the client on bus {}", server->spec.name.bus, on),
                       "a channel is between two devices of one bus");
  }
  const auto bus = std::ranges::find(machine.buses, on, &Bus::name);
  if (bus == machine.buses.end()) return;  // the slot names no such bus, which is reported there
  auto& channels = bus->channels;
  Channel channel{.client = client->spec.id, .server = server->spec.id};
  const auto is_same = [&](const Channel& c) { return c.client == channel.client && c.server == channel.server; };
  if (std::ranges::any_of(channels, is_same))
    return table.error("server", "this channel appears twice", "leave one out");
  if (channels.size() == Channel::most) {
    return table.error("client", fmt::format("bus {} has {} channels already", on, Channel::most),
                       "the CAN-IDs 680h to 6DFh suffice for no more");
  }
  channel.client_object = next_object(channels, &Channel::client, channel.client, first_client);
  channel.server_object = next_object(channels, &Channel::server, channel.server, first_server);
  channel.request = Channel::last_id - 1 - 2 * static_cast<std::uint32_t>(channels.size());
  check_object(table, "client", *client, channel.client_object, "client");
  check_object(table, "server", *server, channel.server_object, "server");
  channels.push_back(channel);
}

}  // namespace berth::design
