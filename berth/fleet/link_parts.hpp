/// Between the executor's thread and the edge's: a bounded queue each way. Neither thread ever waits for the other.
/// Internal to room `fleet`.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "berth/base/handover.hpp"
#include "berth/sparkplug/edge_node.hpp"

namespace berth::fleet {

/// From the executor. What it puts is taken in this order.
struct News {
  enum class Kind : std::uint8_t {
    node,    ///< the node's own metrics, all of them
    born,    ///< a device with all its metrics
    died,    ///< a device
    change,  ///< a metric's value; without a device: of the node
  };
  Kind kind = Kind::change;
  std::string device{};
  std::string metric{};
  std::vector<sparkplug::OwnMetric> metrics{};
  sparkplug::Value value{};
  sparkplug::Utc at{};
  sparkplug::Quality quality = sparkplug::Quality::good;
};

/// To the executor.
struct Order {
  enum class Kind : std::uint8_t {
    command,  ///< a host's
    refused,  ///< what a host sent and the session did not take: `words` why
    said,     ///< for people: the connection, the disk
    trouble,  ///< the same, and somebody should look
  };
  Kind kind = Kind::said;
  sparkplug::Command command{};
  std::string words{};
};

struct Link {
  static constexpr std::size_t most_news = 4096;
  static constexpr std::size_t most_orders = 256;
  Handover<News> news{most_news};
  Handover<Order> orders{most_orders};
};

}  // namespace berth::fleet
