// Random worlds: an edge node and a host at a broker, through connections that break at any point, with wills that come
// late and with restarts of both. Whatever happens: every message that the broker gets is right where it stands,
// nothing that was promised is lost, and after some quiet the host shows what the node has.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <deque>
#include <functional>
#include <memory>
#include <set>

#include "berth/sparkplug/host.hpp"
#include "edge_world.hpp"

namespace sparkplug_test {
namespace {

/// One client's connection to the broker: what is on its way, both ways. A break loses it.
class Line final : public Outbox {
 public:
  struct Item {
    enum class Kind : std::uint8_t { publish, subscribe, ping, disconnect } kind = Kind::publish;
    Publication message{};
    std::uint64_t mark = 0;
    bool retained = false;
  };
  void publish(Publication message) override { to_broker.push_back({Item::Kind::publish, std::move(message)}); }
  void subscribe(const std::string& filter, std::uint8_t) override {
    to_broker.push_back({Item::Kind::subscribe, {filter, {}, 0, false}});
  }
  void probe(std::uint64_t mark) override { to_broker.push_back({.kind = Item::Kind::ping, .mark = mark}); }
  void disconnect() override { to_broker.push_back({.kind = Item::Kind::disconnect}); }

  void cut() {
    up = false;
    to_broker.clear();
    to_client.clear();
    filters.clear();
  }
  bool up = false;
  std::optional<Publication> will;
  std::deque<Item> to_broker;
  std::deque<Item> to_client;
  std::vector<std::string> filters;  // as the broker has them
};

bool matches(const std::string& filter, const std::string& topic) {
  if (filter.ends_with("#")) return topic.starts_with(filter.substr(0, filter.size() - 1));
  return filter == topic;
}

/// What must hold for the messages of one connection of the node, in the order in which the broker gets them.
class Judge {
 public:
  void connection() {
    born_ = false;
    names_.clear();
    all_.clear();  // aliases are those of a session
  }
  void message(const Publication& message) {
    const auto topic = parse_topic(message.topic);
    const auto payload = decode(message.bytes);
    RC_ASSERT(topic.has_value());
    RC_ASSERT(payload.has_value());
    if (topic->type == MessageType::ndeath) {
      RC_ASSERT(born_);
      RC_ASSERT(!payload->seq.has_value());
      born_ = false;
      return;
    }
    if (topic->type == MessageType::nbirth) {
      born_ = true;
      expected_ = 0;
      names_.clear();
    }
    RC_ASSERT(born_);
    RC_ASSERT(payload->seq == std::uint64_t{expected_});
    ++expected_;
    content(*topic, *payload);
  }
  std::set<std::int64_t> received;

 private:
  void content(const Topic& topic, const Payload& payload) {
    auto& names = names_[topic.device];
    const bool birth = topic.type == MessageType::nbirth || topic.type == MessageType::dbirth;
    if (birth) {
      names.clear();
      for (const auto& each : payload.metrics) {
        if (!each.alias) continue;
        const auto full = topic.device + "|" + *each.name;
        RC_ASSERT(all_.try_emplace(*each.alias, full).first->second == full);
        names.insert(*each.alias);
      }
    }
    if (topic.type == MessageType::ddeath) {
      RC_ASSERT(!names.empty());
      names.clear();
    }
    for (const auto& each : payload.metrics) {
      RC_ASSERT(birth || names.contains(each.alias.value_or(0)));
      const auto value = interpret(DataType::int64, each.value);
      if (const auto* number = std::get_if<std::int64_t>(&value)) received.insert(*number);
    }
  }
  bool born_ = false;
  std::uint8_t expected_ = 0;
  std::map<std::string, std::set<std::uint64_t>> names_;
  std::map<std::uint64_t, std::string> all_;
};

class Quiet final : public HostEvents {
  void born(const EdgeNodeId&, const std::string&) override {}
  void died(const EdgeNodeId&, const std::string&) override {}
  void value(const EdgeNodeId&, const std::string&, const std::string&, const Metric&) override {}
  void trouble(const EdgeNodeId&, const char*) override {}
};

class World {
 public:
  explicit World(bool primary) {
    options_.id = press;
    if (primary) options_.primary_host = "scada";
    options_.portion = 3;
    start_node();
    start_host();
  }

