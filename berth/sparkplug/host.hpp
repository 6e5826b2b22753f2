/// A host application of Sparkplug B 3.0: sees a fleet of edge nodes and writes to it. Without a connection, thread or
/// clock: its owner calls it as that of an `EdgeNode` does (edge_node.hpp).
///
/// It announces itself by STATE messages, keeps what births and data say (`fleet`), and notices when it has missed
/// something: a gap in a node's numbers that is not filled within the reorder time-out, data before a birth, an unknown
/// alias, a payload that is none. It then marks the node as in doubt and asks it for a rebirth, in a bounded pace: per
/// node ever more seldom while nothing comes, and never more than some a second over the whole fleet, so that a host
/// that starts into a running fleet does not make a storm.
///
/// Of a node that says nothing it knows nothing: a node that has nothing to report is seen at its next message, or at
/// once if this host is its primary host application.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "berth/sparkplug/fleet.hpp"
#include "berth/sparkplug/message.hpp"

namespace berth::sparkplug {

/// What a host says to its application. Implemented by the owner; must not call back from within. `device` is empty for
/// the node itself. Names come from outside: escape them before they are shown.
class HostEvents {
 public:
  virtual void born(const EdgeNodeId& node, const std::string& device) = 0;
  virtual void died(const EdgeNodeId& node, const std::string& device) = 0;
  /// A value by NDATA or DDATA. Historical ones are not in the fleet, which has what is now.
  virtual void value(const EdgeNodeId& node, const std::string& device, const std::string& metric,
                     const Metric& data) = 0;
  /// Something is wrong with what came, in words; without a node (both names empty) with this host's own session.
  virtual void trouble(const EdgeNodeId& node, const char* why) = 0;

 protected:
  ~HostEvents() = default;
};

struct HostOptions {
  std::string id;                   ///< must pass `check_id`; unique among all hosts
  std::vector<std::string> groups;  ///< those that it sees, each by `check_id`; empty: all
  Fleet::Limits limits{};
  /// How long a message may come after one that was sent later (§5.11). 0: the broker keeps the order over all topics.
  std::chrono::milliseconds reorder_timeout{2000};
  std::size_t most_held = 64;                    ///< messages of one node that wait for an earlier one
  bool rebirths = true;                          ///< false: never ask for one
  std::chrono::milliseconds rebirth_pace{2000};  ///< to one node; doubles with each that is not answered
  std::chrono::milliseconds slowest_rebirth_pace{60'000};
  int most_asked = 10;                             ///< without an answer; then only when the node says something again
  std::chrono::milliseconds between_rebirths{20};  ///< over the whole fleet
};

class Host {
 public:
  /// Both must outlive it.
  Host(HostOptions options, Outbox& outbox, HostEvents& events);

  /// A CONNECT is about to be sent. Gives its will: STATE offline, QoS 1, retained, with the time of this session.
  [[nodiscard]] Publication connecting(const Now& now);
  void connected(const Now& now);
  /// All is stale.
  void disconnected(const Now& now);
  void message(const Incoming& message, const Now& now);
  void tick(const Now& now);
  [[nodiscard]] std::optional<std::chrono::milliseconds> next() const;
  /// STATE offline, then DISCONNECT.
  void stop(const Now& now);

  [[nodiscard]] const Fleet& fleet() const noexcept { return fleet_; }
  void forget(const EdgeNodeId& node);
  /// NCMD, or DCMD with a device. Errors: `not_found` no such node, device or metric; `invalid` the value is not of the
  /// metric's type, or the node is not online; `bus` there is no connection. That it was published does not say that it
  /// is carried out: the metric's value says so.
  Result<void> write(const EdgeNodeId& node, const std::string& device, const std::string& metric, Value value,
                     const Now& now);
  /// Asks the node for a rebirth, in the pace of all.
  void ask_rebirth(const EdgeNodeId& node, const Now& now);

 private:
  using Steady = std::chrono::milliseconds;
  struct Held {
    Topic topic;
    Payload payload;
  };
  /// Of one node's session, beside what the fleet shows.
  struct Session {
    std::uint8_t expected = 0;          // number of the next message
    std::map<std::uint8_t, Held> held;  // by number
    std::optional<Steady> given_up;     // when a gap is one
    std::optional<Steady> due;          // a rebirth is to be asked for
    Steady pace{0};                     // to the one after the last; 0: none was asked for
    Steady not_before{0};
    int asked = 0;
  };

  void state(const Topic& topic, const Incoming& message, const Now& now);
  void nbirth(const Topic& topic, Payload payload, const Now& now);
  void ndeath(const Topic& topic, const Payload& payload, const Now& now);
  void ordered(const Topic& topic, Payload payload, const Now& now);
  void apply(FleetNode& node, const Topic& topic, Payload& payload, const Now& now);
  void data(FleetNode& node, const Topic& topic, const Payload& payload, const Now& now);
  void doubt(const EdgeNodeId& node, const char* why, const Now& now);
  void gaps(const Now& now);
  void send_rebirths(const Now& now);
  void send_rebirth(const EdgeNodeId& node, const Now& now);
  void publish_state(bool online, Utc at);
  [[nodiscard]] bool sees(const EdgeNodeId& node) const;

  HostOptions options_;
  Outbox* outbox_;
  HostEvents* events_;
  Fleet fleet_;
  std::map<EdgeNodeId, Session> sessions_;
  std::set<std::pair<Steady, EdgeNodeId>> wanted_;  // rebirths by when they are due
  std::set<EdgeNodeId> gaps_;                       // nodes with messages held
  Steady next_rebirth_{0};
  Utc state_at_;
  bool connecting_ = false;
  bool online_ = false;
};

}  // namespace berth::sparkplug
