/// What a host application knows of a fleet: edge nodes, their devices, metrics with their values now.
///
/// Made for thousands of devices of a few kinds: a metric takes 64 bytes and what its value has on the heap; its name
/// is kept once for all metrics that have it. 600,000 metrics (1,000 nodes of 30 devices of 20) take less than 64 MB.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "berth/sparkplug/payload.hpp"
#include "berth/sparkplug/topic.hpp"

namespace berth::sparkplug {

/// Texts that are kept once. A number stays valid while someone holds it.
class NamePool {
 public:
  using Number = std::uint32_t;
  /// Takes a hold on the text.
  [[nodiscard]] Number hold(const std::string& text);
  void release(Number number);
  [[nodiscard]] const std::string& text(Number number) const { return names_[number].text; }
  [[nodiscard]] std::optional<Number> find(const std::string& text) const;
  /// Bytes of all texts, about.
  [[nodiscard]] std::size_t bytes() const noexcept { return bytes_; }

 private:
  struct Name {
    std::string text;
    std::uint32_t holders = 0;
  };
  std::deque<Name> names_;
  std::vector<Number> free_;
  std::unordered_map<std::string_view, Number> numbers_;
  std::size_t bytes_ = 0;
};

struct FleetMetric {
  Value value;
  Utc at;
  std::uint64_t alias = 0;
  NamePool::Number name = 0;
  Quality quality = Quality::good;  ///< as the node said; `Fleet::quality` knows whether it is still so
  DataType type = DataType::unknown;
  bool has_alias = false;
};
static_assert(sizeof(FleetMetric) <= 64);

/// A device, or the node itself.
struct FleetDevice {
  NamePool::Number name = 0;
  bool online = false;               ///< born, and not dead since
  Utc since;                         ///< of the birth or the death
  std::vector<FleetMetric> metrics;  ///< by alias; those without one at the end, by name
};

struct FleetNode {
  EdgeNodeId id;
  FleetDevice self;
  std::vector<FleetDevice> devices;
  std::optional<std::uint8_t> bd_seq;  ///< of the last NBIRTH
  /// Something was missed: values are as they were, until the next birth.
  bool in_doubt = false;
};

/// The store behind `Host`, and its view for users. Pointers are valid until the next message is taken.
class Fleet {
 public:
  struct Limits {
    std::size_t nodes = 2'000;
    std::size_t devices = 256;        ///< of one node
    std::size_t metrics = 10'000;     ///< of one node with its devices
    std::size_t value_bytes = 4'096;  ///< on the heap; a larger value is `Unsupported`
    std::size_t bytes = 256 * 1024 * 1024;
  };
  explicit Fleet(const Limits& limits) : limits_(limits) {}

  [[nodiscard]] const std::map<EdgeNodeId, FleetNode>& nodes() const noexcept { return nodes_; }
  [[nodiscard]] const FleetNode* find(const EdgeNodeId& id) const;
  /// `device` is empty for the node itself. Null: not there.
  [[nodiscard]] const FleetDevice* find(const FleetNode& node, const std::string& device) const;
  [[nodiscard]] const FleetMetric* find(const FleetDevice& device, const std::string& metric) const;
  [[nodiscard]] const std::string& name(const FleetMetric& metric) const { return names_.text(metric.name); }
  [[nodiscard]] const std::string& name(const FleetDevice& device) const { return names_.text(device.name); }
  /// Stale when the device or its node is offline or in doubt, else as the node said.
  [[nodiscard]] static Quality quality(const FleetNode& node, const FleetDevice& device, const FleetMetric& metric);
  /// Memory of all of it, about.
  [[nodiscard]] std::size_t bytes() const noexcept { return bytes_ + names_.bytes(); }
  [[nodiscard]] const Limits& limits() const noexcept { return limits_; }

  // For `Host`. `exhausted`: a limit, which the text names.
  [[nodiscard]] Result<FleetNode*> node(const EdgeNodeId& id);
  /// Takes the metrics of a birth in place of those that were there.
  [[nodiscard]] Result<void> born(FleetNode& node, const std::string& device, std::vector<Metric> metrics, Utc at);
  [[nodiscard]] FleetDevice* device(FleetNode& node, const std::string& name);
  [[nodiscard]] FleetMetric* metric(FleetDevice& device, const Metric& wanted);
  void set(FleetMetric& metric, const Metric& data);
  /// The node and all its devices are offline.
  static void died(FleetNode& node, Utc at);
  void forget(const EdgeNodeId& id);

 private:
  void clear(FleetDevice& device);
  [[nodiscard]] static std::size_t size_of(const FleetMetric& metric) noexcept;
  [[nodiscard]] Value kept(Value value) const;

  Limits limits_;
  std::map<EdgeNodeId, FleetNode> nodes_;
  NamePool names_;
  std::size_t bytes_ = 0;
};

}  // namespace berth::sparkplug
