// What an edge node publishes by exception, and what it forwards after it was away.
#include <algorithm>

#include "edge_world.hpp"

namespace sparkplug_test {
namespace {

class EdgeData : public EdgeWorld {
 public:
  using EdgeWorld::EdgeWorld;
  void up() {
    ASSERT_TRUE(node.set_metrics({metric("load", DataType::float32, 0.0F)}, now));
    device("drive");
    connect();
    for (const auto& birth : all()) {
      for (const auto& each : birth.payload.metrics) {
        if (each.alias) alias[birth.topic.device + "|" + *each.name] = *each.alias;
      }
    }
    wire.clear();
  }
  /// Speeds of the drive that were published as history or not, in order.
  std::vector<std::int64_t> speeds(bool historical) {
    std::vector<std::int64_t> out;
    for (const auto& message : all()) {
      for (const auto& each : message.payload.metrics) {
        if (message.topic.type == MessageType::ddata && each.historical == historical) {
          out.push_back(std::get<std::int64_t>(interpret(DataType::int32, each.value)));
        }
      }
    }
    return out;
  }
  std::map<std::string, std::uint64_t> alias;
};

// SP.35: topic. SP.36, SP.253, SP.254: QoS 0, not retained. SP.37, SP.250: number. SP.38, SP.249: time. SP.39: what
// changed. SP.188: the metric's time. SP.194: no type. SP.187: alias and no name.
TEST_F(EdgeData, NData) {
  up();
  pass(1s);
  change("", "load", 0.5F);
  pass(1ms);
  const auto data = all();
  ASSERT_EQ(data.size(), 1U);
  EXPECT_EQ(data[0].topic, (Topic{.type = MessageType::ndata, .edge = press}));
  EXPECT_EQ(data[0].qos, 0);
  EXPECT_FALSE(data[0].retain);
  EXPECT_EQ(data[0].payload.seq, 2U);
  EXPECT_EQ(data[0].payload.at, now.utc);
  ASSERT_EQ(data[0].payload.metrics.size(), 1U);
  const auto& metric = data[0].payload.metrics[0];
  EXPECT_EQ(metric.alias, alias.at("|load"));
  EXPECT_FALSE(metric.name);
  EXPECT_FALSE(metric.type);
  EXPECT_EQ(metric.at, Utc{now.utc.ms - 1});
  EXPECT_EQ(metric.value, Value(0.5F));
  EXPECT_FALSE(metric.historical);
}

// SP.53: topic. SP.54, SP.259, SP.260: QoS 0, not retained. SP.55, SP.256: number. SP.56, SP.255: time. SP.57: what
// changed.
TEST_F(EdgeData, DData) {
  up();
  change("drive", "speed", std::int64_t{-6});
  pass(1ms);
  const auto data = all();
  ASSERT_EQ(data.size(), 1U);
  EXPECT_EQ(data[0].topic, (Topic{.type = MessageType::ddata, .edge = press, .device = "drive"}));
  EXPECT_EQ(data[0].qos, 0);
  EXPECT_FALSE(data[0].retain);
  EXPECT_EQ(data[0].payload.seq, 2U);
  EXPECT_EQ(data[0].payload.at, now.utc);
  ASSERT_EQ(data[0].payload.metrics.size(), 1U);
  EXPECT_EQ(data[0].payload.metrics[0].alias, alias.at("drive|speed"));
  EXPECT_EQ(interpret(DataType::int32, data[0].payload.metrics[0].value), Value(std::int64_t{-6}));
}

// SP.9, SP.158, SP.162: what did not change is not published, however long it is.
TEST_F(EdgeData, ByException) {
  up();
  change("drive", "speed", std::int64_t{5});
  pass(1h);
  EXPECT_TRUE(wire.published.empty());
  change("drive", "speed", std::int64_t{5}, Quality::bad);
  pass(1ms);
  EXPECT_EQ(wire.published.size(), 1U) << "a quality is a change";
}

TEST_F(EdgeData, SeveralChangesAreOneMessage) {
  up();
  change("drive", "speed", std::int64_t{6});
  change("drive", "target", std::int64_t{7});
  change("", "load", 1.0F);
  pass(1ms);
  auto data = all();
  ASSERT_EQ(data.size(), 2U);
  EXPECT_EQ(data[0].topic.type, MessageType::ndata);
  EXPECT_EQ(data[1].payload.metrics.size(), 2U);
}

// SP.159, SP.163: metrics of one message are in the order of time, also when the clock is set back; one time has one
// value.
TEST_F(EdgeData, ChronologicalAlsoWhenTheClockIsSetBack) {
  up();
  const auto at = [&](std::uint64_t ms, std::int64_t speed) {
    ASSERT_TRUE(node.change("drive", "speed", speed, Utc{ms}));
  };
  at(2'000'000, 10);
  at(2'000'005, 11);
  at(1'500'000, 12);
  at(1'500'000, 13);
  pass(1ms);
  const auto data = all();
  ASSERT_EQ(data.size(), 3U);
  std::vector<Value> order;
  for (const auto& message : data) {
    std::uint64_t before = 0;
    for (const auto& each : message.payload.metrics) {
      EXPECT_GT(each.at->ms, before);
      before = each.at->ms;
      order.push_back(interpret(DataType::int32, each.value));
    }
  }
  EXPECT_EQ(order, (std::vector<Value>{std::int64_t{10}, std::int64_t{11}, std::int64_t{12}, std::int64_t{13}}));
}

// SP.200, SP.201: a quality that is not good is a property; good again is said once.
TEST_F(EdgeData, QualityIsAProperty) {
  up();
  change("drive", "speed", std::int64_t{5}, Quality::bad);
  pass(1ms);
  EXPECT_EQ(quality(all().at(0).payload.metrics.at(0)), Quality::bad);
  change("drive", "speed", std::int64_t{6});
  pass(1ms);
  const auto good = all();
  ASSERT_TRUE(good.at(0).payload.metrics.at(0).properties);
  EXPECT_EQ(quality(good[0].payload.metrics[0]), Quality::good);
  change("drive", "speed", std::int64_t{7});
  pass(1ms);
  EXPECT_FALSE(all().at(0).payload.metrics.at(0).properties);
  change("drive", "speed", std::int64_t{7}, Quality::stale);
  connect();
  const auto births = all();
  EXPECT_EQ(quality(*births.back().find("speed")), Quality::stale);
}

class EdgeNames : public EdgeData {
 public:
  static EdgeNodeOptions without() {
    auto out = defaults();
    out.aliases = false;
    return out;
  }
  EdgeNames() : EdgeData(without()) {}
};
// SP.184: without aliases each metric has its name.
TEST_F(EdgeNames, WithoutAliases) {
  up();
  EXPECT_TRUE(alias.empty());
  change("drive", "speed", std::int64_t{6});
  pass(1ms);
  const auto data = all();
  EXPECT_EQ(data.at(0).payload.metrics.at(0).name, "speed");
  EXPECT_FALSE(data[0].payload.metrics[0].alias);
}

// SP.252, SP.258: data comes after all births, also what had changed before.
TEST_F(EdgeData, AwayAndBack) {
  up();
  node.disconnected(now);
  for (std::int64_t speed = 10; speed < 15; ++speed) {
    pass(1s);
    change("drive", "speed", speed);
  }
  EXPECT_TRUE(wire.published.empty());
  EXPECT_EQ(backlog.size(), 5U);
  connect();
  const auto births = all();
  ASSERT_EQ(births.size(), 2U);
  EXPECT_EQ(births[1].find("speed")->value, Value(std::int64_t{14})) << "the birth has what is now";
  pass(1ms);
  EXPECT_TRUE(wire.published.empty()) << "the first portion has its pace";
  pass(200ms);
  EXPECT_EQ(speeds(true), (std::vector<std::int64_t>{10, 11, 12, 13, 14}));
  EXPECT_EQ(backlog.size(), 5U) << "nothing is proven yet";
  ASSERT_EQ(wire.probes.size(), 1U);
  node.answered(wire.probes[0]);
  EXPECT_EQ(backlog.size(), 0U);
  EXPECT_FALSE(wait()) << "nothing is left to do";
}

// A historical metric has its time, the flag and its quality.
TEST_F(EdgeData, WhatIsForwardedIsHistorical) {
  up();
  node.disconnected(now);
  change("drive", "speed", std::int64_t{10}, Quality::stale);
  const auto then = now.utc;
  change("drive", "speed", std::int64_t{11});
  pass(1min);
  connect();
  wire.clear();
  pass(200ms);
  const auto data = all();
  ASSERT_EQ(data.size(), 1U);
  ASSERT_EQ(data[0].payload.metrics.size(), 2U);
  const auto& first = data[0].payload.metrics[0];
  EXPECT_TRUE(first.historical);
  EXPECT_EQ(first.at, then);
  EXPECT_EQ(first.alias, alias.at("drive|speed"));
  EXPECT_EQ(quality(first), Quality::stale);
  EXPECT_EQ(quality(data[0].payload.metrics[1]), Quality::good);
}

class EdgePortions : public EdgeData {
 public:
  static EdgeNodeOptions small() {
    auto out = defaults();
    out.portion = 3;
    return out;
  }
  EdgePortions() : EdgeData(small()) {}
};

TEST_F(EdgePortions, LiveDataGoesFirst) {
  up();
  node.disconnected(now);
  for (std::int64_t speed = 10; speed < 20; ++speed) change("drive", "speed", speed);
  connect();
  wire.clear();
  std::vector<std::size_t> portions;
  for (int i = 0; i < 6; ++i) {
    change("drive", "target", std::int64_t{100 + i});
    pass(200ms);
    const auto data = all();
    ASSERT_FALSE(data.empty());
    EXPECT_FALSE(data[0].payload.metrics.at(0).historical) << "live first";
    portions.push_back(data.size() > 1 ? data[1].payload.metrics.size() : 0);
  }
  EXPECT_EQ(portions, (std::vector<std::size_t>{3, 3, 3, 1, 0, 0}));
}

// The connection breaks in the middle of forwarding: all that was not proven comes again.
TEST_F(EdgePortions, NothingIsLostWhenItBreaksWhileForwarding) {
  up();
  node.disconnected(now);
  for (std::int64_t speed = 10; speed < 18; ++speed) change("drive", "speed", speed);
  connect();
  wire.clear();
  pass(200ms);
  node.answered(wire.probes.at(0));
  pass(200ms);
  EXPECT_EQ(speeds(true), (std::vector<std::int64_t>{10, 11, 12, 13, 14, 15}));
  EXPECT_EQ(backlog.size(), 5U);
  node.disconnected(now);
  connect();
  wire.clear();
  while (wait() && node.in_session() && wire.probes.size() < 5) {
    for (const auto probe : wire.probes) node.answered(probe);
  }
  EXPECT_EQ(speeds(true), (std::vector<std::int64_t>{13, 14, 15, 16, 17}));
  EXPECT_EQ(backlog.size(), 0U);
}

// What was published live and not proven comes again as history.
TEST_F(EdgeData, LiveDataThatWasNotProvenComesAgain) {
  up();
  change("drive", "speed", std::int64_t{10});
  pass(1ms);
  ASSERT_EQ(wire.probes.size(), 1U);
  node.answered(wire.probes[0]);
  change("drive", "speed", std::int64_t{11});
  pass(1ms);
  change("drive", "speed", std::int64_t{12});
  node.disconnected(now);
  EXPECT_EQ(backlog.size(), 2U) << "11 was sent, 12 was not; 10 is proven";
  connect();
  wire.clear();
  pass(200ms);
  EXPECT_EQ(speeds(true), (std::vector<std::int64_t>{11, 12}));
}

class EdgeUnproven : public EdgeData {
 public:
  static EdgeNodeOptions few() {
    auto out = defaults();
    out.most_unproven = 4;
    return out;
  }
  EdgeUnproven() : EdgeData(few()) {}
};
TEST_F(EdgeUnproven, UnprovenDataIsBounded) {
  up();
  for (std::int64_t speed = 10; speed < 20; ++speed) {
    change("drive", "speed", speed);
    pass(1ms);
  }
  EXPECT_EQ(speeds(false).size(), 10U) << "it is published all the same";
  EXPECT_EQ(backlog.size(), 6U) << "four are unproven in memory, the older ones are safe";
}

class EdgeFull : public EdgeData {
 public:
  EdgeFull() : EdgeData(defaults()), small({.entries = 3, .bytes = 1 << 20}), other(defaults(), wire, app, small) {}
  MemoryBacklog small;
  EdgeNode other;
};
TEST_F(EdgeFull, WhatDoesNotFitIsCountedAndSaid) {
  ASSERT_TRUE(other.device_born("drive", {metric("speed", DataType::int32, std::int64_t{0})}, now));
  for (std::int64_t speed = 1; speed <= 5; ++speed) ASSERT_TRUE(other.change("drive", "speed", speed, now.utc));
  EXPECT_EQ(other.lost(), 2U);
  (void)other.connecting(now);
  other.connected(now);
  const auto births = all();
  EXPECT_EQ(births.at(0).find("Backlog/Lost")->value, Value(std::uint64_t{2}));
  EXPECT_EQ(births[1].find("speed")->value, Value(std::int64_t{5}));
  now.steady += 200ms;
  other.tick(now);
  EXPECT_EQ(speeds(true), (std::vector<std::int64_t>{1, 2, 3})) << "the oldest were promised";
  // More is lost in the session: said by NDATA.
  ASSERT_TRUE(other.device_born("drive", {metric("other", DataType::int32, std::int64_t{0})}, now));
  other.disconnected(now);
  (void)other.connecting(now);
  other.connected(now);
  wire.clear();
  now.steady += 200ms;
  other.tick(now);
  EXPECT_EQ(small.size(), 0U) << "their metric is gone";
  EXPECT_EQ(other.next(now), now.steady);
  other.tick(now);
  const auto data = all();
  ASSERT_EQ(data.size(), 1U);
  EXPECT_EQ(data[0].topic.type, MessageType::ndata);
  EXPECT_EQ(data[0].payload.metrics.at(0).value, Value(std::uint64_t{5}));
}

TEST_F(EdgeData, WhatIsOfADeadDeviceWaitsForIt) {
  up();
  node.disconnected(now);
  change("drive", "speed", std::int64_t{10});
  node.device_died("drive", now);
  device("valve");
  change("valve", "speed", std::int64_t{20});
  connect();
  wire.clear();
  pass(200ms);
  EXPECT_EQ(speeds(true), (std::vector<std::int64_t>{20}));
  device("drive", 11);
  wire.clear();
  pass(200ms);
  EXPECT_EQ(speeds(true), (std::vector<std::int64_t>{10}));
  node.device_removed("drive", now);
  EXPECT_EQ(types(), (std::vector<std::string>{"DDEATH drive"}));
}

TEST_F(EdgeData, WhatIsOfARemovedDeviceIsGivenUp) {
  up();
  node.disconnected(now);
  change("drive", "speed", std::int64_t{10});
  node.device_removed("drive", now);
  EXPECT_EQ(backlog.size(), 0U);
  EXPECT_EQ(node.lost(), 1U);
}

TEST_F(EdgeData, ValuesThatAreRefused) {
  up();
  EXPECT_FALSE(node.change("drive", "speed", std::string("5"), now.utc));
  EXPECT_FALSE(node.change("drive", "target", std::int64_t{40'000}, now.utc));
  EXPECT_FALSE(node.change("drive", "none", std::int64_t{4}, now.utc));
  EXPECT_FALSE(node.change("none", "speed", std::int64_t{4}, now.utc));
  EXPECT_FALSE(node.change("", "bdSeq", std::int64_t{4}, now.utc));
  EXPECT_FALSE(node.change("", "Node Control/Rebirth", true, now.utc));
  pass(1ms);
  EXPECT_TRUE(wire.published.empty());
}

}  // namespace

namespace {

TEST(SparkplugBacklog, HasLimitsOfEntriesAndBytes) {
  MemoryBacklog few({.entries = 2, .bytes = 1 << 20});
  const Kept change{"d", "m", DataType::int32, std::int64_t{1}, Utc{1}, Quality::good};
  EXPECT_TRUE(few.append(change));
  EXPECT_TRUE(few.append(change));
  EXPECT_FALSE(few.append(change));
  const auto entries = few.after(0, 10);
  ASSERT_EQ(entries.size(), 2U);
  EXPECT_EQ(few.after(entries[0].id, 10).size(), 1U);
  EXPECT_EQ(few.after(0, 1).size(), 1U);
  few.drop(std::vector<std::uint64_t>{entries[0].id, 99});
  EXPECT_EQ(few.size(), 1U);
  EXPECT_TRUE(few.append(change));
  EXPECT_GT(few.after(0, 10).back().id, entries[1].id) << "an ID is never given twice";

  MemoryBacklog small({.entries = 100, .bytes = 10'000});
  auto large = change;
  large.value = Bytes(6'000);
  EXPECT_TRUE(small.append(large));
  EXPECT_FALSE(small.append(large));
  small.drop(std::vector<std::uint64_t>{1});
  EXPECT_TRUE(small.append(large));
}

}  // namespace
}  // namespace sparkplug_test
