// The parts of an edge node: its metrics with their aliases, and what numbers and publishes its messages. Internal to
// `EdgeNode`.
#pragma once

#include <set>
#include <unordered_map>

#include "berth/sparkplug/conform.hpp"
#include "berth/sparkplug/edge_node.hpp"
#include "berth/sparkplug/forwarder_parts.hpp"
#include "berth/sparkplug/state.hpp"

namespace berth::sparkplug {

/// The metrics of the node or of one device. A name keeps its alias as long as the node lives.
class MetricTable {
 public:
  struct Row {
    OwnMetric metric;
    std::optional<std::uint64_t> alias;
    bool told_bad = false;  ///< the last quality that was published is not good
  };
  /// Takes `metrics` in place of all, or says why not. `next_alias` counts over all tables of the node; 0: no aliases.
  Said define(std::vector<OwnMetric> metrics, const Definitions& definitions, std::uint64_t& next_alias);
  [[nodiscard]] Row* find(const std::string& name);
  [[nodiscard]] Row* find(std::uint64_t alias);
  [[nodiscard]] bool any_writable() const noexcept;
  /// As a birth has them, in chronological order.
  [[nodiscard]] std::vector<Metric> birth();
  [[nodiscard]] Definitions definitions() const;
  /// Whether every template's instance has its definition among these.
  [[nodiscard]] Said agrees(const Definitions& definitions) const;

 private:
  std::vector<Row> rows_;
  std::unordered_map<std::string, std::size_t> by_name_;
  std::unordered_map<std::uint64_t, std::size_t> by_alias_;
  std::unordered_map<std::string, std::uint64_t> known_;  // aliases, also of metrics that are gone
};

/// The definition that a value is, or null.
[[nodiscard]] const Boxed<Template>* definition_of(const Value& value) noexcept;

/// Numbers and publishes the messages of one node.
class Speaker {
 public:
  Speaker(EdgeNodeId id, Outbox& outbox) : id_(std::move(id)), outbox_(&outbox) {}
  /// The next message is an NBIRTH: 0.
  void begin() noexcept { seq_ = 0; }
  /// Publishes with the next number; QoS 0, not retained. The mark is for `Outbox::probe`.
  std::uint64_t say(MessageType type, const std::string& device, std::vector<Metric> metrics, Utc now);
  /// NDEATH, as will or published: QoS 1, not retained, no number, bdSeq alone.
  [[nodiscard]] Publication death(std::uint8_t bd_seq, Utc now) const;
  [[nodiscard]] std::uint64_t mark() const noexcept { return mark_; }

 private:
  EdgeNodeId id_;
  Outbox* outbox_;
  std::uint8_t seq_ = 0;
  std::uint64_t mark_ = 0;
};

/// The metric bdSeq of an NDEATH: Int64, by name.
[[nodiscard]] Metric bd_seq_of(std::uint8_t bd_seq, Utc at);
/// A change as NDATA and DDATA have it.
[[nodiscard]] Metric data_of(const MetricTable::Row& row, const Kept& change, bool historical);
/// The metrics that the standard and Berth add to those of the application.
[[nodiscard]] std::vector<OwnMetric> standard_metrics(std::uint8_t bd_seq, std::uint64_t lost, Utc at);

struct EdgeNode::Device {
  MetricTable table;
  bool there = false;       // alive
  bool born = false;        // its DBIRTH is in this session
  bool subscribed = false;  // to its DCMD, in this connection
};

struct EdgeNode::Parts {
  Parts(const EdgeNodeOptions& options, Outbox& out, Application& app, Backlog& backlog)
      : outbox(out),
        application(app),
        speaker(options.id, out),
        forwarder(backlog, options.most_unproven),
        next_alias(options.aliases ? 1 : 0) {}
  /// The table of a device, or of the node for an empty name; null for one that is not there.
  [[nodiscard]] MetricTable* table(const std::string& device);
  void birth_of(const EdgeNodeId& id, const std::string& name, Device& device, const Now& now);
  /// Whether a change can be published in this session.
  [[nodiscard]] Forwarder::Fate fate(const Kept& change);

  Outbox& outbox;            // NOLINT(cppcoreguidelines-avoid-const-or-ref-data-members)
  Application& application;  // NOLINT(cppcoreguidelines-avoid-const-or-ref-data-members)
  Speaker speaker;
  Forwarder forwarder;
  PrimaryHost primary;
  MetricTable node;
  std::vector<OwnMetric> own;  // of the application, for the next definition
  std::map<std::string, Device> devices;
  std::deque<Kept> pending;
  std::uint64_t next_alias;
  std::uint64_t told_lost = 0;
};

}  // namespace berth::sparkplug
