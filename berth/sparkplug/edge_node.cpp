#include "berth/sparkplug/edge_node.hpp"

#include <algorithm>

#include "berth/base/words.hpp"
#include "berth/sparkplug/edge_parts.hpp"

namespace berth::sparkplug {
namespace {

constexpr std::uint8_t command_qos = 1;  // of subscriptions, §5.4 and §5.7

bool reserved(const std::string& metric) {
  return same_word(metric, bd_seq_metric) || same_word(metric, rebirth_metric) || same_word(metric, lost_metric);
}

/// An instance in data may have some of its members only; births need all.
Value merged(const Value& old, const Value& fresh) {
  const auto* before = std::get_if<Boxed<Template>>(&old);
  const auto* after = std::get_if<Boxed<Template>>(&fresh);
  if (before == nullptr || after == nullptr) return fresh;
  Template out = **after;
  out.members = (*before)->members;
  for (auto& member : out.members) {
    const auto changed = std::ranges::find((*after)->members, member.name, &Metric::name);
    if (changed != (*after)->members.end()) member = *changed;
  }
  return Boxed<Template>(std::move(out));
}

Definitions definitions_of(const std::vector<OwnMetric>& metrics) {
  Definitions out;
  for (const auto& each : metrics) {
    if (const auto* defined = definition_of(each.value)) out.emplace(each.name, *defined);
  }
  return out;
}

tl::unexpected<std::string> refuse(std::string why) { return tl::unexpected<std::string>(std::move(why)); }

}  // namespace

EdgeNode::EdgeNode(EdgeNodeOptions options, Outbox& outbox, Application& application, Backlog& backlog)
    : options_(std::move(options)),
      parts_(std::make_unique<Parts>(options_, outbox, application, backlog)),
      bd_seq_(options_.bd_seq),
      next_bd_seq_(options_.bd_seq) {
  (void)parts_->node.define(standard_metrics(bd_seq_, 0, {}), {}, parts_->next_alias);
}

EdgeNode::~EdgeNode() = default;

std::uint8_t EdgeNode::next_bd_seq() const noexcept { return next_bd_seq_; }
std::uint64_t EdgeNode::lost() const noexcept { return parts_->forwarder.lost(); }
void EdgeNode::forget_primary_state() { parts_->primary.forget(); }

Publication EdgeNode::connecting(const Now& now) {
  disconnected(now);
  link_ = Link::connecting;
  bd_seq_ = next_bd_seq_++;  // 255 is followed by 0
  auto* row = parts_->node.find(bd_seq_metric);
  row->metric.value = std::int64_t{bd_seq_};
  row->metric.at = now.utc;
  return parts_->speaker.death(bd_seq_, now.utc);
}

void EdgeNode::connected(const Now& now) {
  if (link_ != Link::connecting) return;
  link_ = Link::up;
  parts_->outbox.subscribe(make_topic(options_.id, MessageType::ncmd), command_qos);
  if (options_.primary_host) {
    parts_->outbox.subscribe(state_topic(*options_.primary_host), command_qos);
    return;  // its retained STATE decides
  }
  births(now);
}

void EdgeNode::disconnected(const Now& /*now*/) {
  end_session();
  link_ = Link::down;
  parts_->primary.reconnected();
  for (auto& [name, device] : parts_->devices) device.subscribed = false;
}

void EdgeNode::end_session() {
  // What was published is older than what waits.
  parts_->forwarder.broken();
  for (const auto& each : parts_->pending) parts_->forwarder.keep(each);
  parts_->pending.clear();
  born_ = false;
  rebirth_.reset();
  for (auto& [name, device] : parts_->devices) device.born = false;
}

void EdgeNode::leave(const Now& now) {
  if (link_ != Link::up) return;
  // Before the births no host has heard of this session, and births must be the first that it hears (§2.3): without
  // them there is no death to tell.
  if (born_) parts_->outbox.publish(parts_->speaker.death(bd_seq_, now.utc));
  end_session();
  parts_->outbox.disconnect();
  link_ = Link::down;
}

void EdgeNode::stop(const Now& now) {
  if (born_ && !rebirth_) publish_pending(now);
  leave(now);
}

void EdgeNode::births(const Now& now) {
  auto& parts = *parts_;
  rebirth_.reset();
  last_birth_ = now.steady;
  born_ = true;
  if (auto* row = parts.node.find(lost_metric); parts.told_lost != lost()) {
    parts.told_lost = lost();
    row->metric.value = parts.told_lost;
    row->metric.at = now.utc;
  }
  parts.node.find(rebirth_metric)->metric.at = now.utc;
  parts.speaker.begin();
  parts.speaker.say(MessageType::nbirth, "", parts.node.birth(), now.utc);
  for (auto& [name, device] : parts.devices) {
    if (device.there) parts.birth_of(options_.id, name, device, now);
  }
  // The births have the values of now. Those that came before them would set a host's view back: they are history.
  const auto waited = std::exchange(parts.pending, {});
  for (const auto& each : waited) {
    auto* table = parts.table(each.device);
    const auto* row = table != nullptr ? table->find(each.metric) : nullptr;
    const bool told = row != nullptr && row->metric.at == each.at && same(row->metric.value, each.value) &&
                      row->metric.quality == each.quality;
    if (told) {
      parts.forwarder.live(parts.speaker.mark(), each);
    } else {
      parts.forwarder.keep(each);
    }
  }
  parts.forwarder.rewind();
  next_portion_ = now.steady + options_.portion_pace;
}

void EdgeNode::Parts::birth_of(const EdgeNodeId& id, const std::string& name, Device& device, const Now& now) {
  if (device.table.any_writable() && !device.subscribed) {
    outbox.subscribe(make_topic(id, MessageType::dcmd, name), command_qos);
    device.subscribed = true;
  }
  speaker.say(MessageType::dbirth, name, device.table.birth(), now.utc);
  device.born = true;
  forwarder.rewind();
}

Said EdgeNode::set_metrics(std::vector<OwnMetric> metrics, const Now& now) {
  for (const auto& each : metrics) {
    if (reserved(each.name)) return refuse("metric " + berth::quoted(each.name) + ": the edge node makes it itself");
  }
  const auto definitions = definitions_of(metrics);
  for (const auto& [name, device] : parts_->devices) {
    if (auto fine = device.table.agrees(definitions); !fine)
      return refuse("device " + berth::quoted(name) + ": " + fine.error());
  }
  auto all = standard_metrics(bd_seq_, parts_->told_lost, now.utc);
  for (auto& each : metrics) all.push_back(std::move(each));
  if (born_ && !rebirth_) publish_pending(now);
  if (auto done = parts_->node.define(std::move(all), definitions, parts_->next_alias); !done) return done;
  if (born_) births(now);
  return {};
}

Said EdgeNode::device_born(const std::string& name, std::vector<OwnMetric> metrics, const Now& now) {
  if (const auto legal = check_id(name); !legal)
    return refuse("device " + berth::quoted(name) + ": " + legal.error().text);
  const auto clash = std::ranges::find_if(
      parts_->devices, [&](const auto& other) { return other.first != name && same_word(other.first, name); });
  if (clash != parts_->devices.end()) {
    return refuse("device " + berth::quoted(name) + ": " + berth::quoted(clash->first) +
                  " differs from it in case only");
  }
  for (const auto& each : metrics) {
    if (definition_of(each.value) != nullptr) {
      return refuse("metric " + berth::quoted(each.name) + ": only the node's own metrics may define templates");
    }
  }
  if (born_ && !rebirth_) publish_pending(now);
  auto& device = parts_->devices[name];
  auto done = device.table.define(std::move(metrics), parts_->node.definitions(), parts_->next_alias);
  if (!done) {
    if (!device.there) parts_->devices.erase(name);
    return done;
  }
  device.there = true;
  // While a rebirth is due nothing but it is sent; it has this device too.
  if (born_ && !rebirth_) parts_->birth_of(options_.id, name, device, now);
  return {};
}

void EdgeNode::device_died(const std::string& name, const Now& now) {
  const auto found = parts_->devices.find(name);
  if (found == parts_->devices.end() || !found->second.there) return;
  if (born_ && !rebirth_) publish_pending(now);
  found->second.there = false;
  if (std::exchange(found->second.born, false)) parts_->speaker.say(MessageType::ddeath, name, {}, now.utc);
}

void EdgeNode::device_removed(const std::string& name, const Now& now) {
  device_died(name, now);
  parts_->devices.erase(name);
  std::erase_if(parts_->pending, [&](const Kept& each) { return each.device == name; });
  parts_->forwarder.give_up(name);
}

Said EdgeNode::change(const std::string& device, const std::string& metric, Value value, Utc at, Quality quality) {
  auto* table = parts_->table(device);
  if (table == nullptr) return refuse("device " + berth::quoted(device) + " is not there");
  auto* row = table->find(metric);
  if (row == nullptr || (device.empty() && reserved(metric)))
    return refuse("there is no metric " + berth::quoted(metric));
  if (definition_of(value) != nullptr || definition_of(row->metric.value) != nullptr) {
    return refuse("metric " + berth::quoted(metric) + ": a template's definition stands in births only");
  }
  const auto members = std::holds_alternative<Null>(row->metric.value) ? Members::all : Members::some;
  if (const auto legal = check(row->metric.type, value, parts_->node.definitions(), members); !legal) {
    return refuse("metric " + berth::quoted(metric) + ": " + legal.error().text);
  }
  auto whole = merged(row->metric.value, value);
  if (same(row->metric.value, whole) && row->metric.quality == quality) return {};
  row->metric.value = std::move(whole);
  row->metric.at = at;
  row->metric.quality = quality;
  Kept kept{device, metric, row->metric.type, std::move(value), at, quality};
  if (born_ && parts_->pending.size() < options_.most_pending) {
    parts_->pending.push_back(std::move(kept));
  } else {
    parts_->forwarder.keep(kept);
  }
  return {};
}

void EdgeNode::ask_rebirth(const Now& now) {
  if (rebirth_) return;
  const auto due = last_birth_ ? std::max(now.steady, *last_birth_ + options_.rebirth_pace) : now.steady;
  rebirth_ = due;
  if (due <= now.steady) births(now);
}

}  // namespace berth::sparkplug
