#include "berth/sparkplug/fleet.hpp"

#include <algorithm>

namespace berth::sparkplug {
namespace {

/// Where a metric stands among those of its device: with an alias by it, else behind them by name.
std::pair<bool, std::uint64_t> order(const FleetMetric& metric) noexcept {
  return {!metric.has_alias, metric.has_alias ? metric.alias : metric.name};
}

std::size_t metrics_of(const FleetNode& node) {
  auto sum = node.self.metrics.size();
  for (const auto& device : node.devices) sum += device.metrics.size();
  return sum;
}

}  // namespace

NamePool::Number NamePool::hold(const std::string& text) {
  if (const auto found = numbers_.find(text); found != numbers_.end()) {
    ++names_[found->second].holders;
    return found->second;
  }
  Number number = 0;
  if (free_.empty()) {
    number = static_cast<Number>(names_.size());
    names_.emplace_back();
  } else {
    number = free_.back();
    free_.pop_back();
  }
  auto& name = names_[number];
  name = {text, 1};
  numbers_.emplace(name.text, number);
  bytes_ += sizeof name + text.size() + 64;
  return number;
}

void NamePool::release(Number number) {
  auto& name = names_[number];
  if (--name.holders != 0) return;
  bytes_ -= sizeof name + name.text.size() + 64;
  numbers_.erase(name.text);
  name.text = {};
  free_.push_back(number);
}

std::optional<NamePool::Number> NamePool::find(const std::string& text) const {
  const auto found = numbers_.find(text);
  return found == numbers_.end() ? std::nullopt : std::optional(found->second);
}

const FleetNode* Fleet::find(const EdgeNodeId& id) const {
  const auto found = nodes_.find(id);
  return found == nodes_.end() ? nullptr : &found->second;
}

const FleetDevice* Fleet::find(const FleetNode& node, const std::string& device) const {
  if (device.empty()) return &node.self;
  const auto number = names_.find(device);
  if (!number) return nullptr;
  const auto found = std::ranges::find(node.devices, *number, &FleetDevice::name);
  return found == node.devices.end() ? nullptr : &*found;
}

const FleetMetric* Fleet::find(const FleetDevice& device, const std::string& metric) const {
  const auto number = names_.find(metric);
  if (!number) return nullptr;
  const auto found = std::ranges::find(device.metrics, *number, &FleetMetric::name);
  return found == device.metrics.end() ? nullptr : &*found;
}

Quality Fleet::quality(const FleetNode& node, const FleetDevice& device, const FleetMetric& metric) {
  return node.self.online && device.online && !node.in_doubt ? metric.quality : Quality::stale;
}

Result<FleetNode*> Fleet::node(const EdgeNodeId& id) {
  if (const auto found = nodes_.find(id); found != nodes_.end()) return &found->second;
  if (nodes_.size() >= limits_.nodes) return fail(Errc::exhausted, "there are more edge nodes than this host keeps");
  auto& node = nodes_[id];
  node.id = id;
  node.self.name = names_.hold("");
  bytes_ += sizeof node + id.group.size() + id.node.size();
  return &node;
}

FleetDevice* Fleet::device(FleetNode& node, const std::string& name) {
  return const_cast<FleetDevice*>(
      std::as_const(*this).find(node, name));  // NOLINT(cppcoreguidelines-pro-type-const-cast)
}

Result<void> Fleet::born(FleetNode& node, const std::string& name, std::vector<Metric> metrics, Utc at) {
  auto* target = device(node, name);
  if (target == nullptr && node.devices.size() >= limits_.devices) {
    return fail(Errc::exhausted, "the edge node has more devices than this host keeps");
  }
  const auto before = target != nullptr ? target->metrics.size() : 0;
  if (metrics_of(node) - before + metrics.size() > limits_.metrics) {
    return fail(Errc::exhausted, "the edge node has more metrics than this host keeps");
  }
  if (bytes() + metrics.size() * sizeof(FleetMetric) > limits_.bytes) {
    return fail(Errc::exhausted, "the fleet needs more memory than this host may use");
  }
  if (target == nullptr) {
    target = &node.devices.emplace_back();
    target->name = names_.hold(name);
    bytes_ += sizeof *target;
  }
  clear(*target);
  target->metrics.reserve(metrics.size());
  for (auto& each : metrics) {
    FleetMetric metric;
    metric.name = names_.hold(each.name.value_or(""));
    metric.has_alias = each.alias.has_value();
    metric.alias = each.alias.value_or(0);
    metric.type = each.type.value_or(DataType::unknown);
    bytes_ += size_of(metric);
    target->metrics.push_back(std::move(metric));
    set(target->metrics.back(), each);
  }
  std::ranges::sort(target->metrics, {}, order);
  target->online = true;
  target->since = at;
  return {};
}

FleetMetric* Fleet::metric(FleetDevice& device, const Metric& wanted) {
  if (wanted.alias) {
    const auto found = std::ranges::lower_bound(device.metrics, std::pair{false, *wanted.alias}, {}, order);
    if (found != device.metrics.end() && found->has_alias && found->alias == *wanted.alias) return &*found;
  }
  if (!wanted.name) return nullptr;
  return const_cast<FleetMetric*>(  // NOLINT(cppcoreguidelines-pro-type-const-cast)
      std::as_const(*this).find(device, *wanted.name));
}

void Fleet::set(FleetMetric& metric, const Metric& data) {
  bytes_ -= size_of(metric);
  metric.value = Null{};  // a shorter text would stay in the memory of a longer one
  metric.value = kept(interpret(metric.type, data.value));
  metric.quality = sparkplug::quality(data).value_or(Quality::bad);
  if (data.at) metric.at = *data.at;
  bytes_ += size_of(metric);
}

void Fleet::died(FleetNode& node, Utc at) {
  node.in_doubt = false;
  node.self.online = false;
  node.self.since = at;
  for (auto& device : node.devices) {
    if (!device.online) continue;
    device.online = false;
    device.since = at;
  }
}

void Fleet::forget(const EdgeNodeId& id) {
  const auto found = nodes_.find(id);
  if (found == nodes_.end()) return;
  auto& node = found->second;
  clear(node.self);
  names_.release(node.self.name);
  for (auto& device : node.devices) {
    clear(device);
    names_.release(device.name);
    bytes_ -= sizeof device;
  }
  bytes_ -= sizeof node + id.group.size() + id.node.size();
  nodes_.erase(found);
}

void Fleet::clear(FleetDevice& device) {
  for (const auto& each : device.metrics) {
    names_.release(each.name);
    bytes_ -= size_of(each);
  }
  device.metrics = {};
}

std::size_t Fleet::size_of(const FleetMetric& metric) noexcept { return sizeof metric + heap_of(metric.value); }

Value Fleet::kept(Value value) const {
  if (heap_of(value) <= limits_.value_bytes && bytes() + heap_of(value) <= limits_.bytes) return value;
  return Unsupported{"it is larger than this host keeps"};
}

}  // namespace berth::sparkplug
