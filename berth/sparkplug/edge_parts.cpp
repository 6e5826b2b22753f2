#include "berth/sparkplug/edge_parts.hpp"

#include <algorithm>

#include "berth/base/words.hpp"
#include "berth/sparkplug/codec.hpp"

namespace berth::sparkplug {
namespace {

std::string lower_case(const std::string& text) {
  std::string out = text;
  std::ranges::transform(out, out.begin(), lower);
  return out;
}

tl::unexpected<std::string> refuse(const std::string& metric, const char* why) {
  return tl::unexpected<std::string>("metric " + berth::quoted(metric) + ": " + why);
}

Result<void> check_metric(const OwnMetric& metric, const Definitions& definitions) {
  if (metric.name.empty()) return fail(Errc::invalid, "it has no name");
  if (!is_utf8(metric.name)) return fail(Errc::invalid, "its name is no UTF-8");
  if (metric.properties.find(quality_key) != nullptr) {
    return fail(Errc::invalid, "its properties name the quality, which is said by itself");
  }
  if (const auto legal = check(metric.properties); !legal) return legal;
  if (const auto* defined = definition_of(metric.value)) {
    if (metric.type != DataType::template_type) return fail(Errc::invalid, "a template is not of its type");
    return check_definition(**defined);
  }
  return check(metric.type, metric.value, definitions, Members::all);
}

}  // namespace

Said MetricTable::define(std::vector<OwnMetric> metrics, const Definitions& definitions, std::uint64_t& next_alias) {
  std::set<std::string> seen;
  for (const auto& each : metrics) {
    if (const auto legal = check_metric(each, definitions); !legal) return refuse(each.name, legal.error().text);
    if (!seen.insert(lower_case(each.name)).second) {
      return refuse(each.name, "another has this name, in the same or another case");
    }
  }
  rows_.clear();
  by_name_.clear();
  by_alias_.clear();
  for (auto& each : metrics) {
    Row row{std::move(each), std::nullopt, false};
    // Whoever does not know the node must be able to ask for a birth: the standard forbids this one an alias.
    if (next_alias != 0 && row.metric.name != rebirth_metric) {
      const auto [known, fresh] = known_.try_emplace(row.metric.name, next_alias);
      if (fresh) ++next_alias;
      row.alias = known->second;
      by_alias_[known->second] = rows_.size();
    }
    by_name_[row.metric.name] = rows_.size();
    rows_.push_back(std::move(row));
  }
  return {};
}

MetricTable::Row* MetricTable::find(const std::string& name) {
  const auto found = by_name_.find(name);
  return found == by_name_.end() ? nullptr : &rows_[found->second];
}

MetricTable::Row* MetricTable::find(std::uint64_t alias) {
  const auto found = by_alias_.find(alias);
  return found == by_alias_.end() ? nullptr : &rows_[found->second];
}

bool MetricTable::any_writable() const noexcept {
  return std::ranges::any_of(rows_, [](const Row& row) { return row.metric.writable; });
}

std::vector<Metric> MetricTable::birth() {
  std::vector<Metric> out;
  for (auto& row : rows_) {
    Metric metric;
    metric.name = row.metric.name;
    metric.alias = row.alias;
    metric.at = row.metric.at;
    metric.type = row.metric.type;
    metric.value = row.metric.value;
    metric.transient = row.metric.transient;
    if (!row.metric.properties.properties.empty()) metric.properties = row.metric.properties;
    if (row.metric.quality != Quality::good) set_quality(metric, row.metric.quality);
    row.told_bad = row.metric.quality != Quality::good;
    out.push_back(std::move(metric));
  }
  std::ranges::stable_sort(out, {}, &Metric::at);
  return out;
}

Definitions MetricTable::definitions() const {
  Definitions out;
  for (const auto& row : rows_) {
    if (const auto* defined = definition_of(row.metric.value)) out.emplace(row.metric.name, *defined);
  }
  return out;
}

Said MetricTable::agrees(const Definitions& definitions) const {
  for (const auto& row : rows_) {
    if (row.metric.type != DataType::template_type || definition_of(row.metric.value) != nullptr) continue;
    const auto legal = check(row.metric.type, row.metric.value, definitions, Members::all);
    if (!legal) return refuse(row.metric.name, legal.error().text);
  }
  return {};
}

const Boxed<Template>* definition_of(const Value& value) noexcept {
  const auto* structure = std::get_if<Boxed<Template>>(&value);
  return structure != nullptr && (*structure)->definition ? structure : nullptr;
}

std::uint64_t Speaker::say(MessageType type, const std::string& device, std::vector<Metric> metrics, Utc now) {
  Payload payload;
  payload.at = now;
  payload.metrics = std::move(metrics);
  payload.seq = seq_++;  // 255 is followed by 0
  auto topic = of_device(type) ? make_topic(id_, type, device) : make_topic(id_, type);
  const bool birth = type == MessageType::nbirth || type == MessageType::dbirth;
  auto bytes = encode(payload, birth ? Types::written : Types::left_out);
  outbox_->publish({.topic = std::move(topic), .bytes = std::move(bytes), .qos = 0, .retain = false});
  return ++mark_;
}

Publication Speaker::death(std::uint8_t bd_seq, Utc now) const {
  Payload payload;
  payload.at = now;
  payload.metrics.push_back(bd_seq_of(bd_seq, now));
  return {.topic = make_topic(id_, MessageType::ndeath), .bytes = encode(payload), .qos = 1, .retain = false};
}

Metric bd_seq_of(std::uint8_t bd_seq, Utc at) {
  Metric out;
  out.name = bd_seq_metric;
  out.at = at;
  out.type = DataType::int64;
  out.value = std::int64_t{bd_seq};
  return out;
}

Metric data_of(const MetricTable::Row& row, const Kept& change, bool historical) {
  Metric out;
  if (row.alias) {
    out.alias = row.alias;
  } else {
    out.name = row.metric.name;
  }
  out.at = change.at;
  out.value = change.value;
  out.type = row.metric.type;
  out.historical = historical;
  out.transient = row.metric.transient;
  // A host keeps the property until it is told otherwise.
  if (change.quality != Quality::good || (row.told_bad && !historical)) set_quality(out, change.quality);
  return out;
}

std::vector<OwnMetric> standard_metrics(std::uint8_t bd_seq, std::uint64_t lost, Utc at) {
  return {{.name = bd_seq_metric, .type = DataType::int64, .value = std::int64_t{bd_seq}, .at = at},
          {.name = rebirth_metric, .type = DataType::boolean, .value = false, .at = at},
          {.name = lost_metric, .type = DataType::uint64, .value = lost, .at = at}};
}

MetricTable* EdgeNode::Parts::table(const std::string& device) {
  if (device.empty()) return &node;
  const auto found = devices.find(device);
  return found != devices.end() && found->second.there ? &found->second.table : nullptr;
}

Forwarder::Fate EdgeNode::Parts::fate(const Kept& change) {
  auto* of = table(change.device);
  if (of == nullptr) return Forwarder::Fate::wait;
  const auto* row = of->find(change.metric);
  return row != nullptr && row->metric.type == change.type ? Forwarder::Fate::send : Forwarder::Fate::never;
}

}  // namespace berth::sparkplug