  void act(std::uint8_t what, std::uint8_t how) {
    switch (what % 16) {
      case 0: return connect(node_line_, [&] { return node_->connecting(now_); });
      case 1: return connect(host_line_, [&] { return host_->connecting(now_); });
      case 2: return cut_node(how);
      case 3: return cut_host(how);
      case 4: return how % 4 == 0 ? restart_node() : deliver_wills();
      case 5: return how % 4 == 0 ? restart_host() : deliver_wills();
      case 6: return toggle(how);
      case 7: return host_->ask_rebirth(press, now_);
      case 8:
      case 9: return pump(how % 8U);
      case 10: return pass(std::chrono::milliseconds(how * 20));
      default: return change(how);
    }
  }

  /// Both connected, all there, time enough for all that is due.
  void settle() {
    deliver_wills();
    for (const auto* device : {"a", "b"}) {
      if (!alive_.contains(device)) toggle(device == std::string("a") ? 0 : 1);
    }
    for (int i = 0; i < 4000; ++i) {
      if (!host_line_.up) connect(host_line_, [&] { return host_->connecting(now_); });
      if (!node_line_.up) connect(node_line_, [&] { return node_->connecting(now_); });
      // A node that says nothing cannot be noticed by a host that is no primary one.
      if (i == 1000) change(2);
      pump(100);
      pass(100ms);
    }
  }
  void check() {
    RC_ASSERT(node_->in_session());
    for (const auto number : must_) RC_ASSERT(judge_.received.contains(number));
    RC_ASSERT(backlog_.size() == 0U);
    RC_ASSERT(node_->lost() == 0U);
    const auto* seen = host_->fleet().find(press);
    RC_ASSERT(seen != nullptr);
    RC_ASSERT(seen->self.online);
    for (const auto& [key, value] : values_) {
      const auto* device = host_->fleet().find(*seen, key.first);
      RC_ASSERT(device != nullptr);
      RC_ASSERT(device->online);
      const auto* metric = host_->fleet().find(*device, key.second);
      RC_ASSERT(metric != nullptr);
      RC_ASSERT(metric->value == Value(value));
      RC_ASSERT(Fleet::quality(*seen, *device, *metric) == Quality::good);
    }
  }

 private:
  void start_node() {
    node_ = std::make_unique<EdgeNode>(options_, node_line_, listener_, backlog_);
    RC_ASSERT(node_->set_metrics({metric("n", DataType::int64, values_[{"", "n"}])}, now_).has_value());
    for (const auto& device : alive_) born(device);
  }
  void start_host() {
    HostOptions options;
    options.id = "scada";
    host_ = std::make_unique<Host>(options, host_line_, quiet_);
  }
  void born(const std::string& device) {
    RC_ASSERT(node_
                  ->device_born(device,
                                {metric("x", DataType::int64, values_[{device, "x"}], now_.utc.ms),
                                 metric("y", DataType::int64, values_[{device, "y"}], now_.utc.ms)},
                                now_)
                  .has_value());
  }
  void toggle(std::uint8_t how) {
    const std::string device = how % 2 == 0 ? "a" : "b";
    if (alive_.insert(device).second) return born(device);
    alive_.erase(device);
    node_->device_died(device, now_);
  }
  void change(std::uint8_t how) {
    const std::string device = how % 3 == 0 ? "a" : how % 3 == 1 ? "b" : "";
    if (!device.empty() && !alive_.contains(device)) return;
    const std::string name = device.empty() ? "n" : how % 2 == 0 ? "x" : "y";
    now_.utc.ms += 1;
    RC_ASSERT(node_->change(device, name, ++count_, now_.utc).has_value());
    values_[{device, name}] = count_;
    must_.insert(count_);
    if (how % 5 != 0) node_->tick(now_);
  }
  void connect(Line& line, const std::function<Publication()>& will) {
    if (line.up) return;
    line.cut();
    line.will = will();
    line.up = true;
    if (&line == &node_line_) {
      judge_.connection();
      node_->connected(now_);
    } else {
      host_->connected(now_);
    }
  }
  /// The connection breaks after some of what is on its way came; the will waits for its time.
  void cut_node(std::uint8_t how) {
    if (!node_line_.up) return;
    pump(how % 16U);
    lose(node_line_);
    node_->disconnected(now_);
  }
  void cut_host(std::uint8_t how) {
    if (!host_line_.up) return;
    pump(how % 16U);
    lose(host_line_);
    host_->disconnected(now_);
  }
  void lose(Line& line) {
    line.cut();
    if (line.will) wills_.push_back(*std::exchange(line.will, std::nullopt));
  }
  /// As a crash: what was in memory only is gone.
  void restart_node() {
    if (node_line_.up) lose(node_line_);
    options_.bd_seq = node_->next_bd_seq();
    std::set<std::int64_t> kept;
    for (const auto& entry : backlog_.after(0, 1'000'000)) kept.insert(std::get<std::int64_t>(entry.kept.value));
    std::erase_if(must_, [&](std::int64_t each) { return !kept.contains(each) && !judge_.received.contains(each); });
    start_node();
  }
  void restart_host() {
    if (host_line_.up) lose(host_line_);
    now_.utc.ms += 10;  // a new session is later than the one before it
    start_host();
  }
  void deliver_wills() {
    for (const auto& will : std::exchange(wills_, {})) publish(will);
  }

