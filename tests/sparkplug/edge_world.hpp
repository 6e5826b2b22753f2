// An edge node with an outbox that notes what it does, and an application that notes what it hears.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "berth/sparkplug/codec.hpp"
#include "berth/sparkplug/edge_node.hpp"
#include "berth/sparkplug/state.hpp"

namespace sparkplug_test {

using namespace berth;
using namespace berth::sparkplug;
using namespace std::chrono_literals;

class Wire final : public Outbox {
 public:
  void publish(Publication message) override {
    order.push_back("publish " + message.topic);
    published.push_back(std::move(message));
  }
  void subscribe(const std::string& filter, std::uint8_t qos) override {
    order.push_back("subscribe " + filter);
    subscribed.emplace_back(filter, qos);
  }
  void probe(std::uint64_t mark) override { probes.push_back(mark); }
  void disconnect() override {
    order.push_back("disconnect");
    ++disconnects;
  }
  void clear() { *this = Wire(); }

  std::vector<Publication> published;
  std::vector<std::pair<std::string, int>> subscribed;
  std::vector<std::uint64_t> probes;
  std::vector<std::string> order;
  int disconnects = 0;
};

class Listener final : public Application {
 public:
  void command(const Command& command) override { commands.push_back(command); }
  void refused(const std::string& device, const std::string& metric, const std::string& reason) override {
    refusals.push_back(device + "|" + metric + "|" + reason);
  }
  std::vector<Command> commands;
  std::vector<std::string> refusals;
};

/// A published message, read.
struct Heard {
  Topic topic;
  Payload payload;
  int qos = 0;
  bool retain = false;
  [[nodiscard]] const Metric* find(const std::string& name) const {
    for (const auto& each : payload.metrics) {
      if (each.name == name) return &each;
    }
    return nullptr;
  }
  [[nodiscard]] const Metric* find(std::uint64_t alias) const {
    for (const auto& each : payload.metrics) {
      if (each.alias == alias) return &each;
    }
    return nullptr;
  }
};
inline Heard heard(const Publication& message) {
  const auto topic = parse_topic(message.topic);
  const auto payload = decode(message.bytes);
  EXPECT_TRUE(topic) << message.topic;
  EXPECT_TRUE(payload);
  return {topic.value_or(Topic{}), payload.value_or(Payload{}), message.qos, message.retain};
}

inline OwnMetric metric(const std::string& name, DataType type, Value value, std::uint64_t at = 1000) {
  return {.name = name, .type = type, .value = std::move(value), .at = Utc{at}};
}
inline OwnMetric writable(const std::string& name, DataType type, Value value) {
  auto out = metric(name, type, std::move(value));
  out.writable = true;
  return out;
}

const EdgeNodeId press{"Plant", "Press"};

class EdgeWorld : public testing::Test {
 public:
  explicit EdgeWorld(EdgeNodeOptions options = defaults()) : node(std::move(options), wire, app, backlog) {}
  static EdgeNodeOptions defaults() {
    EdgeNodeOptions out;
    out.id = press;
    return out;
  }
  static EdgeNodeOptions with_primary() {
    auto out = defaults();
    out.primary_host = "scada";
    return out;
  }

  Publication connect() {
    auto will = node.connecting(now);
    node.connected(now);
    return will;
  }
  void pass(std::chrono::milliseconds time) {
    now.steady += time;
    now.utc.ms += static_cast<std::uint64_t>(time.count());
    node.tick(now);
  }
  /// The time of `next`, and what is due then; false: nothing.
  bool wait() {
    const auto next = node.next(now);
    if (!next) return false;
    pass(std::max(*next - now.steady, 0ms));
    return true;
  }
  void state(bool online, std::uint64_t at, const std::string& host = "scada") {
    const auto bytes = encode_state({online, Utc{at}});
    const auto topic = state_topic(host);
    node.message({topic, bytes, true}, now);
  }
  void command(const std::string& device, std::vector<Metric> metrics, bool retained = false) {
    Payload payload;
    payload.at = now.utc;
    payload.metrics = std::move(metrics);
    const auto bytes = encode(payload, Types::left_out);
    const auto topic =
        device.empty() ? make_topic(press, MessageType::ncmd) : make_topic(press, MessageType::dcmd, device);
    node.message({topic, bytes, retained}, now);
  }
  static Metric write(const std::string& name, Value value, std::optional<DataType> type = std::nullopt) {
    Metric out;
    out.name = name;
    out.value = std::move(value);
    out.type = type;
    return out;
  }
  void rebirth() { command("", {write(rebirth_metric, true)}); }
  /// All that was published since the last call, read.
  std::vector<Heard> all() {
    std::vector<Heard> out;
    for (const auto& each : wire.published) out.push_back(heard(each));
    wire.published.clear();
    return out;
  }
  std::vector<std::string> types() {
    std::vector<std::string> out;
    for (const auto& each : all())
      out.push_back(std::string(name(each.topic.type)) + (each.topic.device.empty() ? "" : " " + each.topic.device));
    return out;
  }
  void device(const std::string& name, std::int64_t speed = 5) {
    const auto done = node.device_born(
        name, {metric("speed", DataType::int32, speed), writable("target", DataType::int16, std::int64_t{0})}, now);
    ASSERT_TRUE(done) << done.error();
  }
  void change(const std::string& device, const std::string& name, Value value, Quality quality = Quality::good) {
    const auto done = node.change(device, name, std::move(value), now.utc, quality);
    ASSERT_TRUE(done) << done.error();
  }

  Wire wire;
  Listener app;
  MemoryBacklog backlog;
  Now now{Utc{1'000'000}, 50'000ms};
  EdgeNode node;
};

}  // namespace sparkplug_test
