#include "berth/fleet/settings.hpp"

#include <fmt/format.h>

#include "berth/mqtt/where.hpp"
#include "berth/text/quantity.hpp"

namespace berth::fleet {
namespace {

std::string at(const design::Machine& machine, text::Place place, const std::string& words) {
  if (place.line == 0) return words;
  return fmt::format("{}:{}:{}: error: {}", machine.file, place.line, place.column, words);
}

mqtt::Version version_of(design::MqttVersion version) noexcept {
  switch (version) {
    case design::MqttVersion::v5: return mqtt::Version::v5;
    case design::MqttVersion::v3_1_1: return mqtt::Version::v3_1_1;
    default: return mqtt::Version::automatic;
  }
}

}  // namespace

tl::expected<EdgeOptions, std::string> edge_options(const design::Machine& machine, const std::string& broker,
                                                    const std::string& backlog_file) {
  const design::Mqtt file = machine.mqtt.value_or(design::Mqtt{});
  const bool of_the_file = broker.empty();
  const auto where = mqtt::parse_where(of_the_file ? file.broker : broker);
  if (!where) {
    return tl::unexpected(of_the_file ? at(machine, file.broker_place, "mqtt.broker: " + where.error())
                                      : "--mqtt: " + where.error());
  }
  EdgeOptions options;
  options.id = {file.group, file.node.empty() ? machine.name : file.node};
  if (const auto legal = sparkplug::check(options.id); !legal)
    return tl::unexpected(at(machine, file.place, fmt::format("group or node: {}", legal.error().text)));
  for (const auto& slot : machine.slots) {
    const auto legal = sparkplug::check_id(slot.spec.name.name);
    if (legal) continue;
    return tl::unexpected(at(machine, slot.place,
                             fmt::format("slot {} cannot be a device at a broker: {}; rename it",
                                         text::quoted(slot.spec.name.name), legal.error().text)));
  }
  if (!file.primary_host.empty()) options.primary_host = file.primary_host;
  auto& connection = options.connection;
  connection.where = *where;
  // Of the name, so that the broker notices a machine that runs twice.
  connection.client_id =
      file.client_id.empty() ? fmt::format("berth-{}-{}", options.id.group, options.id.node) : file.client_id;
  connection.version = version_of(file.version);
  connection.login_file = file.login;
  if (where->tls) connection.tls = {.authorities = file.ca, .certificate = file.certificate, .key = file.key};
  // All births at once: some kilobytes for each device, more with many signals.
  std::size_t published = 0;
  for (const auto& slot : machine.slots) published += slot.publish.size();
  constexpr std::size_t of_a_slot = 4096, of_a_signal = 256;
  connection.limits.outgoing_messages = 4096 + 2 * machine.slots.size();
  connection.limits.outgoing_bytes = (8U << 20U) + of_a_slot * machine.slots.size() + of_a_signal * published;
  options.backlog_file = backlog_file;
  options.backlog_bytes = file.backlog;
  return options;
}

}  // namespace berth::fleet