  void publish(const Publication& message) {
    if (message.retain) retained_[message.topic] = message;
    for (auto* line : {&node_line_, &host_line_}) {
      for (const auto& filter : line->filters) {
        if (!matches(filter, message.topic)) continue;
        line->to_client.push_back({Line::Item::Kind::publish, message, 0, false});
        break;
      }
    }
  }
  void take(Line& line, Line::Item item) {
    switch (item.kind) {
      case Line::Item::Kind::publish:
        if (&line == &node_line_) judge_.message(item.message);
        return publish(item.message);
      case Line::Item::Kind::subscribe:
        line.filters.push_back(item.message.topic);
        for (const auto& [topic, message] : retained_) {
          if (matches(item.message.topic, topic))
            line.to_client.push_back({Line::Item::Kind::publish, message, 0, true});
        }
        return;
      case Line::Item::Kind::ping: return line.to_client.push_back(std::move(item));
      case Line::Item::Kind::disconnect:
        line.will.reset();
        line.cut();
        node_->disconnected(now_);  // only a node disconnects on purpose here
        return;
    }
  }
  /// Up to `most` items of each queue go on.
  void pump(std::size_t most) {
    for (std::size_t i = 0; i < most; ++i) {
      bool idle = true;
      for (auto* line : {&node_line_, &host_line_}) {
        if (line->up && !line->to_broker.empty()) {
          auto item = std::move(line->to_broker.front());
          line->to_broker.pop_front();
          idle = false;
          take(*line, std::move(item));
        }
        if (!line->up || line->to_client.empty()) continue;
        const auto item = std::move(line->to_client.front());
        line->to_client.pop_front();
        idle = false;
        hand(*line, item);
      }
      if (idle) return;
    }
  }
  void hand(Line& line, const Line::Item& item) {
    const Incoming message{item.message.topic, item.message.bytes, item.retained};
    if (&line == &host_line_) return host_->message(message, now_);
    if (item.kind == Line::Item::Kind::ping) return node_->answered(item.mark);
    node_->message(message, now_);
  }
  void pass(std::chrono::milliseconds time) {
    now_.steady += time;
    now_.utc.ms += static_cast<std::uint64_t>(time.count());
    node_->tick(now_);
    host_->tick(now_);
  }

  EdgeNodeOptions options_;
  Now now_{Utc{1'000'000}, 0ms};
  Line node_line_, host_line_;
  Listener listener_;
  Quiet quiet_;
  MemoryBacklog backlog_;  // as on disk: it outlives a restart
  std::unique_ptr<EdgeNode> node_;
  std::unique_ptr<Host> host_;
  Judge judge_;
  std::vector<Publication> wills_;
  std::map<std::string, Publication> retained_;
  std::set<std::string> alive_{"a", "b"};
  std::map<std::pair<std::string, std::string>, std::int64_t> values_;
  std::set<std::int64_t> must_;
  std::int64_t count_ = 1000;
};

void run(bool primary) {
  World world(primary);
  const auto acts = *rc::gen::scale(3.0, rc::gen::arbitrary<std::vector<std::pair<std::uint8_t, std::uint8_t>>>());
  for (const auto& [what, how] : acts) world.act(what, how);
  world.settle();
  world.check();
}

// SP.183, SP.246, SP.252, SP.258, SP.273.
RC_GTEST_PROP(SparkplugWorlds, WithoutAPrimaryHost, ()) { run(false); }
// SP.98, SP.108, SP.115, SP.89.
RC_GTEST_PROP(SparkplugWorlds, WithAPrimaryHost, ()) { run(true); }

}  // namespace
}  // namespace sparkplug_test
