// The session of an edge node: will, births, deaths, their numbers.
#include <algorithm>
#include <set>

#include "edge_world.hpp"

namespace sparkplug_test {
namespace {

class EdgeBirth : public EdgeWorld {};

std::int64_t bd_seq(const Payload& payload) {
  for (const auto& each : payload.metrics) {
    if (each.name == "bdSeq") return std::get<std::int64_t>(each.value);
  }
  return -1;
}
/// Every name, alias and time of a birth's metrics is there, and times ascend.
void expect_whole_birth(const Heard& birth) {
  std::uint64_t before = 0;
  for (const auto& each : birth.payload.metrics) {
    EXPECT_TRUE(each.name) << "name";
    EXPECT_TRUE(each.type) << *each.name;
    ASSERT_TRUE(each.at) << *each.name;
    EXPECT_GE(each.at->ms, before) << *each.name;
    before = each.at->ms;
    EXPECT_FALSE(each.historical);
    EXPECT_EQ(each.alias.has_value(), each.name != rebirth_metric) << *each.name;
  }
}

// SP.93, SP.40: the will's topic. SP.94: its payload. SP.96, SP.271: QoS 1. SP.97, SP.272: not retained. SP.41: bdSeq
// alone. SP.42, SP.269: no sequence number. SP.95: an Int64 by name.
TEST_F(EdgeBirth, TheWill) {
  const auto will = node.connecting(now);
  EXPECT_EQ(will.topic, "spBv1.0/Plant/NDEATH/Press");
  EXPECT_EQ(will.qos, 1);
  EXPECT_FALSE(will.retain);
  const auto read = heard(will);
  ASSERT_EQ(read.payload.metrics.size(), 1U);
  const auto& metric = read.payload.metrics[0];
  EXPECT_EQ(metric.name, "bdSeq");
  EXPECT_EQ(metric.type, DataType::int64);
  EXPECT_EQ(metric.value, Value(std::int64_t{0}));
  EXPECT_FALSE(read.payload.seq);
  EXPECT_TRUE(wire.order.empty()) << "nothing is published before the connection";
}

// SP.33, SP.95: 0 at first, one more with each CONNECT, after 255 comes 0. SP.32, SP.104, SP.239, SP.273: NBIRTH has
// that of the will.
TEST_F(EdgeBirth, BdSeqCountsConnects) {
  for (int i = 0; i < 600; ++i) {
    const auto will = connect();
    EXPECT_EQ(bd_seq(heard(will).payload), i % 256);
    const auto births = all();
    ASSERT_EQ(births.size(), 1U);
    EXPECT_EQ(bd_seq(births[0].payload), i % 256);
    EXPECT_EQ(node.next_bd_seq(), (i + 1) % 256);
    if (i % 2 == 0) node.disconnected(now);
  }
}

// SP.33: over a restart of the program, too.
TEST_F(EdgeBirth, BdSeqGoesOnAfterARestart) {
  auto options = defaults();
  options.bd_seq = 255;
  EdgeNode other(options, wire, app, backlog);
  EXPECT_EQ(bd_seq(heard(other.connecting(now)).payload), 255);
  EXPECT_EQ(other.next_bd_seq(), 0);
}

// SP.24, SP.102: topic. SP.25, SP.105, SP.106, SP.241, SP.242: QoS 0, not retained. SP.26, SP.107, SP.182, SP.237:
// number 0. SP.27, SP.235: time. SP.180: in UTC, which the owner gives. SP.31, SP.104, SP.238: bdSeq, an Int64. SP.34,
// SP.164, SP.166, SP.167, SP.240: Node Control/Rebirth, a Boolean, false. SP.165: without an alias. SP.103: a payload
// of Sparkplug B.
TEST_F(EdgeBirth, NBirth) {
  connect();
  const auto births = all();
  ASSERT_EQ(births.size(), 1U);
  const auto& birth = births[0];
  EXPECT_EQ(birth.topic, (Topic{.type = MessageType::nbirth, .edge = press}));
  EXPECT_EQ(birth.qos, 0);
  EXPECT_FALSE(birth.retain);
  EXPECT_EQ(birth.payload.seq, 0U);
  EXPECT_EQ(birth.payload.at, now.utc);
  ASSERT_NE(birth.find("bdSeq"), nullptr);
  EXPECT_EQ(birth.find("bdSeq")->type, DataType::int64);
  const auto* rebirth = birth.find("Node Control/Rebirth");
  ASSERT_NE(rebirth, nullptr);
  EXPECT_EQ(rebirth->type, DataType::boolean);
  EXPECT_EQ(rebirth->value, Value(false));
  EXPECT_FALSE(rebirth->alias);
}

// SP.28, SP.156: all metrics. SP.29: with name, type and value. SP.157: is_null for one without value. SP.184, SP.186:
// name and alias. SP.188: time. SP.190: in UTC, as given. SP.193, SP.192: type. SP.159: in the order of time.
TEST_F(EdgeBirth, NBirthHasEveryMetric) {
  ASSERT_TRUE(
      node.set_metrics({metric("late", DataType::float32, 2.5F, 3000), metric("none", DataType::string, Null{}, 500),
                        metric("count", DataType::uint64, std::uint64_t{7}, 2000)},
                       now));
  connect();
  const auto births = all();
  ASSERT_EQ(births.size(), 1U);
  expect_whole_birth(births[0]);
  ASSERT_EQ(births[0].payload.metrics.size(), 6U);
  EXPECT_EQ(births[0].find("late")->value, Value(2.5F));
  EXPECT_EQ(births[0].find("late")->type, DataType::float32);
  EXPECT_EQ(births[0].find("late")->at, Utc{3000});
  EXPECT_EQ(births[0].find("none")->value, Value(Null{}));
  EXPECT_EQ(births[0].find("none")->type, DataType::string);
  EXPECT_EQ(births[0].find("count")->value, Value(std::uint64_t{7}));
}

// SP.47, SP.120: topic. SP.121: of the node's group and ID. SP.48, SP.123, SP.124, SP.247, SP.248: QoS 0, not retained.
// SP.49, SP.125, SP.244, SP.245: the number after NBIRTH's. SP.50, SP.243: time. SP.51, SP.160: all metrics. SP.52:
// with name, type, value. SP.161: null. SP.122: a payload. SP.163: in the order of time. SP.119, SP.246: right after
// NBIRTH.
TEST_F(EdgeBirth, DBirth) {
  ASSERT_TRUE(node.device_born("drive",
                               {metric("b", DataType::boolean, true, 9), metric("a", DataType::uuid, Null{}, 8)}, now));
  device("valve");
  EXPECT_TRUE(wire.published.empty()) << "not before the session";
  connect();
  const auto births = all();
  ASSERT_EQ(births.size(), 3U);
  EXPECT_EQ(births[0].topic.type, MessageType::nbirth);
  const auto& drive = births[1];
  EXPECT_EQ(drive.topic, (Topic{.type = MessageType::dbirth, .edge = press, .device = "drive"}));
  EXPECT_EQ(drive.qos, 0);
  EXPECT_FALSE(drive.retain);
  EXPECT_EQ(drive.payload.seq, 1U);
  EXPECT_EQ(drive.payload.at, now.utc);
  expect_whole_birth(drive);
  ASSERT_EQ(drive.payload.metrics.size(), 2U);
  EXPECT_EQ(drive.find("a")->value, Value(Null{}));
  EXPECT_EQ(drive.find("b")->value, Value(true));
  EXPECT_EQ(births[2].topic.device, "valve");
  EXPECT_EQ(births[2].payload.seq, 2U);
}

// SP.185: no alias twice in the node, and a metric keeps its alias.
TEST_F(EdgeBirth, AliasesAreUniqueInTheNode) {
  ASSERT_TRUE(node.set_metrics({metric("load", DataType::float32, 1.0F)}, now));
  device("drive");
  device("valve");
  connect();
  std::map<std::string, std::uint64_t> first;
  std::set<std::uint64_t> aliases;
  const auto collect = [&](std::map<std::string, std::uint64_t>& into) {
    for (const auto& birth : all()) {
      for (const auto& each : birth.payload.metrics) {
        if (each.alias) into[birth.topic.device + "|" + *each.name] = *each.alias;
      }
    }
  };
  collect(first);
  for (const auto& [name, alias] : first) EXPECT_TRUE(aliases.insert(alias).second) << name;
  EXPECT_EQ(first.size(), 7U);
  ASSERT_TRUE(node.device_born(
      "valve", {metric("new", DataType::boolean, true), metric("speed", DataType::int32, std::int64_t{5})}, now));
  connect();
  std::map<std::string, std::uint64_t> second;
  collect(second);
  EXPECT_FALSE(aliases.contains(second.at("valve|new")));
  EXPECT_EQ(second.at("valve|speed"), first.at("valve|speed"));
  EXPECT_EQ(second.at("drive|target"), first.at("drive|target"));
}

// SP.90: NCMD, QoS 1, before NBIRTH. SP.118: DCMD of a device with outputs, QoS 1, before its DBIRTH.
TEST_F(EdgeBirth, SubscribesBeforeTheBirths) {
  device("drive");
  ASSERT_TRUE(node.device_born("sensor", {metric("t", DataType::float32, 20.0F)}, now));
  connect();
  EXPECT_EQ(wire.order, (std::vector<std::string>{
                            "subscribe spBv1.0/Plant/NCMD/Press", "publish spBv1.0/Plant/NBIRTH/Press",
                            "subscribe spBv1.0/Plant/DCMD/Press/drive", "publish spBv1.0/Plant/DBIRTH/Press/drive",
                            "publish spBv1.0/Plant/DBIRTH/Press/sensor"}));
  for (const auto& [filter, qos] : wire.subscribed) EXPECT_EQ(qos, 1) << filter;
  wire.clear();
  rebirth();
  pass(2s);
  EXPECT_EQ(std::ranges::count_if(wire.order, [](const auto& each) { return each.starts_with("subscribe"); }), 0);
  connect();
  EXPECT_EQ(wire.subscribed.size(), 2U) << "a new connection has a clean session";
}

// SP.91: births need the connection. SP.10: and are what is published first.
TEST_F(EdgeBirth, NothingWithoutAConnection) {
  device("drive");
  change("drive", "speed", std::int64_t{6});
  pass(10s);
  (void)node.connecting(now);
  pass(10s);
  EXPECT_TRUE(wire.order.empty());
  node.connected(now);
  EXPECT_EQ(types(), (std::vector<std::string>{"NBIRTH", "DBIRTH drive"}));
  node.connected(now);
  EXPECT_TRUE(wire.published.empty()) << "told twice";
}

// SP.126: DDEATH when a device is lost. SP.58: topic. SP.59: QoS 0, not retained. SP.60, SP.278, SP.279, SP.280: the
// next number. SP.277: time.
TEST_F(EdgeBirth, DDeath) {
  device("drive");
  connect();
  wire.clear();
  pass(1s);
  node.device_died("drive", now);
  const auto deaths = all();
  ASSERT_EQ(deaths.size(), 1U);
  EXPECT_EQ(deaths[0].topic, (Topic{.type = MessageType::ddeath, .edge = press, .device = "drive"}));
  EXPECT_EQ(deaths[0].qos, 0);
  EXPECT_FALSE(deaths[0].retain);
  EXPECT_EQ(deaths[0].payload.seq, 2U);
  EXPECT_EQ(deaths[0].payload.at, now.utc);
  EXPECT_TRUE(deaths[0].payload.metrics.empty());
  node.device_died("drive", now);
  EXPECT_TRUE(wire.published.empty()) << "it is dead already";
  EXPECT_FALSE(node.change("drive", "speed", std::int64_t{7}, now.utc));
  connect();
  EXPECT_EQ(types(), (std::vector<std::string>{"NBIRTH"}));
  device("drive");
  EXPECT_EQ(types(), (std::vector<std::string>{"DBIRTH drive"})) << "back again";
}

// SP.181, SP.183, SP.37, SP.55, SP.251, SP.257: each message but NDEATH has the next number, over node and devices;
// after 255 comes 0. SP.250, SP.256.
TEST_F(EdgeBirth, NumbersGoRound) {
  device("drive");
  ASSERT_TRUE(node.set_metrics({metric("n", DataType::int64, std::int64_t{0})}, now));
  connect();
  std::uint64_t expected = 0;
  for (std::int64_t i = 1; i <= 600; ++i) {
    change(i % 3 == 0 ? "" : "drive", i % 3 == 0 ? "n" : "speed", 1000 + i);
    pass(1ms);
    if (i % 50 == 0) {
      node.device_died("drive", now);
      device("drive");
    }
    for (const auto& each : all()) EXPECT_EQ(each.payload.seq, expected++ % 256);
  }
  EXPECT_GT(expected, 600U);
}

// SP.26: a new birth sequence begins with 0 whatever was before.
TEST_F(EdgeBirth, ARebirthBeginsWith0) {
  device("drive");
  connect();
  change("drive", "speed", std::int64_t{6});
  pass(2s);
  wire.clear();
  rebirth();
  const auto births = all();
  ASSERT_EQ(births.size(), 2U);
  EXPECT_EQ(births[0].payload.seq, 0U);
  EXPECT_EQ(births[1].payload.seq, 1U);
}

// SP.109, SP.274, SP.275: NDEATH before a disconnection that is wanted. SP.110: then DISCONNECT. SP.273: its bdSeq.
TEST_F(EdgeBirth, StoppedOnPurpose) {
  connect();
  wire.clear();
  node.stop(now);
  EXPECT_EQ(wire.order, (std::vector<std::string>{"publish spBv1.0/Plant/NDEATH/Press", "disconnect"}));
  const auto death = all();
  EXPECT_EQ(bd_seq(death.at(0).payload), 0);
  EXPECT_FALSE(death[0].payload.seq);
  EXPECT_EQ(death[0].payload.metrics.size(), 1U);
  EXPECT_FALSE(node.in_session());
  pass(10s);
  EXPECT_TRUE(wire.published.empty());
}

TEST_F(EdgeBirth, AChangedSetOfMetricsIsBornAnew) {
  device("drive");
  connect();
  wire.clear();
  ASSERT_TRUE(node.device_born("drive", {metric("torque", DataType::float64, 1.5)}, now));
  auto births = all();
  ASSERT_EQ(births.size(), 1U);
  EXPECT_EQ(births[0].topic.type, MessageType::dbirth);
  EXPECT_NE(births[0].find("torque"), nullptr);
  EXPECT_EQ(births[0].find("speed"), nullptr);
  ASSERT_TRUE(node.set_metrics({metric("load", DataType::float32, 0.5F)}, now));
  births = all();
  ASSERT_EQ(births.size(), 2U) << "a new NBIRTH makes the devices stale: they are born again";
  EXPECT_EQ(births[0].topic.type, MessageType::nbirth);
  EXPECT_NE(births[0].find("load"), nullptr);
  EXPECT_EQ(births[1].topic.device, "drive");
}

// SP.20: a device's ID is unique in its node. SP.81: and no two differ in case only. SP.82: nor do metrics' names.
// SP.19.
TEST_F(EdgeBirth, NamesThatAreRefused) {
  device("drive");
  const auto refused = [&](const std::string& device, std::vector<OwnMetric> metrics) {
    return !node.device_born(device, std::move(metrics), now);
  };
  EXPECT_TRUE(refused("Drive", {}));
  EXPECT_TRUE(refused("a/b", {}));
  EXPECT_TRUE(refused("", {}));
  EXPECT_TRUE(refused("x", {metric("a", DataType::boolean, true), metric("A", DataType::boolean, true)}));
  EXPECT_TRUE(refused("x", {metric("", DataType::boolean, true)}));
  EXPECT_TRUE(refused("x", {metric("\xFF", DataType::boolean, true)}));
  EXPECT_TRUE(refused("x", {metric("a", DataType::uint8, std::uint64_t{256})}));
  EXPECT_TRUE(refused("x", {metric("a", DataType::unknown, Null{})}));
  EXPECT_FALSE(refused("x", {metric("a", DataType::uint8, std::uint64_t{255})}));
  for (const auto* name : {"bdSeq", "Node Control/Rebirth", "node control/rebirth", "Backlog/Lost"}) {
    EXPECT_FALSE(node.set_metrics({metric(name, DataType::int64, std::int64_t{0})}, now)) << name;
  }
  EXPECT_EQ(node.device_born("Drive", {}, now).error(), "device \"Drive\": \"drive\" differs from it in case only");
  device("drive");  // the same device again is no second one
  connect();
  const auto births = all();
  EXPECT_EQ(std::ranges::count_if(births, [](const Heard& each) { return each.topic.device == "drive"; }), 1);
}

// SP.21: two edge nodes may have devices of one ID.
TEST_F(EdgeBirth, TwoNodesMayHaveOneDeviceId) {
  auto options = defaults();
  options.id.node = "Other";
  EdgeNode other(options, wire, app, backlog);
  ASSERT_TRUE(other.device_born("drive", {}, now));
  device("drive");
  connect();
  (void)other.connecting(now);
  other.connected(now);
  std::set<std::string> topics;
  for (const auto& each : wire.published) topics.insert(each.topic);
  EXPECT_TRUE(topics.contains("spBv1.0/Plant/DBIRTH/Press/drive"));
  EXPECT_TRUE(topics.contains("spBv1.0/Plant/DBIRTH/Other/drive"));
}

Template motor() {
  Template out;
  out.definition = true;
  Metric speed;
  speed.name = "speed";
  speed.type = DataType::int32;
  Metric on;
  on.name = "on";
  on.type = DataType::boolean;
  out.members = {speed, on};
  return out;
}
Template motor_at(std::int64_t speed) {
  Template out;
  out.reference = "Motor";
  out.members = motor().members;
  out.members[0].value = speed;
  out.members[1].value = true;
  return out;
}

// SP.30, SP.214: definitions stand in NBIRTH, and what they lack cannot be published. SP.210: and nowhere else.
TEST_F(EdgeBirth, TemplatesAreDefinedInNBirth) {
  const auto instance = metric("m", DataType::template_type, Boxed<Template>(motor_at(5)));
  EXPECT_FALSE(node.device_born("drive", {instance}, now)) << "no definition yet";
  ASSERT_TRUE(node.set_metrics({metric("Motor", DataType::template_type, Boxed<Template>(motor()))}, now));
  ASSERT_TRUE(node.device_born("drive", {instance}, now));
  EXPECT_FALSE(node.device_born("x", {metric("Motor", DataType::template_type, Boxed<Template>(motor()))}, now));
  EXPECT_FALSE(node.change("", "Motor", Boxed<Template>(motor()), now.utc));
  EXPECT_FALSE(node.change("drive", "m", Boxed<Template>(motor()), now.utc));
  EXPECT_FALSE(node.set_metrics({}, now)) << "the drive needs it";
  connect();
  const auto births = all();
  ASSERT_EQ(births.size(), 2U);
  EXPECT_TRUE(std::get<Boxed<Template>>(births[0].find("Motor")->value)->definition);
  EXPECT_EQ(*std::get<Boxed<Template>>(births[1].find("m")->value), motor_at(5));
}

// SP.221: data may have some of an instance's members. SP.220: births have all.
TEST_F(EdgeBirth, PartsOfATemplate) {
  ASSERT_TRUE(node.set_metrics({metric("Motor", DataType::template_type, Boxed<Template>(motor()))}, now));
  ASSERT_TRUE(node.device_born("drive", {metric("m", DataType::template_type, Boxed<Template>(motor_at(5)))}, now));
  connect();
  wire.clear();
  auto part = motor_at(9);
  part.members.pop_back();
  change("drive", "m", Boxed<Template>(part));
  pass(1ms);
  const auto data = all();
  ASSERT_EQ(data.size(), 1U);
  EXPECT_EQ(*std::get<Boxed<Template>>(data[0].payload.metrics.at(0).value), part);
  connect();
  EXPECT_EQ(*std::get<Boxed<Template>>(all().at(1).find("m")->value), motor_at(9));
}

}  // namespace
}  // namespace sparkplug_test
