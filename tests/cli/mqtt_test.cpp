// `berth up --mqtt` and `berth demo --mqtt` in a process of its own.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <string>

#include "../mqtt/heard.hpp"
#include "../pch.hpp"
#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

TEST(MqttCommand, AWrongAddressIsWrongUse) {
  const auto outcome = berth({"demo", "--mqtt", "localhost:1883"});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_NE(outcome.err.find("--mqtt:"), std::string::npos) << outcome.err;
  EXPECT_EQ(berth({"demo", "--mqtt", "mqtt://user@localhost"}).status, 2);
  EXPECT_EQ(berth({"demo", "--fast", "--mqtt", "mqtt://localhost"}).status, 2) << "hosts have the clock's time";
}

// Nothing is sent on a bus before all is right.
TEST(MqttCommand, WhatNoPdoCarriesIsRefusedBeforeTheStart) {
  const Folder folder;
  static_cast<void>(folder.bring("eds/sensor.eds"));
  const auto machine = folder.write("machine.toml",
                                    "[machine]\nname = \"m\"\n[bus.field]\nport = \"sim\"\nbitrate = 250_000\n"
                                    "[[slot]]\nbus = \"field\"\nid = 5\nname = \"s\"\neds = \"eds/sensor.eds\"\n"
                                    "publish = [\"Temperature\"]\n");
  const auto plant = folder.write("plant.toml", "[plant]\n[bus.field]\n");
  const auto outcome = berth({"up", machine, "--sim", plant, "--mqtt", "mqtt://127.0.0.1:1", "--control",
                              folder.file("control"), "--timeout", "60 s"});
  EXPECT_EQ(outcome.status, 2) << outcome.out << outcome.err;
  EXPECT_NE(outcome.err.find("machine.toml:11:12"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("poll = true"), std::string::npos) << outcome.err;
}

TEST(MqttCommand, TheDemoIsBornAndDies) {
  NEEDS_BROKER();
  mqtt::test::Broker broker;
  auto listening = mqtt::test::quick(broker.where(), "host");
  listening.subscriptions = {"spBv1.0/#"};
  mqtt::test::Station host(listening);
  ASSERT_TRUE(host.heard.until(mqtt::test::is_up));
  const Folder folder;
  Background demo({"demo", "--mqtt", mqtt::to_string(broker.where()), "--control", folder.file("control")});
  ASSERT_TRUE(host.heard.until([](const auto& s) { return s.has("spBv1.0/berth/DBIRTH/five slaves/s5"); }));
  demo.signal(SIGTERM);
  const auto end = demo.end();
  EXPECT_NE(end.out.find("as berth/five slaves"), std::string::npos) << end.out << end.err;
  EXPECT_NE(end.out.find("mqtt: connected to mqtt://127.0.0.1"), std::string::npos) << end.out;
  ASSERT_TRUE(host.heard.until([](const auto& s) { return s.has("spBv1.0/berth/NDEATH/five slaves"); }));
  EXPECT_EQ(host.heard.story().messages.front().topic, "spBv1.0/berth/NBIRTH/five slaves");
}

// A broker that is not there does not keep a machine from running.
TEST(MqttCommand, WithoutABrokerTheMachineRuns) {
  const Folder folder;
  const auto outcome = berth({"demo", "--pace", "--until", "operational", "--mqtt", "mqtt://127.0.0.1:1", "--control",
                              folder.file("control")});
  EXPECT_EQ(outcome.status, 0) << outcome.out << outcome.err;
  EXPECT_NE(outcome.out.find("keeps what changes"), std::string::npos) << outcome.out;
}

}  // namespace
}  // namespace berth::test
