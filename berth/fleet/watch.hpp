/// A host application at a broker that sees machines: its MQTT connection, and what it knows of the fleet.
///
///     auto watch = fleet::Watch::start(thread, options, clock, random);
///     (*watch)->look([](const sparkplug::Fleet& fleet) { ... });
///
/// Births are not retained by a broker, so a host learns of a machine by its next message. A Berth that hears a host
/// come online gives its births again within `births_within` (edge.hpp); of another maker's edge node a host learns
/// when it says something.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/base/result.hpp"
#include "berth/fleet/clock.hpp"
#include "berth/fleet/thread.hpp"
#include "berth/mqtt/options.hpp"
#include "berth/sparkplug/fleet.hpp"

namespace berth::fleet {

struct WatchOptions {
  mqtt::Options connection{};         ///< its subscriptions are made of `groups`
  std::string host{};                 ///< the host ID: unique at the broker
  std::vector<std::string> groups{};  ///< empty: all
};

class Watch {
 public:
  struct Status {
    bool connected = false;
    std::string trouble{};      ///< why it is not connected, in words
    bool gave_up = false;       ///< it will not try again by itself
    std::uint64_t changes = 0;  ///< counts what came
  };

  /// Begins to connect. `thread` and `clock` must outlive it. Errors in words: a name, an option, a file.
  [[nodiscard]] static tl::expected<std::unique_ptr<Watch>, std::string> start(Thread& thread, WatchOptions options,
                                                                               const Clock& clock, Random random);
  /// STATE offline, disconnect. Waits two seconds at most (`mqtt::Options::farewell`).
  ~Watch();
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;

  // Any thread.

  [[nodiscard]] Status status() const;
  /// Calls `see` once, before it returns. Messages wait meanwhile.
  void look(const std::function<void(const sparkplug::Fleet&)>& see) const;
  /// `sparkplug::Host::write`.
  Result<void> write(const sparkplug::EdgeNodeId& node, const std::string& device, const std::string& metric,
                     sparkplug::Value value);

 private:
  class Core;
  explicit Watch(std::unique_ptr<Core> core) noexcept;
  std::unique_ptr<Core> core_;
};

}  // namespace berth::fleet
