// What an edge node hears: STATE of its primary host application, commands.
#include "berth/base/words.hpp"
#include "berth/sparkplug/codec.hpp"
#include "berth/sparkplug/edge_node.hpp"
#include "berth/sparkplug/edge_parts.hpp"

namespace berth::sparkplug {
namespace {

std::string name_of(const Metric& metric) {
  if (metric.name) return *metric.name;
  return metric.alias ? "alias " + std::to_string(*metric.alias) : "";
}

MetricTable::Row* row_of(MetricTable& table, const Metric& metric) {
  if (metric.name) return table.find(*metric.name);
  return metric.alias ? table.find(*metric.alias) : nullptr;
}

/// The value to be written, or why not.
tl::expected<Value, const char*> value_for(const OwnMetric& target, const Metric& metric) {
  using Refused = tl::unexpected<const char*>;
  if (!target.writable) return Refused("it is not writable");
  if (metric.historical) return Refused("a historical value is no command");
  auto value = interpret(target.type, metric.value);
  if (std::holds_alternative<Null>(value)) return Refused("null is no value to write");
  if (const auto* wrong = std::get_if<Unsupported>(&value)) return Refused(wrong->why);
  return value;
}

}  // namespace

void EdgeNode::message(const Incoming& message, const Now& now) {
  const auto topic = parse_topic(message.topic);
  if (!topic || link_ != Link::up) return;
  if (topic->type == MessageType::state) {
    state(*topic, message, now);
  } else if (topic->edge == options_.id && (topic->type == MessageType::ncmd || topic->type == MessageType::dcmd)) {
    commands(*topic, message, now);
  }
}

void EdgeNode::state(const Topic& topic, const Incoming& message, const Now& now) {
  if (topic.host != options_.primary_host) return;
  const auto said = decode_state(message.bytes);
  if (!said) return parts_->application.refused("", "", said.error().text);
  switch (parts_->primary.take(*said)) {
    case PrimaryHost::Heard::online:
      if (!born_) births(now);
      return;
    case PrimaryHost::Heard::offline:
      if (born_ || options_.several_servers) leave(now);
      return;
    case PrimaryHost::Heard::older:
      return parts_->application.refused(
          "", "",
          "the STATE of the primary host is older than the one before it, and is ignored: "
          "a late will, or its clock was set back");
  }
}

void EdgeNode::commands(const Topic& topic, const Incoming& message, const Now& now) {
  const auto refuse = [&](const std::string& metric, const std::string& why) {
    parts_->application.refused(topic.device, metric, why);
  };
  // A broker that keeps a command would carry it out at each connection.
  if (message.retained) return refuse("", "the command is a retained message, so it is not new");
  if (!born_) return refuse("", "there is no session");
  auto* table = parts_->table(topic.device);
  if (table == nullptr) return refuse("", "the device is not there");
  const auto payload = decode(message.bytes);
  if (!payload) return refuse("", payload.error().text);
  bool rebirth = false;
  for (const auto& metric : payload->metrics) {
    if (topic.device.empty() && metric.name == rebirth_metric) {
      rebirth = rebirth || metric.value == Value(true);
      continue;
    }
    auto* row = row_of(*table, metric);
    if (row == nullptr) {
      refuse(name_of(metric), "there is no such metric");
      continue;
    }
    const auto value = value_for(row->metric, metric);
    if (!value) {
      refuse(row->metric.name, value.error());
      continue;
    }
    parts_->application.command({topic.device, row->metric.name, *value, metric.at});
  }
  if (rebirth) ask_rebirth(now);
}

}  // namespace berth::sparkplug
