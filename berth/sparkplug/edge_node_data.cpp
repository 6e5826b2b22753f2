// What an edge node publishes between its births: live changes, portions of the backlog, probes.
#include <algorithm>

#include "berth/sparkplug/edge_node.hpp"
#include "berth/sparkplug/edge_parts.hpp"

namespace berth::sparkplug {
namespace {

/// The messages of one tick, one open for each device. Metrics of a message are in chronological order and no metric
/// has one time twice; what does not fit that begins a new message.
class Batches {
 public:
  struct Batch {
    std::vector<Metric> metrics;
    std::vector<Kept> changes;
    std::set<std::pair<std::string, std::uint64_t>> said;
  };
  using Publish = std::function<void(const std::string&, Batch&)>;
  Batches(std::size_t most, Publish publish) : most_(most), publish_(std::move(publish)) {}

  void add(const Kept& change, Metric metric) {
    auto& batch = open_[change.device];
    const bool older = !batch.changes.empty() && change.at < batch.changes.back().at;
    if (older || batch.metrics.size() >= most_ || batch.said.contains({change.metric, change.at.ms})) {
      flush(change.device);
    }
    batch.said.emplace(change.metric, change.at.ms);
    batch.changes.push_back(change);
    batch.metrics.push_back(std::move(metric));
  }
  void flush() {
    for (auto& [device, batch] : open_) flush(device);
  }

 private:
  void flush(const std::string& device) {
    auto& batch = open_[device];
    if (!batch.metrics.empty()) publish_(device, batch);
    batch = {};
  }
  std::size_t most_;
  Publish publish_;
  std::map<std::string, Batch> open_;
};

MessageType data_type_of(const std::string& device) { return device.empty() ? MessageType::ndata : MessageType::ddata; }

}  // namespace

void EdgeNode::tick(const Now& now) {
  if (!born_) return;
  if (rebirth_) {
    if (now.steady < *rebirth_) return;  // no data before it
    births(now);
  }
  publish_pending(now);
  forward(now);
  if (!parts_->forwarder.unproven() || now.steady < next_probe_) return;
  next_probe_ = now.steady + options_.probe_pace;
  parts_->outbox.probe(parts_->speaker.mark());
}

std::optional<std::chrono::milliseconds> EdgeNode::next(const Now& now) const {
  if (!born_) return std::nullopt;
  if (rebirth_) return *rebirth_;
  if (!parts_->pending.empty() || parts_->told_lost != lost()) return now.steady;
  std::optional<std::chrono::milliseconds> out;
  if (parts_->forwarder.more()) out = next_portion_;
  if (parts_->forwarder.unproven()) out = out ? std::min(*out, next_probe_) : next_probe_;
  return out;
}

void EdgeNode::publish_pending(const Now& now) {
  auto& parts = *parts_;
  if (parts.told_lost != lost()) {
    parts.told_lost = lost();
    auto* row = parts.node.find(lost_metric);
    row->metric.value = parts.told_lost;
    row->metric.at = now.utc;
    parts.pending.push_back({"", lost_metric, row->metric.type, row->metric.value, now.utc, Quality::good});
  }
  Batches batches(options_.most_in_message, [&](const std::string& device, Batches::Batch& batch) {
    const auto mark = parts.speaker.say(data_type_of(device), device, std::move(batch.metrics), now.utc);
    for (auto& each : batch.changes) {
      // Every birth has this count; it is no history.
      if (!each.device.empty() || each.metric != lost_metric) parts.forwarder.live(mark, std::move(each));
    }
  });
  const auto waited = std::exchange(parts.pending, {});
  for (const auto& each : waited) {
    if (parts.fate(each) != Forwarder::Fate::send) {
      parts.forwarder.keep(each);
      continue;
    }
    auto* row = parts.table(each.device)->find(each.metric);
    batches.add(each, data_of(*row, each, false));
    row->told_bad = each.quality != Quality::good;
  }
  batches.flush();
}

void EdgeNode::forward(const Now& now) {
  auto& parts = *parts_;
  if (!parts.forwarder.more() || now.steady < next_portion_) return;
  next_portion_ = now.steady + options_.portion_pace;
  auto portion = parts.forwarder.portion(options_.portion, [&](const Kept& each) { return parts.fate(each); });
  // A message for each device: their order within a device is what counts.
  std::map<std::string, std::vector<const Backlog::Entry*>> by_device;
  for (const auto& entry : portion) by_device[entry.kept.device].push_back(&entry);
  for (const auto& [device, entries] : by_device) {
    std::vector<Metric> metrics;
    auto* table = parts.table(device);
    for (const auto* entry : entries) metrics.push_back(data_of(*table->find(entry->kept.metric), entry->kept, true));
    const auto mark = parts.speaker.say(data_type_of(device), device, std::move(metrics), now.utc);
    for (const auto* entry : entries) parts.forwarder.sent(mark, entry->id);
  }
}

void EdgeNode::answered(std::uint64_t mark) {
  // An answer of an earlier connection proves nothing of this one; its messages are in the backlog again.
  if (link_ == Link::up) parts_->forwarder.answered(mark);
}

}  // namespace berth::sparkplug
