// Commands, requests for rebirth and the state of the primary host application, as an edge node takes them.
#include <algorithm>

#include "edge_world.hpp"

namespace sparkplug_test {
namespace {

class EdgeCommand : public EdgeWorld {
 public:
  void up() {
    ASSERT_TRUE(node.set_metrics({writable("mode", DataType::string, std::string("auto"))}, now));
    device("drive");
    connect();
    wire.clear();
  }
};

// SP.171: no data after the request. SP.172: all births. SP.173, SP.239: with the same bdSeq.
TEST_F(EdgeCommand, RebirthOnRequest) {
  up();
  pass(1s);
  change("drive", "speed", std::int64_t{6});
  rebirth();
  auto births = all();
  ASSERT_EQ(births.size(), 2U);
  EXPECT_EQ(births[0].topic.type, MessageType::nbirth);
  EXPECT_EQ(births[0].find("bdSeq")->value, Value(std::int64_t{0}));
  EXPECT_EQ(births[0].payload.seq, 0U);
  EXPECT_EQ(births[1].find("speed")->value, Value(std::int64_t{6}));
  pass(1ms);
  EXPECT_TRUE(wire.published.empty()) << "the change is in the birth";
  EXPECT_EQ(node.next_bd_seq(), 1);
}

// A storm of requests gives one birth sequence a second. SP.171: and no data from the request on.
TEST_F(EdgeCommand, AStormOfRequests) {
  up();
  int births = 0;
  for (int i = 0; i < 5000; ++i) {
    rebirth();
    change("drive", "speed", std::int64_t{i});
    pass(1ms);
    for (const auto& each : all()) {
      births += each.topic.type == MessageType::nbirth;
      EXPECT_TRUE(each.topic.type == MessageType::nbirth || each.topic.type == MessageType::dbirth)
          << name(each.topic.type);
    }
  }
  EXPECT_EQ(births, 5);
}

TEST_F(EdgeCommand, WhatChangedWhileABirthWasDueIsNotLost) {
  up();
  rebirth();
  wire.clear();
  for (const std::int64_t speed : {10, 11, 12}) {
    pass(1ms);
    change("drive", "speed", speed);
  }
  EXPECT_TRUE(wire.published.empty());
  pass(1s);
  const auto births = all();
  ASSERT_EQ(births.size(), 2U);
  EXPECT_EQ(births[1].find("speed")->value, Value(std::int64_t{12}));
  pass(200ms);
  const auto history = all();
  ASSERT_EQ(history.size(), 1U);
  ASSERT_EQ(history[0].payload.metrics.size(), 2U) << "12 is in the birth";
  EXPECT_TRUE(history[0].payload.metrics[0].historical);
  node.disconnected(now);
  EXPECT_EQ(backlog.size(), 3U) << "but unproven";
}

TEST_F(EdgeCommand, NoRebirthForFalseOrForOthers) {
  up();
  pass(5s);
  command("", {write(rebirth_metric, false)});
  command("drive", {write(rebirth_metric, true)});
  const auto bytes = encode({.metrics = {write(rebirth_metric, true)}});
  node.message({"spBv1.0/Plant/NCMD/Other", bytes, false}, now);
  node.message({"spBv1.0/Else/NCMD/Press", bytes, false}, now);
  node.message({"spBv1.0/Plant/NDATA/Press", bytes, false}, now);
  node.message({"other/topic", bytes, false}, now);
  EXPECT_TRUE(wire.published.empty());
}

// SP.175, SP.178: names of the births are known. SP.176, SP.179: the value is of the metric's type.
TEST_F(EdgeCommand, WritesThatPass) {
  up();
  command("", {write("mode", std::string("manual"))});
  command("drive", {write("target", std::uint64_t{0xFFFF'FFFE})});
  ASSERT_EQ(app.commands.size(), 2U);
  EXPECT_EQ(app.commands[0].device, "");
  EXPECT_EQ(app.commands[0].metric, "mode");
  EXPECT_EQ(app.commands[0].value, Value(std::string("manual")));
  EXPECT_EQ(app.commands[1].device, "drive");
  EXPECT_EQ(app.commands[1].metric, "target");
  EXPECT_EQ(app.commands[1].value, Value(std::int64_t{-2})) << "an Int16 in 32 bits";
  EXPECT_TRUE(wire.published.empty()) << "nothing is reported before it is so";
}

// SP.187: by alias, as hosts must. SP.189: with a time or without.
TEST_F(EdgeCommand, WritesByAlias) {
  ASSERT_TRUE(node.set_metrics({writable("mode", DataType::string, std::string("auto"))}, now));
  connect();
  Metric metric;
  metric.alias = all().at(0).find("mode")->alias;
  metric.value = std::string("manual");
  metric.at = Utc{77};
  command("", {metric});
  metric.at.reset();
  command("", {metric});
  ASSERT_EQ(app.commands.size(), 2U);
  EXPECT_EQ(app.commands[0].metric, "mode");
  EXPECT_EQ(app.commands[0].at, Utc{77});
  EXPECT_FALSE(app.commands[1].at);
}

TEST_F(EdgeCommand, WritesThatAreRefusedSayWhy) {
  up();
  Metric unknown;
  unknown.alias = 999;
  unknown.value = true;
  auto old = write("target", std::int64_t{5}, DataType::int16);
  old.historical = true;
  command("drive", {write("speed", std::uint64_t{5}), write("none", std::uint64_t{5}), unknown, write("target", 1.5),
                    write("target", std::uint64_t{40'000 + 0x10000}), write("target", Null{}), old,
                    write("target", std::string("5"), DataType::string), write("Target", std::uint64_t{5})});
  command("valve", {write("target", std::uint64_t{5})});
  command("drive", {write("target", std::uint64_t{5})}, true);
  node.message({"spBv1.0/Plant/DCMD/Press/drive", Bytes{0xFF}, false}, now);
  EXPECT_TRUE(app.commands.empty());
  EXPECT_EQ(app.refusals,
            (std::vector<std::string>{
                "drive|speed|it is not writable", "drive|none|there is no such metric",
                "drive|alias 999|there is no such metric", "drive|target|it is no integer, as its type wants",
                "drive|target|it is out of its type's range", "drive|target|null is no value to write",
                "drive|target|a historical value is no command", "drive|target|it is no integer, as its type wants",
                "drive|Target|there is no such metric", "valve||the device is not there",
                "drive||the command is a retained message, so it is not new",
                "drive||the bytes are no protocol buffer of Sparkplug B, or nest too deeply"}));
  command("drive", {write("none", true), write("target", std::uint64_t{5})});
  EXPECT_EQ(app.commands.size(), 1U) << "one that is refused holds up no other";
}

class EdgePrimary : public EdgeWorld {
 public:
  EdgePrimary() : EdgeWorld(with_primary()) {}
  void up() {
    device("drive");
    connect();
    state(true, 100);
    wire.clear();
  }
};

// SP.98, SP.137: births wait for the primary host. SP.99: for that host. SP.100: that is online. SP.133: STATE is
// subscribed.
TEST_F(EdgePrimary, BirthsWaitForTheHost) {
  device("drive");
  connect();
  EXPECT_EQ(wire.subscribed,
            (std::vector<std::pair<std::string, int>>{{"spBv1.0/Plant/NCMD/Press", 1}, {"spBv1.0/STATE/scada", 1}}));
  pass(1h);
  state(true, 100, "other");
  state(true, 100, "Scada");
  state(false, 100);
  EXPECT_TRUE(wire.published.empty());
  EXPECT_EQ(wire.disconnects, 0) << "one broker: it waits there";
  state(true, 200);
  EXPECT_EQ(types(), (std::vector<std::string>{"NBIRTH", "DBIRTH drive"}));
  state(true, 200);
  EXPECT_TRUE(wire.published.empty()) << "told twice";
}

// A host that never says it is online: changes are kept, nothing is published.
TEST_F(EdgePrimary, AHostThatNeverComes) {
  device("drive");
  connect();
  for (std::int64_t i = 10; i < 20; ++i) {
    change("drive", "speed", i);
    pass(1h);
  }
  rebirth();
  EXPECT_TRUE(wire.published.empty());
  EXPECT_EQ(backlog.size(), 10U);
  EXPECT_FALSE(node.next(now));
  EXPECT_EQ(app.refusals, (std::vector<std::string>{"||there is no session"}));
}

// SP.101: an online STATE that is older than the one before does not count; an equal time does; the first always does.
TEST_F(EdgePrimary, AnOldOnlineState) {
  connect();
  state(false, 500);
  state(true, 499);
  EXPECT_FALSE(node.in_session());
  EXPECT_EQ(app.refusals.size(), 1U);
  state(true, 500);
  EXPECT_TRUE(node.in_session());
}
TEST_F(EdgePrimary, TheFirstStateCounts) {
  connect();
  state(true, 1);
  EXPECT_TRUE(node.in_session());
}

// SP.108, SP.115: offline: NDEATH, DISCONNECT. SP.136: and the connection is given up. SP.109.
TEST_F(EdgePrimary, TheHostGoesOffline) {
  up();
  state(false, 100);
  EXPECT_EQ(wire.order, (std::vector<std::string>{"publish spBv1.0/Plant/NDEATH/Press", "disconnect"}));
  EXPECT_FALSE(node.in_session());
  change("drive", "speed", std::int64_t{77});
  pass(10s);
  EXPECT_EQ(wire.published.size(), 1U);
  node.disconnected(now);
  wire.clear();
  connect();
  EXPECT_TRUE(wire.published.empty()) << "a new connection waits for STATE again";
  state(true, 300);
  EXPECT_EQ(types(), (std::vector<std::string>{"NBIRTH", "DBIRTH drive"}));
  pass(200ms);
  const auto data = all();
  ASSERT_EQ(data.size(), 1U);
  EXPECT_TRUE(data[0].payload.metrics.at(0).historical);
}

// SP.117: an offline STATE that is older than the last online one ends nothing.
TEST_F(EdgePrimary, ALateWillOfTheHostIsIgnored) {
  up();
  state(false, 99);
  EXPECT_TRUE(wire.order.empty());
  EXPECT_TRUE(node.in_session());
  ASSERT_EQ(app.refusals.size(), 1U);
  state(false, 101);
  EXPECT_FALSE(node.in_session());
}

// The standard's rule locks out a host whose clock was set back; a person can open again.
TEST_F(EdgePrimary, AClockThatWasSetBack) {
  up();
  state(false, 100);
  node.disconnected(now);
  connect();
  state(true, 50);
  EXPECT_FALSE(node.in_session());
  node.forget_primary_state();
  state(true, 50);
  EXPECT_TRUE(node.in_session());
}

class EdgeWalk : public EdgeWorld {
 public:
  static EdgeNodeOptions several() {
    auto out = with_primary();
    out.several_servers = true;
    return out;
  }
  EdgeWalk() : EdgeWorld(several()) {}
};
// SP.136: with several servers an offline host sends the node on, also before births. SP.10: without an NDEATH then.
TEST_F(EdgeWalk, GoesOnToTheNextServer) {
  connect();
  wire.clear();
  state(false, 100);
  EXPECT_EQ(wire.order, (std::vector<std::string>{"disconnect"}));
}

TEST_F(EdgePrimary, StatesThatAreNone) {
  connect();
  for (const std::string text : {"ONLINE", "", "[]", "{}", R"({"online":1,"timestamp":5})", R"({"online":true})",
                                 R"({"online":true,"timestamp":"5"})", R"({"online":true,"timestamp":-5})",
                                 R"({"online":true,"timestamp":1.5})", "{\"online\":true,\"timestamp\":5", "null"}) {
    const Bytes bytes(text.begin(), text.end());
    node.message({"spBv1.0/STATE/scada", bytes, true}, now);
    EXPECT_FALSE(node.in_session()) << text;
    EXPECT_FALSE(decode_state(bytes)) << text;
  }
  EXPECT_EQ(app.refusals.size(), 11U);
  const std::string deep(3000, '[');
  EXPECT_FALSE(decode_state(Bytes(deep.begin(), deep.end())));
  const std::string text = R"( {"timestamp": 1.67e12, "online": true, "more": [1]} )";
  const auto state = decode_state(Bytes(text.begin(), text.end()));
  ASSERT_TRUE(state);
  EXPECT_EQ(*state, (HostState{true, Utc{1'670'000'000'000}}));
}

}  // namespace
}  // namespace sparkplug_test
