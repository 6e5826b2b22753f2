#include "berth/fleet/edge.hpp"

#include <fmt/format.h>

#include <map>
#include <mutex>
#include <utility>

#include "berth/fleet/connection_words.hpp"
#include "berth/fleet/hub_parts.hpp"
#include "berth/fleet/keeping.hpp"
#include "berth/mqtt/client.hpp"
#include "berth/sparkplug/state.hpp"
#include "berth/sparkplug/topic.hpp"

namespace berth::fleet {
namespace {

using namespace std::chrono_literals;
using sparkplug::MessageType;
using std::chrono::milliseconds;

constexpr milliseconds disk_pause = 30s;  // until a disk that refused is tried again
// While so much waits to be sent, nothing more is handed to the connection.
constexpr std::size_t most_waiting_bytes = 4U << 20U;
constexpr std::size_t most_waiting_messages = 2000;
constexpr const char* backlog_metric = "Backlog/Waiting";

// Where the session probes whether the broker has what it got. Nobody needs to hear it.
std::string probe_topic(const sparkplug::EdgeNodeId& id) { return fmt::format("berth-probe/{}/{}", id.group, id.node); }

std::vector<std::string> filters_of(const EdgeOptions& options) {
  std::vector<std::string> filters{sparkplug::make_topic(options.id, MessageType::ncmd),
                                   sparkplug::make_topic(options.id, MessageType::dcmd, "+"),
                                   sparkplug::state_topic("+")};
  return filters;
}

bool is_host_online(std::string_view topic, std::span<const std::uint8_t> payload) {
  const auto parsed = sparkplug::parse_topic(topic);
  if (!parsed || parsed->type != MessageType::state) return false;
  const auto state = sparkplug::decode_state(payload);
  return state && state->online;
}

}  // namespace

/// `mutex_` guards all of it: MQTT's thread calls the handler, the hub's thread `turn`. The executor takes it only
/// when the node ends.
class Edge::Core final : public Turner,
                         private mqtt::Handler,
                         private sparkplug::Outbox,
                         private sparkplug::Application {
 public:
  Core(Hub& hub, EdgeOptions options, Link& link, const Clock& clock, Random random)
      : hub_(hub),
        options_(std::move(options)),
        link_(link),
        clock_(clock),
        random_(random),
        keeping_(options_.backlog_file, options_.backlog_bytes),
        node_({.id = options_.id, .primary_host = options_.primary_host, .bd_seq = keeping_.bd_seq()}, *this, *this,
              keeping_) {}

  tl::expected<void, std::string> begin() {
    // The handler is called soon, and needs the client.
    const std::scoped_lock lock(mutex_);
    auto client = mqtt::Client::start(hub_.connections(), options_.connection, random_.fork(), *this);
    if (!client) return tl::unexpected(client.error());
    client_ = std::move(*client);
    return {};
  }

  void end() {
    {
      const std::scoped_lock lock(mutex_);
      take_news();
      node_.stop(clock_.now());
      ending_ = true;
    }
    // Its handler may be waiting for the mutex.
    client_.reset();
    const std::scoped_lock lock(mutex_);
    keeping_.settle();
    keeping_.try_disk_again();
  }

  milliseconds turn() noexcept override {
    bool anew = false;
    milliseconds patience{1000};
    {
      const std::scoped_lock lock(mutex_);
      take_news();
      introduce();
      publish();
      keep();
      const auto now = clock_.now();
      anew = broken_ && !ending_ && now.steady >= anew_at_;
      if (const auto next = node_.next(now))
        patience = std::max(*next - now.steady, milliseconds(broken_ || is_held_up() ? 50 : 0));
      if (introduce_at_) patience = std::min(patience, std::max(*introduce_at_ - now.steady, milliseconds(0)));
    }
    if (anew) connect_anew();
    return patience;
  }

 private:
  // ---- mqtt::Handler, on MQTT's thread

  std::optional<mqtt::Will> connecting() noexcept override {
    const std::scoped_lock lock(mutex_);
    auto death = node_.connecting(clock_.now());
    keeping_.keep_bd_seq(node_.next_bd_seq());
    return mqtt::Will{.topic = std::move(death.topic),
                      .payload = std::move(death.bytes),
                      .qos = death.qos == 0 ? mqtt::Qos::at_most_once : mqtt::Qos::at_least_once,
                      .retain = death.retain};
  }

  void connected(const mqtt::Connected& connected) noexcept override {
    const std::scoped_lock lock(mutex_);
    connection_ = connected.connection;
    const auto where =
        fmt::format("{} as {}/{}", mqtt::to_string(options_.connection.where), options_.id.group, options_.id.node);
    if (auto words = words_.connected(where, clock_.now().steady)) say(Order::Kind::said, std::move(*words));
    for (const auto& refused : connected.refused) {
      say(Order::Kind::trouble, fmt::format("the broker refuses the subscription {}: {}; no host can command this "
                                            "machine, or its primary host is not heard",
                                            refused.filter, refused.words));
    }
    take_news();
    begin_session();
    hub_.wake();
  }

  void disconnected(const mqtt::Disconnected& over) noexcept override {
    const std::scoped_lock lock(mutex_);
    connection_ = 0;
    probes_.clear();
    broken_ = false;  // the client connects again by itself, in its own pace
    node_.disconnected(clock_.now());
    if (auto words = words_.lost(over, clock_.now().steady)) say(Order::Kind::trouble, std::move(*words));
    hub_.wake();
  }

  void message(std::string_view topic, std::span<const std::uint8_t> payload, bool retained) noexcept override {
    const std::scoped_lock lock(mutex_);
    node_.message({topic, payload, retained}, clock_.now());
    if (!retained && is_host_online(topic, payload)) hear_of_host();
    hub_.wake();
  }

  void published(mqtt::MessageId id) noexcept override {
    const std::scoped_lock lock(mutex_);
    const auto probe = probes_.find(id);
    if (probe == probes_.end()) return;
    node_.answered(probe->second);
    probes_.erase(probe);
  }

  void unpublished(mqtt::MessageId, std::string_view) noexcept override {
    const std::scoped_lock lock(mutex_);
    // Either the connection is over, and that is told next; or a message of this session is missing.
    if (connection_ != 0) give_up_connection(1s);
  }

  // ---- sparkplug::Outbox, within the calls of the node

  void publish(sparkplug::Publication message) override {
    mqtt::Message out{.connection = connection_,
                      .topic = std::move(message.topic),
                      .payload = std::move(message.bytes),
                      .qos = message.qos == 0 ? mqtt::Qos::at_most_once : mqtt::Qos::at_least_once,
                      .retain = message.retain};
    const std::size_t size = out.payload.size();
    const auto accepted = client_ ? client_->publish(std::move(out)) : tl::unexpected(mqtt::Refusal::not_connected);
    if (accepted || accepted.error() == mqtt::Refusal::not_connected) return;  // that it is over is told next
    constexpr milliseconds pause = 30s;
    if (!broken_)
      say(Order::Kind::trouble, fmt::format("a message of {} bytes cannot be sent: {}; Berth connects anew in {} s",
                                            size, mqtt::name(accepted.error()), pause / 1s));
    give_up_connection(pause);
  }
  // The connection has made them already.
  void subscribe(const std::string&, std::uint8_t) override {}
  void probe(std::uint64_t mark) override {
    mqtt::Message out{.connection = connection_, .topic = probe_topic(options_.id), .qos = mqtt::Qos::at_least_once};
    const auto id = client_ ? client_->publish(std::move(out)) : tl::unexpected(mqtt::Refusal::not_connected);
    if (id) probes_.emplace(*id, mark);
  }
  // The primary host has gone: by a new connection the machine waits for it.
  void disconnect() override {
    if (!ending_) give_up_connection(0s);
  }

  // ---- sparkplug::Application, within the calls of the node

  void command(const sparkplug::Command& command) override { put({.kind = Order::Kind::command, .command = command}); }
  void refused(const std::string& device, const std::string& metric, const std::string& reason) override {
    put({.kind = Order::Kind::refused,
         .command = {.device = device, .metric = metric, .value = {}, .at = {}},
         .words = reason});
  }

  // ----

  // Not before the machine has said what it is: the first birth has all of it.
  void begin_session() {
    if (node_known_ && connection_ != 0) node_.connected(clock_.now());
  }

  // Hosts would miss a number of this session.
  void give_up_connection(milliseconds pause) {
    if (broken_) return;
    broken_ = true;
    anew_at_ = clock_.now().steady + pause;
  }

  void put(Order order) {
    if (orders_lost_ > 0) {
      Order lost{.kind = Order::Kind::trouble,
                 .words = fmt::format("{} commands and messages came faster than they could be looked at, and were "
                                      "dropped",
                                      orders_lost_)};
      if (link_.orders.put(lost)) orders_lost_ = 0;
    }
    if (!link_.orders.put(order)) ++orders_lost_;
  }
  void say(Order::Kind kind, std::string words) { put({.kind = kind, .words = std::move(words)}); }

  void take_news() {
    const auto now = clock_.now();
    while (auto news = link_.news.take()) take(std::move(*news), now);
  }

  void take(News news, const sparkplug::Now& now) {
    sparkplug::Said said;
    switch (news.kind) {
      case News::Kind::node:
        news.metrics.push_back({.name = backlog_metric,
                                .type = sparkplug::DataType::uint64,
                                .value = std::uint64_t{keeping_.size()},
                                .at = now.utc});
        said = node_.set_metrics(std::move(news.metrics), now);
        if (!std::exchange(node_known_, true)) begin_session();
        break;
      case News::Kind::born: said = node_.device_born(news.device, std::move(news.metrics), now); break;
      case News::Kind::died: node_.device_died(news.device, now); break;
      case News::Kind::change:
        said = node_.change(news.device, news.metric, std::move(news.value), news.at, news.quality);
        break;
    }
    if (said || said.error() == told_wrong_) return;
    told_wrong_ = said.error();
    say(Order::Kind::trouble, "this was not published: " + said.error());
  }

  void hear_of_host() {
    if (introduce_at_) return;
    introduce_at_ = clock_.now().steady + milliseconds(random_.between(0, births_within.count()));
  }

  void introduce() {
    const auto now = clock_.now();
    if (!introduce_at_ || now.steady < *introduce_at_) return;
    introduce_at_.reset();
    if (node_.in_session()) node_.ask_rebirth(now);
  }

  bool is_held_up() const noexcept {
    if (!client_) return true;
    const auto counts = client_->counts();
    return counts.waiting > most_waiting_messages || counts.waiting_bytes > most_waiting_bytes;
  }

  void publish() {
    if (broken_ || is_held_up()) return;
    const auto now = clock_.now();
    constexpr milliseconds pace = 10s;
    if (now.steady >= tell_backlog_ && node_.in_session()) {
      tell_backlog_ = now.steady + pace;
      static_cast<void>(node_.change("", backlog_metric, std::uint64_t{keeping_.size()}, now.utc));
    }
    node_.tick(now);
  }

  void keep() {
    keeping_.settle();
    const auto now = clock_.now().steady;
    if (keeping_.disk_fails() && !node_.in_session() && now >= disk_again_) {
      disk_again_ = now + disk_pause;
      keeping_.try_disk_again();
    }
    if (auto trouble = keeping_.take_trouble(); !trouble.empty()) say(Order::Kind::trouble, std::move(trouble));
  }

  // On the hub's thread, without the mutex: the client's end waits for its handler.
  void connect_anew() {
    std::unique_ptr<mqtt::Client> old;
    {
      const std::scoped_lock lock(mutex_);
      broken_ = false;
      connection_ = 0;
      probes_.clear();
      node_.disconnected(clock_.now());
      old = std::move(client_);
    }
    old.reset();
    if (auto begun = begin(); !begun) {
      const std::scoped_lock lock(mutex_);
      say(Order::Kind::trouble, begun.error());
      give_up_connection(30s);
    }
  }

  Hub& hub_;
  EdgeOptions options_;
  Link& link_;
  const Clock& clock_;
  Random random_;
  std::mutex mutex_;
  Keeping keeping_;
  sparkplug::EdgeNode node_;
  std::unique_ptr<mqtt::Client> client_;
  mqtt::ConnectionNumber connection_ = 0;
  std::map<mqtt::MessageId, std::uint64_t> probes_;  // the node's mark of each
  ConnectionWords words_;
  std::string told_wrong_;
  std::uint64_t orders_lost_ = 0;
  milliseconds disk_again_{0};
  milliseconds tell_backlog_{0};
  milliseconds anew_at_{0};
  std::optional<milliseconds> introduce_at_;  // to a host that came online
  bool broken_ = false;  // the session needs a new connection, at that time
  bool node_known_ = false;
  bool ending_ = false;
};

Edge::Edge(Hub& hub, std::unique_ptr<Core> core) noexcept : hub_(&hub), core_(std::move(core)) {}

Edge::~Edge() {
  hub_->leave(*core_);
  core_->end();
}

void Edge::wake() const noexcept { hub_->wake(); }

tl::expected<std::unique_ptr<Edge>, std::string> Edge::start(Thread& thread, EdgeOptions options, Link& link,
                                                             const Clock& clock, Random random) {
  if (const auto legal = sparkplug::check(options.id); !legal) return tl::unexpected<std::string>(legal.error().text);
  options.connection.subscriptions = filters_of(options);
  auto core = std::make_unique<Core>(thread.hub(), std::move(options), link, clock, random);
  if (auto begun = core->begin(); !begun) return tl::unexpected(begun.error());
  thread.hub().join(*core);
  return std::unique_ptr<Edge>(new Edge(thread.hub(), std::move(core)));
}

}  // namespace berth::fleet
