/// An edge node of Sparkplug B 3.0: the session of one machine with its devices, as a state machine without a
/// connection.
///
/// The owner keeps the MQTT connection and calls, in this order: `connecting` (which gives the will for CONNECT),
/// `connected` after CONNACK, `message` for each message of the subscriptions, `disconnected`; and `tick` whenever
/// `next` says so, and after changes. CONNECT has a clean session (3.1.1) or a clean start with expiry 0 (5.0).
///
/// The session begins with NBIRTH and a DBIRTH of each device that is there; with a primary host application only once
/// that host says that it is online. From then on every message has the next of the numbers 0 to 255. What changed
/// while there was no session comes after the births as historical metrics, in portions, live changes first.
///
/// **What is promised.** A change that was taken is published, live or historically, until the broker has proven that
/// it has it (`Outbox::probe`): when the connection breaks, what was not proven goes back into the backlog and is sent
/// again, so a change may come twice, with the same time and value. Nothing is promised of what the backlog refused (it
/// is counted in the metric "Backlog/Lost"); of live changes that were not proven when the process ended; of a host
/// that was not there while the broker was (only a primary host's absence is told, and the broker notices it late).
///
/// **Time.** Timestamps are the owner's UTC. If that clock is set back, metrics of one message stay in chronological
/// order all the same: a change that is older than the one before it goes into a further message.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/sparkplug/backlog.hpp"
#include "berth/sparkplug/message.hpp"
#include "berth/sparkplug/own_metric.hpp"
#include "berth/sparkplug/topic.hpp"

namespace berth::sparkplug {

/// A write that passed all checks: the metric is known, writable, and the value is of its type.
struct Command {
  std::string device;  ///< empty: of the edge node (NCMD)
  std::string metric;
  Value value;
  std::optional<Utc> at;  ///< the host's time, if it said one
};

/// What an edge node says to its application. Implemented by the owner; must not call back from within.
class Application {
 public:
  /// Carry it out. The new value is reported by `EdgeNode::change` once it is so.
  virtual void command(const Command& command) = 0;
  /// A command, or a message, that was not carried out, with the reason, for a log and a metric. `metric` is empty when
  /// the whole message was refused. Names come from outside: escape them before they are shown. It comes as often as
  /// somebody publishes: bound what is made of it.
  virtual void refused(const std::string& device, const std::string& metric, const std::string& reason) = 0;

 protected:
  ~Application() = default;
};

struct EdgeNodeOptions {
  EdgeNodeId id;                            ///< must pass `check`
  std::optional<std::string> primary_host;  ///< no births before this host application is online
  /// The owner has several brokers: an offline host ends the connection even before the births, so that the owner goes
  /// to the next broker. With one it stays connected and waits, which loads the broker less than coming back for ever.
  bool several_servers = false;
  std::uint8_t bd_seq = 0;  ///< for the first CONNECT; `next_bd_seq` of the last run, 0 of the first one
  bool aliases = true;      ///< data has aliases, else names
  /// Least time between two birth sequences that others ask for; requests within are one.
  std::chrono::milliseconds rebirth_pace{1000};
  std::chrono::milliseconds portion_pace{200};  ///< between two portions of historical metrics
  std::size_t portion = 100;                    ///< metrics in one
  std::size_t most_in_message = 500;            ///< live metrics
  std::chrono::milliseconds probe_pace{5000};   ///< between two probes, while something is unproven
  std::size_t most_unproven = 10'000;           ///< live changes; older ones go to the backlog
  std::size_t most_pending = 10'000;            ///< live changes between two ticks; later ones go to the backlog
};

class EdgeNode {
 public:
  /// All three must outlive it. Of the node itself only the metrics of the standard are there.
  EdgeNode(EdgeNodeOptions options, Outbox& outbox, Application& application, Backlog& backlog);
  ~EdgeNode();
  EdgeNode(const EdgeNode&) = delete;
  EdgeNode& operator=(const EdgeNode&) = delete;

  /// A CONNECT is about to be sent. Gives its will, the NDEATH: QoS 1, not retained. Keep `next_bd_seq` before sending
  /// it. A connection that still stood counts as broken.
  [[nodiscard]] Publication connecting(const Now& now);
  /// What the next CONNECT will have; to be kept over restarts.
  [[nodiscard]] std::uint8_t next_bd_seq() const noexcept;
  void connected(const Now& now);
  void disconnected(const Now& now);
  /// Messages that are not for this node are ignored.
  void message(const Incoming& message, const Now& now);
  /// The broker answered what the outbox sent for `probe(mark)`.
  void answered(std::uint64_t mark);
  /// Publishes what waits: births, changes, a portion of the backlog.
  void tick(const Now& now);
  /// When `tick` has something to do next, in the steady clock; empty: not before something else happens.
  [[nodiscard]] std::optional<std::chrono::milliseconds> next(const Now& now) const;
  /// Ends the session as the standard wants it: NDEATH, then DISCONNECT.
  void stop(const Now& now);

  /// The node's own metrics, in place of all earlier ones; a new birth sequence if there is a session. Errors: the
  /// reason, for a person; nothing has changed then.
  Said set_metrics(std::vector<OwnMetric> metrics, const Now& now);
  /// A device is there, with all metrics that it will ever have and their values now; also when its set of metrics has
  /// changed. Errors as above, also for an illegal name or one that differs from another in case only.
  Said device_born(const std::string& device, std::vector<OwnMetric> metrics, const Now& now);
  /// The device does not answer any more. Nothing for one that is not there.
  void device_died(const std::string& device, const Now& now);
  /// The device is no part of the machine any more: it dies, and what the backlog has of it is given up.
  void device_removed(const std::string& device, const Now& now);
  /// A metric's value, quality or both, acquired at `at`. Nothing is published if neither differs from before. `device`
  /// is empty for the node's own. Errors: no such device or metric, a value that is not of its type.
  Said change(const std::string& device, const std::string& metric, Value value, Utc at,
              Quality quality = Quality::good);

  /// Gives all births again, in the pace of those that hosts ask for (`EdgeNodeOptions::rebirth_pace`).
  void ask_rebirth(const Now& now);
  /// NBIRTH was published, and the session is not over.
  [[nodiscard]] bool in_session() const noexcept { return born_; }
  /// Changes that were not kept, or whose metric was gone when they could be sent.
  [[nodiscard]] std::uint64_t lost() const noexcept;
  /// Takes the primary host's next STATE whatever its time; for a host whose clock was set back.
  void forget_primary_state();

 private:
  struct Device;
  struct Parts;
  enum class Link : std::uint8_t { down, connecting, up };

  void births(const Now& now);
  void publish_pending(const Now& now);
  void forward(const Now& now);
  void end_session();
  void leave(const Now& now);
  void state(const Topic& topic, const Incoming& message, const Now& now);
  void commands(const Topic& topic, const Incoming& message, const Now& now);

  EdgeNodeOptions options_;
  std::unique_ptr<Parts> parts_;
  Link link_ = Link::down;
  bool born_ = false;
  std::uint8_t bd_seq_ = 0;       // of the last CONNECT
  std::uint8_t next_bd_seq_ = 0;  // of the next one
  std::optional<std::chrono::milliseconds> rebirth_;
  std::optional<std::chrono::milliseconds> last_birth_;
  std::chrono::milliseconds next_portion_{0};
  std::chrono::milliseconds next_probe_{0};
};

}  // namespace berth::sparkplug
