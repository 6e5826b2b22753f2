#include "bench/tools/ear.hpp"

#include <utility>

#include "berth/fleet/clock.hpp"
#include "berth/sparkplug/codec.hpp"
#include "berth/sparkplug/own_metric.hpp"
#include "berth/sparkplug/state.hpp"

namespace berth::bench {

using sparkplug::MessageType;

Ear::Ear(const mqtt::Where& where, sparkplug::EdgeNodeId machine, std::string metric)
    : metric_(std::move(metric)), thread_(std::move(mqtt::Thread::start().value())) {
  mqtt::Options options{.where = where, .client_id = "ear"};
  options.subscriptions = {"spBv1.0/" + machine.group + "/+/" + machine.node + "/#"};
  options.pauses = {.first = mqtt::Milliseconds(50), .longest = mqtt::Milliseconds(200), .good_after = {}};
  const std::scoped_lock lock(mutex_);
  client_ = std::move(mqtt::Client::start(*thread_, options, Random(2), *this).value());
}

Ear::Heard Ear::heard() const {
  const std::scoped_lock lock(mutex_);
  return heard_;
}

std::vector<std::uint8_t> Ear::state(bool online) const { return sparkplug::encode_state({online, {since_}}); }

std::optional<mqtt::Will> Ear::connecting() noexcept {
  const std::scoped_lock lock(mutex_);
  since_ = fleet::SystemClock().now().utc.ms;
  return mqtt::Will{.topic = sparkplug::state_topic(host), .payload = state(false), .retain = true};
}

void Ear::connected(const mqtt::Connected& connected) noexcept {
  const std::scoped_lock lock(mutex_);
  static_cast<void>(client_->publish({.connection = connected.connection,
                                      .topic = sparkplug::state_topic(host),
                                      .payload = state(true),
                                      .qos = mqtt::Qos::at_least_once,
                                      .retain = true}));
}

void Ear::message(std::string_view topic, std::span<const std::uint8_t> payload, bool) noexcept {
  const auto parsed = sparkplug::parse_topic(topic);
  if (!parsed) return;
  const auto decoded = sparkplug::decode(payload);
  if (!decoded) return;
  const std::scoped_lock lock(mutex_);
  if (parsed->type == MessageType::ddata) {
    ++heard_.messages;
    heard_.bytes += payload.size();
  }
  take(*parsed, *decoded);
}

void Ear::take(const sparkplug::Topic& topic, const sparkplug::Payload& payload) {
  if (topic.type == MessageType::nbirth) ++heard_.births;
  for (const auto& each : payload.metrics) {
    if (each.name == sparkplug::lost_metric) {
      if (const auto* lost = std::get_if<std::uint64_t>(&each.value)) heard_.told_lost = *lost;
    }
    if (topic.device.empty()) continue;
    if (each.name == metric_ && each.alias) alias_[topic.device] = *each.alias;
    const auto known = alias_.find(topic.device);
    if (known == alias_.end() || each.alias != known->second) continue;
    const auto value = sparkplug::interpret(sparkplug::DataType::uint32, each.value);
    if (const auto* number = std::get_if<std::uint64_t>(&value)) values_.emplace(topic.device, *number);
  }
  heard_.values = values_.size();
}

}  // namespace berth::bench
