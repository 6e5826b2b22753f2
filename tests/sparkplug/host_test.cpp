// A host application: its own state, what it knows of a fleet, what it notices, what it asks for and writes.
#include "berth/sparkplug/host.hpp"

#include <malloc.h>

#include <algorithm>

#include "edge_world.hpp"

namespace sparkplug_test {
namespace {

class Noted final : public HostEvents {
 public:
  void born(const EdgeNodeId& node, const std::string& device) override {
    lines.push_back("born " + node.node + "/" + device);
  }
  void died(const EdgeNodeId& node, const std::string& device) override {
    lines.push_back("died " + node.node + "/" + device);
  }
  void value(const EdgeNodeId& node, const std::string& device, const std::string& metric,
             const Metric& data) override {
    lines.push_back((data.historical ? "history " : "value ") + node.node + "/" + device + " " + metric);
  }
  void trouble(const EdgeNodeId& node, const char* why) override {
    lines.push_back("trouble " + node.node + ": " + why);
  }
  std::vector<std::string> take() { return std::exchange(lines, {}); }
  std::vector<std::string> lines;
};

class HostTest : public testing::Test {
 public:
  explicit HostTest(HostOptions options = defaults()) : host(std::move(options), wire, noted) {}
  static HostOptions defaults() {
    HostOptions out;
    out.id = "scada";
    return out;
  }
  Publication connect() {
    auto will = host.connecting(now);
    host.connected(now);
    return will;
  }
  void pass(std::chrono::milliseconds time) {
    now.steady += time;
    now.utc.ms += static_cast<std::uint64_t>(time.count());
    host.tick(now);
  }
  void hear(const Publication& message) { host.message({message.topic, message.bytes, false}, now); }
  void hear(MessageType type, const std::string& device, std::optional<std::uint64_t> seq, std::vector<Metric> metrics,
            const EdgeNodeId& id = press) {
    Payload payload;
    payload.at = Utc{777};
    payload.seq = seq;
    payload.metrics = std::move(metrics);
    const bool birth = type == MessageType::nbirth || type == MessageType::dbirth;
    hear({device.empty() ? make_topic(id, type) : make_topic(id, type, device),
          encode(payload, birth ? Types::written : Types::left_out), 0, false});
  }
  static Metric metric(const std::string& name, DataType type, Value value, std::optional<std::uint64_t> alias = {}) {
    Metric out;
    if (!name.empty()) out.name = name;
    out.alias = alias;
    out.at = Utc{500};
    out.type = type;
    out.value = std::move(value);
    return out;
  }
  void nbirth(std::int64_t bd_seq = 0, const EdgeNodeId& id = press) {
    hear(MessageType::nbirth, "", 0,
         {metric("bdSeq", DataType::int64, bd_seq), metric("Node Control/Rebirth", DataType::boolean, false),
          metric("load", DataType::float32, 1.0F, 1)},
         id);
  }
  void dbirth(std::uint64_t seq = 1) {
    hear(MessageType::dbirth, "drive", seq,
         {metric("speed", DataType::int32, std::int64_t{5}, 2),
          metric("mode", DataType::string, std::string("auto"), 3)});
  }
  void speed(std::uint64_t seq, std::int64_t value) {
    hear(MessageType::ddata, "drive", seq, {metric("", DataType::int32, value, 2)});
  }
  void ndeath(std::int64_t bd_seq) {
    hear(MessageType::ndeath, "", std::nullopt, {metric("bdSeq", DataType::int64, bd_seq)});
  }
  void up() {
    connect();
    nbirth();
    dbirth();
    wire.clear();
    noted.take();
  }
  void own_state(bool online, std::uint64_t at) {
    host.message({"spBv1.0/STATE/scada", encode_state({online, Utc{at}}), true}, now);
  }
  /// "value/quality" of a metric.
  std::string shown(const std::string& device, const std::string& name) {
    const auto* node = host.fleet().find(press);
    const auto* of = node != nullptr ? host.fleet().find(*node, device) : nullptr;
    const auto* metric = of != nullptr ? host.fleet().find(*of, name) : nullptr;
    if (metric == nullptr) return "none";
    const auto* number = std::get_if<std::int64_t>(&metric->value);
    return (number != nullptr ? std::to_string(*number) : "?") + "/" +
           std::to_string(static_cast<int>(Fleet::quality(*node, *of, *metric)));
  }
  int rebirths() {
    int count = 0;
    for (const auto& each : wire.published) count += each.topic == "spBv1.0/Plant/NCMD/Press";
    wire.published.clear();
    return count;
  }

