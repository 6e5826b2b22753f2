#include "berth/sparkplug/host.hpp"

#include <algorithm>

#include "berth/sparkplug/codec.hpp"
#include "berth/sparkplug/own_metric.hpp"
#include "berth/sparkplug/state.hpp"

namespace berth::sparkplug {
namespace {

constexpr std::uint8_t state_qos = 1;
constexpr std::uint8_t fleet_qos = 0;  // births, data and deaths but wills are of QoS 0

std::optional<std::uint8_t> bd_seq_of(const Payload& payload) {
  const auto found = std::ranges::find(payload.metrics, std::optional<std::string>(bd_seq_metric), &Metric::name);
  if (found == payload.metrics.end()) return std::nullopt;
  const auto value = interpret(DataType::uint64, found->value);
  const auto* number = std::get_if<std::uint64_t>(&value);
  return number != nullptr && *number <= 255 ? std::optional(static_cast<std::uint8_t>(*number)) : std::nullopt;
}

Publication state_message(const std::string& id, bool online, Utc at) {
  return {.topic = state_topic(id), .bytes = encode_state({online, at}), .qos = state_qos, .retain = true};
}

}  // namespace

Host::Host(HostOptions options, Outbox& outbox, HostEvents& events)
    : options_(std::move(options)), outbox_(&outbox), events_(&events), fleet_(options_.limits) {}

Publication Host::connecting(const Now& now) {
  disconnected(now);
  // Never back within one run: edge nodes ignore a STATE that is older than the one before.
  state_at_ = std::max(state_at_, now.utc);
  connecting_ = true;
  return state_message(options_.id, false, state_at_);
}

void Host::connected(const Now& now) {
  if (!std::exchange(connecting_, false)) return;
  outbox_->subscribe(state_topic(options_.id), state_qos);
  const std::string root(topic_namespace);
  if (options_.groups.empty()) outbox_->subscribe(root + "/#", fleet_qos);
  for (const auto& group : options_.groups) outbox_->subscribe(root + "/" + group + "/#", fleet_qos);
  publish_state(true, state_at_);
  online_ = true;
  // What they sent meanwhile nobody kept, their deaths neither.
  for (const auto& [id, node] : fleet_.nodes()) {
    if (node.self.online) ask_rebirth(id, now);
  }
}

void Host::disconnected(const Now& /*now*/) {
  connecting_ = false;
  online_ = false;
  wanted_.clear();
  gaps_.clear();
  for (auto& [id, session] : sessions_) session = {};
  for (const auto& [id, known] : fleet_.nodes()) {
    if (auto node = fleet_.node(id); node && (*node)->self.online) (*node)->in_doubt = true;
  }
}

void Host::stop(const Now& now) {
  if (!online_) return;
  state_at_ = std::max(state_at_, now.utc);
  publish_state(false, state_at_);
  outbox_->disconnect();
  disconnected(now);
}

void Host::publish_state(bool online, Utc at) { outbox_->publish(state_message(options_.id, online, at)); }

bool Host::sees(const EdgeNodeId& node) const {
  return options_.groups.empty() || std::ranges::find(options_.groups, node.group) != options_.groups.end();
}

void Host::message(const Incoming& message, const Now& now) {
  const auto topic = parse_topic(message.topic);
  if (!topic || !online_) return;
  if (topic->type == MessageType::state) return state(*topic, message, now);
  if (topic->type == MessageType::ncmd || topic->type == MessageType::dcmd || !sees(topic->edge)) return;
  auto payload = decode(message.bytes);
  if (!payload) return doubt(topic->edge, payload.error().text, now);
  switch (topic->type) {
    case MessageType::nbirth: return nbirth(*topic, std::move(*payload), now);
    case MessageType::ndeath: return ndeath(*topic, *payload, now);
    default: return ordered(*topic, std::move(*payload), now);
  }
}

void Host::state(const Topic& topic, const Incoming& message, const Now& /*now*/) {
  if (topic.host != options_.id) return;
  const auto said = decode_state(message.bytes);
  if (!said) return events_->trouble({}, said.error().text);
  if (said->at > state_at_) {
    events_->trouble({},
                     "a STATE of this host is newer than its session: the clock was set back, or another host has "
                     "its ID; edge nodes ignore this one");
  }
  // The will of an earlier session came late.
  if (!said->online) publish_state(true, state_at_);
}

void Host::nbirth(const Topic& topic, Payload payload, const Now& now) {
  const auto bd_seq = bd_seq_of(payload);
  if (!bd_seq || !payload.seq || *payload.seq > 255) {
    return doubt(topic.edge, "an NBIRTH has no bdSeq, or no sequence number of 0 to 255", now);
  }
  auto node = fleet_.node(topic.edge);
  if (!node) return events_->trouble(topic.edge, node.error().text);
  // Its devices are stale until they are born in this session, too.
  Fleet::died(**node, now.utc);
  const auto at = payload.at.value_or(now.utc);
  if (const auto kept = fleet_.born(**node, "", std::move(payload.metrics), at); !kept) {
    return events_->trouble(topic.edge, kept.error().text);
  }
  (*node)->bd_seq = bd_seq;
  auto& session = sessions_[topic.edge];
  if (session.due) wanted_.erase({*session.due, topic.edge});
  gaps_.erase(topic.edge);
  session = {};
  session.expected = static_cast<std::uint8_t>(*payload.seq + 1);
  events_->born(topic.edge, "");
}

void Host::ndeath(const Topic& topic, const Payload& payload, const Now& now) {
  const auto* known = fleet_.find(topic.edge);
  const auto bd_seq = bd_seq_of(payload);
  if (known == nullptr || !known->self.online) return;
  // A will of an earlier session, which came after the birth of this one.
  if (!bd_seq || bd_seq != known->bd_seq) return;
  Fleet::died(**fleet_.node(topic.edge), now.utc);
  auto& session = sessions_[topic.edge];
  if (session.due) wanted_.erase({*session.due, topic.edge});
  gaps_.erase(topic.edge);
  session = {};
  events_->died(topic.edge, "");
}

void Host::ordered(const Topic& topic, Payload payload, const Now& now) {
  if (!payload.seq || *payload.seq > 255) return doubt(topic.edge, "a message has no sequence number of 0 to 255", now);
  const auto* known = fleet_.find(topic.edge);
  if (known == nullptr || !known->self.online)
    return doubt(topic.edge, "a message came before its edge node's birth", now);
  auto& node = **fleet_.node(topic.edge);
  if (node.in_doubt) return ask_rebirth(topic.edge, now);
  auto& session = sessions_[topic.edge];
  const auto seq = static_cast<std::uint8_t>(*payload.seq);
  if (seq != session.expected) {
    if (options_.reorder_timeout.count() == 0) return doubt(topic.edge, "a message is missing", now);
    if (session.held.size() >= options_.most_held)
      return doubt(topic.edge, "more messages are out of order than wait", now);
    if (!session.given_up) session.given_up = now.steady + options_.reorder_timeout;
    gaps_.insert(topic.edge);
    session.held.insert_or_assign(seq, Held{topic, std::move(payload)});
    return;
  }
  apply(node, topic, payload, now);
  ++session.expected;
  while (!session.held.empty() && !node.in_doubt) {
    auto next = session.held.extract(session.expected);
    if (next.empty()) break;
    apply(node, next.mapped().topic, next.mapped().payload, now);
    ++session.expected;
    if (!session.held.empty()) session.given_up = now.steady + options_.reorder_timeout;
  }
  if (session.held.empty()) {
    session.given_up.reset();
    gaps_.erase(topic.edge);
  }
}

void Host::apply(FleetNode& node, const Topic& topic, Payload& payload, const Now& now) {
  const auto at = payload.at.value_or(now.utc);
  if (topic.type == MessageType::dbirth) {
    const auto kept = fleet_.born(node, topic.device, std::move(payload.metrics), at);
    if (!kept) return events_->trouble(topic.edge, kept.error().text);
    return events_->born(topic.edge, topic.device);
  }
  if (topic.type != MessageType::ddeath) return data(node, topic, payload, now);
  auto* device = fleet_.device(node, topic.device);
  if (device == nullptr || !device->online) return;
  device->online = false;
  device->since = at;
  events_->died(topic.edge, topic.device);
}

void Host::data(FleetNode& node, const Topic& topic, const Payload& payload, const Now& now) {
  auto* device = fleet_.device(node, topic.device);
  if (device == nullptr || !device->online) return doubt(topic.edge, "data came before its device's birth", now);
  for (const auto& each : payload.metrics) {
    auto* metric = fleet_.metric(*device, each);
    if (metric == nullptr) return doubt(topic.edge, "data names a metric or an alias that no birth has", now);
    if (!each.historical) fleet_.set(*metric, each);
    auto said = each;
    said.type = metric->type;
    said.value = interpret(metric->type, each.value);
    events_->value(topic.edge, topic.device, fleet_.name(*metric), said);
  }
}

void Host::doubt(const EdgeNodeId& id, const char* why, const Now& now) {
  events_->trouble(id, why);
  auto node = fleet_.node(id);
  if (!node) return events_->trouble(id, node.error().text);
  (*node)->in_doubt = true;
  auto& session = sessions_[id];
  session.held.clear();
  session.given_up.reset();
  gaps_.erase(id);
  ask_rebirth(id, now);
}

void Host::ask_rebirth(const EdgeNodeId& id, const Now& now) {
  if (!options_.rebirths || !online_) return;
  auto& session = sessions_[id];
  if (session.due) return;
  if (session.asked >= options_.most_asked) session.asked = options_.most_asked - 1;  // once more, for what came now
  session.due = std::max(now.steady, session.not_before);
  wanted_.emplace(*session.due, id);
  send_rebirths(now);
}

void Host::tick(const Now& now) {
  if (!online_) return;
  gaps(now);
  send_rebirths(now);
}

void Host::send_rebirths(const Now& now) {
  while (!wanted_.empty() && wanted_.begin()->first <= now.steady && next_rebirth_ <= now.steady) {
    const auto id = wanted_.begin()->second;
    wanted_.erase(wanted_.begin());
    next_rebirth_ = now.steady + options_.between_rebirths;
    send_rebirth(id, now);
  }
}

void Host::gaps(const Now& now) {
  std::vector<EdgeNodeId> over;
  for (const auto& id : gaps_) {
    const auto& session = sessions_[id];
    if (session.given_up && *session.given_up <= now.steady) over.push_back(id);
  }
  for (const auto& id : over) doubt(id, "a message is missing", now);
}

std::optional<std::chrono::milliseconds> Host::next() const {
  std::optional<Steady> out;
  if (!wanted_.empty()) out = std::max(wanted_.begin()->first, next_rebirth_);
  for (const auto& id : gaps_) {
    const auto& given_up = sessions_.at(id).given_up;
    if (given_up) out = out ? std::min(*out, *given_up) : *given_up;
  }
  return out;
}

void Host::send_rebirth(const EdgeNodeId& id, const Now& now) {
  auto& session = sessions_[id];
  session.pace =
      session.pace.count() == 0 ? options_.rebirth_pace : std::min(session.pace * 2, options_.slowest_rebirth_pace);
  session.not_before = now.steady + session.pace;
  // Asked again if nothing comes. A birth or a death ends it, and so does patience, until the node says something
  // again.
  session.due.reset();
  if (++session.asked < options_.most_asked) {
    session.due = session.not_before;
    wanted_.emplace(*session.due, id);
  }
  Metric metric;
  metric.name = rebirth_metric;  // never by alias: whoever asks may know none
  metric.at = now.utc;
  metric.value = true;
  Payload payload;
  payload.at = now.utc;
  payload.metrics.push_back(std::move(metric));
  outbox_->publish({make_topic(id, MessageType::ncmd), encode(payload, Types::left_out), 0, false});
}

void Host::forget(const EdgeNodeId& id) {
  if (const auto found = sessions_.find(id); found != sessions_.end()) {
    if (found->second.due) wanted_.erase({*found->second.due, id});
    gaps_.erase(id);
    sessions_.erase(found);
  }
  fleet_.forget(id);
}

Result<void> Host::write(const EdgeNodeId& id, const std::string& device, const std::string& metric, Value value,
                         const Now& now) {
  if (!online_) return fail(Errc::bus, "there is no connection");
  const auto* node = fleet_.find(id);
  const auto* target = node != nullptr ? fleet_.find(*node, device) : nullptr;
  const auto* known = target != nullptr ? fleet_.find(*target, metric) : nullptr;
  if (known == nullptr) return fail(Errc::not_found, "no birth has this metric");
  if (!node->self.online || !target->online) return fail(Errc::invalid, "the edge node or its device is not online");
  if (std::holds_alternative<Null>(value) || !fits(known->type, value)) {
    return fail(Errc::invalid, "the value is not of the metric's type");
  }
  Metric out;
  if (known->has_alias) {
    out.alias = known->alias;
  } else {
    out.name = metric;
  }
  out.at = now.utc;
  out.type = known->type;
  out.value = std::move(value);
  Payload payload;
  payload.at = now.utc;
  payload.metrics.push_back(std::move(out));
  auto topic = device.empty() ? make_topic(id, MessageType::ncmd) : make_topic(id, MessageType::dcmd, device);
  outbox_->publish({std::move(topic), encode(payload, Types::left_out), 0, false});
  return {};
}

}  // namespace berth::sparkplug
