/// One machine as an edge node at a broker: its MQTT connection, its Sparkplug session, and what is kept while nobody
/// gets it. It lives on the threads of `fleet::Thread`; the executor's thread meets it in two bounded queues only.
#pragma once

#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "berth/base/random.hpp"
#include "berth/fleet/clock.hpp"
#include "berth/fleet/link_parts.hpp"
#include "berth/fleet/thread.hpp"
#include "berth/mqtt/options.hpp"
#include "berth/sparkplug/edge_node.hpp"

namespace berth::fleet {

/// After a host came online, the births are given again within this time, at a random instant, so that thousands of
/// machines do not do it at once. A broker keeps no births: without them the host would know nothing of a machine in
/// which nothing changes.
inline constexpr std::chrono::milliseconds births_within{3000};

struct EdgeOptions {
  sparkplug::EdgeNodeId id{};
  std::optional<std::string> primary_host{};
  mqtt::Options connection{};  ///< its subscriptions are made of `id`
  std::string backlog_file{};  ///< empty: what hosts have not got is kept in memory
  std::uint64_t backlog_bytes = 16U << 20U;
};

class Edge {
 public:
  /// Begins to connect. `thread`, `link` and `clock` must outlive it. Errors in words: a name, an option, a file.
  [[nodiscard]] static tl::expected<std::unique_ptr<Edge>, std::string> start(Thread& thread, EdgeOptions options,
                                                                              Link& link, const Clock& clock,
                                                                              Random random);
  /// Publishes what waits and NDEATH, disconnects, and keeps what hosts have not got. Waits two seconds at most
  /// (`mqtt::Options::farewell`).
  ~Edge();
  Edge(const Edge&) = delete;
  Edge& operator=(const Edge&) = delete;
  /// There is news in the link. Never waits.
  void wake() const noexcept;

 private:
  class Core;
  Edge(Hub& hub, std::unique_ptr<Core> core) noexcept;
  Hub* hub_;
  std::unique_ptr<Core> core_;
};

}  // namespace berth::fleet