  Wire wire;
  Noted noted;
  Now now{Utc{2'000'000}, 9'000ms};
  Host host;
};

std::size_t heap() { return ::mallinfo2().uordblks; }

std::string text(const Publication& message) { return {message.bytes.begin(), message.bytes.end()}; }

// SP.1, SP.13, SP.288: STATE says online and offline. SP.65, SP.10, SP.134, SP.144: the birth is the first message.
// SP.69, SP.85, SP.285: after the subscriptions, its own STATE among them. SP.70, SP.86, SP.286: right after them.
TEST_F(HostTest, TheOrderOfAConnection) {
  connect();
  EXPECT_EQ(wire.order, (std::vector<std::string>{"subscribe spBv1.0/STATE/scada", "subscribe spBv1.0/#",
                                                  "publish spBv1.0/STATE/scada"}));
  wire.clear();
  host.stop(now);
  EXPECT_EQ(wire.order, (std::vector<std::string>{"publish spBv1.0/STATE/scada", "disconnect"}));
}

// SP.75, SP.140: the will's topic. SP.73, SP.142, SP.282: QoS 1. SP.74, SP.143, SP.283: retained. SP.77, SP.78, SP.141,
// SP.284: offline, with the time of CONNECT.
TEST_F(HostTest, TheWill) {
  const auto will = host.connecting(now);
  EXPECT_EQ(will.topic, "spBv1.0/STATE/scada");
  EXPECT_EQ(will.qos, 1);
  EXPECT_TRUE(will.retain);
  EXPECT_EQ(text(will), R"({"online":false,"timestamp":2000000})");
}

// SP.68, SP.145: topic. SP.66, SP.147, SP.286: QoS 1. SP.67, SP.148: retained. SP.71, SP.87, SP.146, SP.287: online.
// SP.72, SP.88: with the will's time, whatever passed since.
TEST_F(HostTest, TheBirth) {
  (void)host.connecting(now);
  now.utc.ms += 5000;
  host.connected(now);
  ASSERT_EQ(wire.published.size(), 1U);
  EXPECT_EQ(wire.published[0].topic, "spBv1.0/STATE/scada");
  EXPECT_EQ(wire.published[0].qos, 1);
  EXPECT_TRUE(wire.published[0].retain);
  EXPECT_EQ(text(wire.published[0]), R"({"online":true,"timestamp":2000000})");
}

// SP.150, SP.79, SP.80: a death before a disconnection that is wanted, with the time of now. SP.151: topic. SP.152:
// payload. SP.153: QoS 1. SP.154: retained. SP.155: then DISCONNECT.
TEST_F(HostTest, StoppedOnPurpose) {
  connect();
  wire.clear();
  now.utc.ms += 5000;
  host.stop(now);
  ASSERT_EQ(wire.published.size(), 1U);
  EXPECT_EQ(wire.published[0].topic, "spBv1.0/STATE/scada");
  EXPECT_EQ(wire.published[0].qos, 1);
  EXPECT_TRUE(wire.published[0].retain);
  EXPECT_EQ(text(wire.published[0]), R"({"online":false,"timestamp":2005000})");
  EXPECT_EQ(wire.disconnects, 1);
}

TEST_F(HostTest, ItsTimeNeverGoesBack) {
  connect();
  now.utc.ms -= 10'000;
  EXPECT_EQ(text(connect()), R"({"online":false,"timestamp":2000000})");
  own_state(true, 2'000'001);
  ASSERT_EQ(noted.lines.size(), 1U);
  EXPECT_TRUE(noted.lines[0].starts_with("trouble : a STATE of this host is newer than its session")) << noted.lines[0];
}

// SP.89: its own offline STATE is answered at once by an online one, with the time of CONNECT.
TEST_F(HostTest, ALateWillOfItsOwn) {
  connect();
  wire.clear();
  now.utc.ms += 5000;
  own_state(false, 1'999'000);
  ASSERT_EQ(wire.published.size(), 1U);
  EXPECT_EQ(text(wire.published[0]), R"({"online":true,"timestamp":2000000})");
  wire.clear();
  own_state(true, 2'000'000);
  host.message({"spBv1.0/STATE/other", encode_state({false, Utc{1}}), true}, now);
  EXPECT_TRUE(wire.published.empty());
}

// SP.149: a connection to another server has a time of its own.
TEST_F(HostTest, TwoServersHaveTwoTimes) {
  Host other(defaults(), wire, noted);
  (void)host.connecting(now);
  host.connected(now);
  now.utc.ms += 5000;
  (void)other.connecting(now);
  other.connected(now);
  wire.clear();
  own_state(false, 1);
  EXPECT_EQ(text(wire.published.at(0)), R"({"online":true,"timestamp":2000000})");
  other.message({"spBv1.0/STATE/scada", encode_state({false, Utc{1}}), true}, now);
  EXPECT_EQ(text(wire.published.at(1)), R"({"online":true,"timestamp":2005000})");
}

class HostOfGroups : public HostTest {
 public:
  static HostOptions groups() {
    auto out = defaults();
    out.groups = {"Plant", "Yard"};
    return out;
  }
  HostOfGroups() : HostTest(groups()) {}
};
TEST_F(HostOfGroups, SeesItsGroupsOnly) {
  connect();
  EXPECT_EQ(wire.order, (std::vector<std::string>{"subscribe spBv1.0/STATE/scada", "subscribe spBv1.0/Plant/#",
                                                  "subscribe spBv1.0/Yard/#", "publish spBv1.0/STATE/scada"}));
  nbirth(0, {"Else", "Press"});
  EXPECT_TRUE(host.fleet().nodes().empty());
}

TEST_F(HostTest, SeesBirthsDataAndHistory) {
  connect();
  nbirth();
  dbirth();
  speed(2, -7);
  auto old = metric("", DataType::int32, std::int64_t{1}, 2);
  old.historical = true;
  hear(MessageType::ddata, "drive", 3, {old});
  EXPECT_EQ(noted.lines, (std::vector<std::string>{"born Press/", "born Press/drive", "value Press/drive speed",
                                                   "history Press/drive speed"}));
  EXPECT_EQ(shown("drive", "speed"), "-7/192");
  EXPECT_EQ(shown("", "load"), "?/192");
  EXPECT_EQ(shown("drive", "none"), "none");
  const auto* node = host.fleet().find(press);
  EXPECT_TRUE(node->self.online);
  EXPECT_EQ(node->self.since, Utc{777});
  EXPECT_EQ(host.fleet().find(*host.fleet().find(*node, "drive"), "speed")->at, Utc{500});
}

// SP.111: NDEATH: the node is offline, at the host's time. SP.112: its metrics are stale. SP.113: its devices are
// offline. SP.114: and their metrics are stale.
TEST_F(HostTest, NDeath) {
  up();
  pass(3s);
  ndeath(0);
  const auto* node = host.fleet().find(press);
  EXPECT_FALSE(node->self.online);
  EXPECT_EQ(node->self.since, now.utc);
  const auto* drive = host.fleet().find(*node, "drive");
  EXPECT_FALSE(drive->online);
  EXPECT_EQ(drive->since, now.utc);
  EXPECT_EQ(shown("", "load"), "?/500");
  EXPECT_EQ(shown("drive", "speed"), "5/500");
  EXPECT_EQ(noted.lines, (std::vector<std::string>{"died Press/"}));
  ndeath(0);
  EXPECT_EQ(noted.lines.size(), 1U) << "the will after the death that was published";
}

// A will that arrives after the new birth is ignored: its bdSeq is another.
TEST_F(HostTest, ALateWillOfANode) {
  up();
  nbirth(1);
  ndeath(0);
  EXPECT_TRUE(host.fleet().find(press)->self.online);
  hear(MessageType::ndeath, "", std::nullopt, {});
  EXPECT_TRUE(host.fleet().find(press)->self.online);
  ndeath(1);
  EXPECT_FALSE(host.fleet().find(press)->self.online);
}

// SP.127: DDEATH: the device is offline, at the message's time. SP.128: its metrics are stale.
TEST_F(HostTest, DDeath) {
  up();
  hear(MessageType::ddeath, "drive", 2, {});
  const auto* node = host.fleet().find(press);
  const auto* drive = host.fleet().find(*node, "drive");
  EXPECT_FALSE(drive->online);
  EXPECT_EQ(drive->since, Utc{777});
  EXPECT_TRUE(node->self.online);
  EXPECT_EQ(shown("drive", "speed"), "5/500");
  EXPECT_EQ(shown("", "load"), "?/192");
}

TEST_F(HostTest, DevicesAreStaleUntilTheyAreBornInTheNewSession) {
  up();
  nbirth(1);
  EXPECT_EQ(shown("drive", "speed"), "5/500");
  dbirth();
  EXPECT_EQ(shown("drive", "speed"), "5/192");
}

// All is stale when the host loses its own connection; after it each node is asked for a birth.
TEST_F(HostTest, ItsOwnConnectionIsLost) {
  up();
  host.disconnected(now);
  EXPECT_EQ(shown("drive", "speed"), "5/500");
  pass(10s);
  EXPECT_TRUE(wire.published.empty());
  connect();
  EXPECT_EQ(rebirths(), 1);
  nbirth();
  EXPECT_EQ(shown("", "load"), "?/192");
}

// SP.129, SP.130: a message that is out of order starts the time-out. SP.132: it ends when the missing one comes.
TEST_F(HostTest, OutOfOrderWithinTheTimeOut) {
  up();
  speed(4, 14);
  speed(3, 13);
  EXPECT_EQ(shown("drive", "speed"), "5/192");
  EXPECT_EQ(host.next(), now.steady + 2s);
  pass(1999ms);
  EXPECT_EQ(rebirths(), 0);
  speed(2, 12);
  EXPECT_EQ(shown("drive", "speed"), "14/192") << "in their order";
  EXPECT_FALSE(host.next());
  pass(10s);
  EXPECT_EQ(rebirths(), 0);
  speed(5, 15);
  EXPECT_EQ(shown("drive", "speed"), "15/192");
}

// SP.131: the missing one does not come: a rebirth is asked for. SP.168: by NCMD. SP.169: metric Node Control/Rebirth,
// by name. SP.170: true. SP.43: topic. SP.44, SP.263, SP.264: QoS 0, not retained. SP.45, SP.261: time. SP.262: no
// number.
TEST_F(HostTest, AGap) {
  up();
  speed(3, 13);
  pass(2s);
  ASSERT_EQ(wire.published.size(), 1U);
  EXPECT_EQ(wire.published[0].topic, "spBv1.0/Plant/NCMD/Press");
  EXPECT_EQ(wire.published[0].qos, 0);
  EXPECT_FALSE(wire.published[0].retain);
  const auto request = heard(wire.published[0]);
  EXPECT_EQ(request.payload.at, now.utc);
  EXPECT_FALSE(request.payload.seq);
  ASSERT_EQ(request.payload.metrics.size(), 1U);
  EXPECT_EQ(request.payload.metrics[0].name, "Node Control/Rebirth");
  EXPECT_FALSE(request.payload.metrics[0].alias);
  EXPECT_EQ(request.payload.metrics[0].value, Value(true));
  EXPECT_EQ(shown("drive", "speed"), "5/500") << "it may be another by now";
  speed(4, 14);
  EXPECT_EQ(shown("drive", "speed"), "5/500");
  nbirth();
  dbirth();
  EXPECT_EQ(shown("drive", "speed"), "5/192");
  pass(1h);
  EXPECT_EQ(rebirths(), 1) << "one was enough";
}

TEST_F(HostTest, NumbersGoRound) {
  up();
  for (std::uint64_t i = 2; i < 600; ++i) speed(i % 256, static_cast<std::int64_t>(i));
  EXPECT_EQ(shown("drive", "speed"), "599/192");
  EXPECT_FALSE(host.next());
}

class HostWithoutReordering : public HostTest {
 public:
  static HostOptions at_once() {
    auto out = defaults();
    out.reorder_timeout = 0ms;
    return out;
  }
  HostWithoutReordering() : HostTest(at_once()) {}
};
// SP.129: the time-out is an option.
TEST_F(HostWithoutReordering, AGapIsOneAtOnce) {
  up();
  speed(3, 13);
  EXPECT_EQ(rebirths(), 1);
}

TEST_F(HostTest, WhatMakesItAsk) {
  connect();
  speed(7, 1);
  EXPECT_EQ(rebirths(), 1) << "data before any birth";
  nbirth();
  pass(1min);
  speed(1, 1);
  EXPECT_EQ(rebirths(), 1) << "data before the device's birth";
  nbirth();
  dbirth();
  pass(1min);
  hear(MessageType::ddata, "drive", 2, {metric("", DataType::int32, std::int64_t{1}, 99)});
  EXPECT_EQ(rebirths(), 1) << "an alias that no birth has";
  nbirth();
  dbirth();
  pass(1min);
  hear(MessageType::ddata, "drive", 2, {metric("none", DataType::int32, std::int64_t{1})});
  EXPECT_EQ(rebirths(), 1) << "a name that no birth has";
  nbirth();
  pass(1min);
  hear({"spBv1.0/Plant/NDATA/Press", {0xFF}, 0, false});
  EXPECT_EQ(rebirths(), 1) << "no payload";
  nbirth();
  pass(1min);
  hear(MessageType::ndata, "", std::nullopt, {});
  EXPECT_EQ(rebirths(), 1) << "no number";
  pass(1min);
  hear(MessageType::nbirth, "", 0, {});
  EXPECT_EQ(rebirths(), 1) << "no bdSeq";
  nbirth();
  dbirth();
  speed(2, 2);
  EXPECT_EQ(shown("drive", "speed"), "2/192");
}

TEST_F(HostTest, AsksInABoundedPace) {
  connect();
  int asked = 0;
  std::vector<std::int64_t> seconds;
  for (int i = 0; i < 3600; ++i) {
    if (i < 5) speed(7, i);
    if (const int now_asked = rebirths(); now_asked != 0) {
      asked += now_asked;
      seconds.push_back(i);
    }
    pass(1s);
  }
  EXPECT_EQ(asked, 10);
  EXPECT_EQ(seconds, (std::vector<std::int64_t>{0, 2, 6, 14, 30, 62, 122, 182, 242, 302}));
  speed(7, 9);
  EXPECT_EQ(rebirths(), 1) << "it is there after all";
}

// A host that starts into a running fleet makes no storm.
TEST_F(HostTest, AsksAFleetOneByOne) {
  connect();
  wire.clear();
  for (int i = 0; i < 1000; ++i) {
    hear(MessageType::ndata, "", 9, {}, {"Plant", "M" + std::to_string(i)});
  }
  EXPECT_EQ(wire.published.size(), 1U);
  for (int i = 0; i < 50; ++i) pass(20ms);
  EXPECT_EQ(wire.published.size(), 51U);
}

// SP.174: a node is written to by NCMD. SP.175: metrics of its NBIRTH only. SP.176: with values of their types. SP.46:
// with the metrics to be written. SP.44, SP.45, SP.262, SP.263, SP.264, SP.194.
TEST_F(HostTest, WritesToANode) {
  up();
  ASSERT_TRUE(host.write(press, "", "load", 2.5F, now));
  ASSERT_EQ(wire.published.size(), 1U);
  const auto command = heard(wire.published[0]);
  EXPECT_EQ(command.topic, (Topic{.type = MessageType::ncmd, .edge = press}));
  EXPECT_EQ(command.qos, 0);
  EXPECT_FALSE(command.retain);
  EXPECT_EQ(command.payload.at, now.utc);
  EXPECT_FALSE(command.payload.seq);
  ASSERT_EQ(command.payload.metrics.size(), 1U);
  EXPECT_EQ(command.payload.metrics[0].alias, 1U);
  EXPECT_FALSE(command.payload.metrics[0].name);
  EXPECT_FALSE(command.payload.metrics[0].type);
  EXPECT_EQ(command.payload.metrics[0].value, Value(2.5F));
  wire.clear();
  EXPECT_EQ(host.write(press, "", "none", 2.5F, now).error().code, Errc::not_found);
  EXPECT_EQ(host.write(press, "", "load", 2.5, now).error().code, Errc::invalid);
  EXPECT_TRUE(wire.published.empty());
}

// SP.177: a device is written to by DCMD. SP.61: topic. SP.62, SP.267, SP.268: QoS 0, not retained. SP.63, SP.265:
// time. SP.64: the metrics. SP.266: no number. SP.178, SP.187: those of its DBIRTH, by alias. SP.179: a value of the
// metric's type.
TEST_F(HostTest, WritesToADevice) {
  up();
  ASSERT_TRUE(host.write(press, "drive", "speed", std::int64_t{-3}, now));
  ASSERT_EQ(wire.published.size(), 1U);
  const auto command = heard(wire.published[0]);
  EXPECT_EQ(command.topic, (Topic{.type = MessageType::dcmd, .edge = press, .device = "drive"}));
  EXPECT_EQ(command.qos, 0);
  EXPECT_FALSE(command.retain);
  EXPECT_EQ(command.payload.at, now.utc);
  EXPECT_FALSE(command.payload.seq);
  ASSERT_EQ(command.payload.metrics.size(), 1U);
  EXPECT_EQ(command.payload.metrics[0].alias, 2U);
  EXPECT_FALSE(command.payload.metrics[0].name);
  EXPECT_EQ(interpret(DataType::int32, command.payload.metrics[0].value), Value(std::int64_t{-3}));
  wire.clear();
  EXPECT_EQ(host.write(press, "drive", "speed", 1.5, now).error().code, Errc::invalid);
  EXPECT_EQ(host.write(press, "drive", "speed", Null{}, now).error().code, Errc::invalid);
  EXPECT_EQ(host.write(press, "drive", "none", true, now).error().code, Errc::not_found);
  EXPECT_EQ(host.write(press, "valve", "speed", true, now).error().code, Errc::not_found);
  EXPECT_EQ(host.write({"Plant", "None"}, "", "load", true, now).error().code, Errc::not_found);
  hear(MessageType::ddeath, "drive", 2, {});
  EXPECT_EQ(host.write(press, "drive", "speed", std::int64_t{1}, now).error().code, Errc::invalid);
  host.disconnected(now);
  EXPECT_EQ(host.write(press, "", "load", 1.0F, now).error().code, Errc::bus);
  EXPECT_TRUE(wire.published.empty());
}

class HostOfFew : public HostTest {
 public:
  static HostOptions few() {
    auto out = defaults();
    out.limits = {.nodes = 2, .devices = 1, .metrics = 4, .value_bytes = 100, .bytes = 1 << 20};
    out.most_held = 2;
    return out;
  }
  HostOfFew() : HostTest(few()) {}
};
TEST_F(HostOfFew, HasLimits) {
  connect();
  nbirth(0, {"Plant", "A"});
  nbirth();
  nbirth(0, {"Plant", "C"});
  EXPECT_EQ(host.fleet().nodes().size(), 2U);
  EXPECT_EQ(noted.take().back(), "trouble C: there are more edge nodes than this host keeps");
  hear(MessageType::dbirth, "a", 1, {metric("t", DataType::string, std::string(200, 'x'), 5)});
  const auto* node = host.fleet().find(press);
  EXPECT_TRUE(std::holds_alternative<Unsupported>(host.fleet().find(*host.fleet().find(*node, "a"), "t")->value));
  hear(MessageType::dbirth, "b", 2, {});
  EXPECT_EQ(noted.take().back(), "trouble Press: the edge node has more devices than this host keeps");
  hear(MessageType::dbirth, "a", 3, {metric("t", DataType::boolean, true, 5), metric("u", DataType::boolean, true, 6)});
  EXPECT_EQ(noted.take().back(), "trouble Press: the edge node has more metrics than this host keeps");
  wire.clear();
  for (const auto seq : {6, 7, 8}) hear(MessageType::ndata, "", static_cast<std::uint64_t>(seq), {});
  EXPECT_EQ(rebirths(), 1) << "more wait than may";
}

TEST_F(HostTest, MemoryIsGivenBack) {
  const auto before = host.fleet().bytes();
  up();
  const auto idle = host.fleet().bytes();
  hear(MessageType::ddata, "drive", 2, {metric("", DataType::string, std::string(1000, 'x'), 3)});
  EXPECT_GT(host.fleet().bytes(), idle + 1000);
  hear(MessageType::ddata, "drive", 3, {metric("", DataType::string, std::string("auto"), 3)});
  EXPECT_EQ(host.fleet().bytes(), idle);
  nbirth(1);
  dbirth();
  host.forget(press);
  EXPECT_EQ(host.fleet().bytes(), before);
  EXPECT_TRUE(host.fleet().nodes().empty());
  speed(9, 1);
  EXPECT_EQ(host.fleet().nodes().size(), 1U) << "it comes back when it speaks";
}

// 1,000 nodes of 30 devices of 20 metrics, in less than 64 MB.
TEST_F(HostTest, AFleetOfAThousandNodes) {
  connect();
  // Aliases are unique within a node: the machines of one kind say the same.
  std::vector<Bytes> births;
  std::uint64_t alias = 1;
  for (std::uint64_t d = 0; d < 30; ++d) {
    Payload payload;
    payload.at = Utc{777};
    payload.seq = d + 1;
    for (std::uint64_t i = 0; i < 20; ++i) {
      payload.metrics.push_back(metric("Motor/Value " + std::to_string(i), DataType::int32, std::int64_t{5}, ++alias));
    }
    births.push_back(encode(payload));
  }
  const auto before = heap();
  for (int n = 0; n < 1000; ++n) {
    const EdgeNodeId id{"Plant", "Machine " + std::to_string(n)};
    nbirth(0, id);
    for (std::size_t d = 0; d < births.size(); ++d) {
      const auto topic = make_topic(id, MessageType::dbirth, "Slot " + std::to_string(d));
      host.message({topic, births[d], false}, now);
    }
  }
  EXPECT_EQ(host.fleet().nodes().size(), 1000U);
  const auto& last = host.fleet().nodes().rbegin()->second;
  EXPECT_EQ(last.devices.size(), 30U);
  EXPECT_EQ(last.devices[29].metrics.size(), 20U);
  EXPECT_EQ(last.devices[29].metrics.capacity(), 20U) << "nothing in reserve";
  EXPECT_LT(host.fleet().bytes(), 64U << 20);
  noted.lines = {};
  // What malloc gave out, where it says so (a sanitizer's does not).
  if (before != 0) {
    EXPECT_LT(heap() - before, 64U << 20);
    EXPECT_LT(heap() - before, host.fleet().bytes() + (8U << 20)) << "the fleet's own count is near the truth";
  }
}

}  // namespace
}  // namespace sparkplug_test
