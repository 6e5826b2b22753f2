#include "berth/fleet/watch.hpp"

#include <algorithm>
#include <mutex>
#include <optional>
#include <utility>

#include "berth/fleet/hub_parts.hpp"
#include "berth/mqtt/client.hpp"
#include "berth/sparkplug/host.hpp"
#include "berth/sparkplug/topic.hpp"

namespace berth::fleet {
namespace {

using std::chrono::milliseconds;

std::vector<std::string> filters_of(const WatchOptions& options) {
  const std::string root(sparkplug::topic_namespace);
  if (options.groups.empty()) return {root + "/#"};
  std::vector<std::string> filters{sparkplug::state_topic(options.host)};
  for (const auto& group : options.groups) filters.push_back(root + "/" + group + "/#");
  return filters;
}

mqtt::Will will_of(sparkplug::Publication message) {
  return {.topic = std::move(message.topic),
          .payload = std::move(message.bytes),
          .qos = message.qos == 0 ? mqtt::Qos::at_most_once : mqtt::Qos::at_least_once,
          .retain = message.retain};
}

}  // namespace

/// `mutex_` guards all of it: MQTT's thread calls the handler, the hub's thread `turn`, users the rest.
class Watch::Core final : public Turner,
                          private mqtt::Handler,
                          private sparkplug::Outbox,
                          private sparkplug::HostEvents {
 public:
  Core(Hub& hub, WatchOptions options, const Clock& clock, Random random)
      : hub_(hub),
        options_(std::move(options)),
        clock_(clock),
        random_(random),
        host_({.id = options_.host, .groups = options_.groups}, *this, *this) {}

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
      host_.stop(clock_.now());
      ending_ = true;
    }
    // Its handler may be waiting for the mutex.
    client_.reset();
  }

  Hub& hub() noexcept { return hub_; }

  milliseconds turn() noexcept override {
    bool anew = false;
    milliseconds patience{1000};
    {
      const std::scoped_lock lock(mutex_);
      const auto now = clock_.now();
      host_.tick(now);
      anew = broken_ && !ending_;
      if (const auto next = host_.next()) patience = std::max(*next - now.steady, milliseconds(0));
    }
    if (anew) connect_anew();
    return patience;
  }

  Status status() const {
    const std::scoped_lock lock(mutex_);
    return status_;
  }
  void look(const std::function<void(const sparkplug::Fleet&)>& see) const {
    const std::scoped_lock lock(mutex_);
    see(host_.fleet());
  }
  Result<void> write(const sparkplug::EdgeNodeId& node, const std::string& device, const std::string& metric,
                     sparkplug::Value value) {
    const std::scoped_lock lock(mutex_);
    return host_.write(node, device, metric, std::move(value), clock_.now());
  }

 private:
  // ---- mqtt::Handler, on MQTT's thread

  std::optional<mqtt::Will> connecting() noexcept override {
    const std::scoped_lock lock(mutex_);
    return will_of(host_.connecting(clock_.now()));
  }
  void connected(const mqtt::Connected& connected) noexcept override {
    const std::scoped_lock lock(mutex_);
    connection_ = connected.connection;
    status_.connected = connected.refused.empty();
    status_.trouble.clear();
    for (const auto& refused : connected.refused)
      status_.trouble = "the broker refuses the subscription " + refused.filter + ": " + refused.words;
    host_.connected(clock_.now());
    hub_.wake();
  }
  void disconnected(const mqtt::Disconnected& over) noexcept override {
    const std::scoped_lock lock(mutex_);
    connection_ = 0;
    status_.connected = false;
    status_.trouble = over.words;
    status_.gave_up = !over.retry_in.has_value();
    host_.disconnected(clock_.now());
    ++status_.changes;
    hub_.wake();
  }
  void message(std::string_view topic, std::span<const std::uint8_t> payload, bool retained) noexcept override {
    const std::scoped_lock lock(mutex_);
    host_.message({topic, payload, retained}, clock_.now());
    ++status_.changes;
    hub_.wake();
  }
  void published(mqtt::MessageId) noexcept override {}
  void unpublished(mqtt::MessageId, std::string_view) noexcept override {
    const std::scoped_lock lock(mutex_);
    if (connection_ != 0) broken_ = true;
  }

  // ---- sparkplug::Outbox, within the calls of the host

  void publish(sparkplug::Publication message) override {
    auto will = will_of(std::move(message));
    mqtt::Message out{.connection = connection_,
                      .topic = std::move(will.topic),
                      .payload = std::move(will.payload),
                      .qos = will.qos,
                      .retain = will.retain};
    if (client_ && !client_->publish(std::move(out))) broken_ = true;
  }
  // The connection has made them already.
  void subscribe(const std::string&, std::uint8_t) override {}
  void probe(std::uint64_t) override {}
  // Only `end` does this, and it disconnects by itself.
  void disconnect() override {}

  // ---- sparkplug::HostEvents: what is there now is enough

  void born(const sparkplug::EdgeNodeId&, const std::string&) override {}
  void died(const sparkplug::EdgeNodeId&, const std::string&) override {}
  void value(const sparkplug::EdgeNodeId&, const std::string&, const std::string&, const sparkplug::Metric&) override {}
  void trouble(const sparkplug::EdgeNodeId& node, const char* why) override {
    if (node.node.empty()) status_.trouble = why;
  }

  // On the hub's thread, without the mutex: the client's end waits for its handler.
  void connect_anew() {
    std::unique_ptr<mqtt::Client> old;
    {
      const std::scoped_lock lock(mutex_);
      broken_ = false;
      connection_ = 0;
      host_.disconnected(clock_.now());
      old = std::move(client_);
    }
    old.reset();
    if (auto begun = begin(); !begun) {
      const std::scoped_lock lock(mutex_);
      status_.trouble = begun.error();
      status_.gave_up = true;
    }
  }

  Hub& hub_;
  WatchOptions options_;
  const Clock& clock_;
  Random random_;
  mutable std::mutex mutex_;
  Status status_;
  sparkplug::Host host_;
  std::unique_ptr<mqtt::Client> client_;
  mqtt::ConnectionNumber connection_ = 0;
  bool broken_ = false;  // it needs a new connection
  bool ending_ = false;
};

Watch::Watch(std::unique_ptr<Core> core) noexcept : core_(std::move(core)) {}

Watch::~Watch() {
  core_->hub().leave(*core_);
  core_->end();
}

Watch::Status Watch::status() const { return core_->status(); }
void Watch::look(const std::function<void(const sparkplug::Fleet&)>& see) const { core_->look(see); }
Result<void> Watch::write(const sparkplug::EdgeNodeId& node, const std::string& device, const std::string& metric,
                          sparkplug::Value value) {
  return core_->write(node, device, metric, std::move(value));
}

tl::expected<std::unique_ptr<Watch>, std::string> Watch::start(Thread& thread, WatchOptions options, const Clock& clock,
                                                               Random random) {
  if (const auto legal = sparkplug::check_id(options.host); !legal) return tl::unexpected(legal.error().text);
  for (const auto& group : options.groups) {
    if (const auto legal = sparkplug::check_id(group); !legal)
      return tl::unexpected("group " + group + ": " + legal.error().text);
  }
  options.connection.subscriptions = filters_of(options);
  auto core = std::make_unique<Core>(thread.hub(), std::move(options), clock, random);
  if (auto begun = core->begin(); !begun) return tl::unexpected(begun.error());
  thread.hub().join(*core);
  return std::unique_ptr<Watch>(new Watch(std::move(core)));
}

}  // namespace berth::fleet
