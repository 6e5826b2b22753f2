// `berth up --mqtt` and `berth demo --mqtt` in a process of its own.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <nlohmann/json.hpp>
#include <string>

#include "../mqtt/heard.hpp"
#include "../pch.hpp"
#include "berth/command/control.hpp"
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

// What a page of Studio asks for: the machines of the group, and the way to their own Studio.
TEST(MqttCommand, TheProcessAnswersFleet) {
  NEEDS_BROKER();
  mqtt::test::Broker broker;
  const Folder folder;
  const auto socket = folder.file("control");
  Background demo({"demo", "--studio=127.0.0.1:0", "--mqtt", mqtt::to_string(broker.where()), "--control", socket});
  ASSERT_TRUE(demo.says("/#token="));
  const auto ask = [&](const std::string& since) {
    constexpr int patience_ms = 60'000;
    return command::control_call(socket, {"fleet", {{"since", since}}}, patience_ms).value_or(command::Reply{});
  };
  nlohmann::json machine;
  nlohmann::json answer;
  ASSERT_TRUE(eventually([&] {
    answer = nlohmann::json::parse(ask("0").json, nullptr, false);
    if (!answer.is_object() || !answer.contains("machines") || answer["machines"].empty()) return false;
    machine = answer["machines"][0];
    return machine.at("operational") == true;
  }));
  EXPECT_EQ(answer.at("connected"), true);
  EXPECT_EQ(machine.at("group"), "berth");
  EXPECT_EQ(machine.at("machine"), "five slaves");
  EXPECT_EQ(machine.at("slots").size(), 5U);
  const auto said = demo.said();
  const auto address = said.substr(said.find("http://"), said.find("#token=") - said.find("http://"));
  EXPECT_EQ(machine.at("studio"), address) << "without the token";
  EXPECT_EQ(ask("yesterday").status, 2);
  const auto audit = berth({"history", "--audit", "--control", socket, "--json"});
  EXPECT_EQ(audit.out.find("fleet"), std::string::npos) << audit.out;
  demo.signal(SIGTERM);
  static_cast<void>(demo.end());
}

TEST(MqttCommand, WithoutABrokerThereIsNoFleet) {
  const Folder folder;
  const auto socket = folder.file("control");
  Background demo({"demo", "--pace", "--control", socket});
  ASSERT_TRUE(eventually([&] { return command::control_answers(socket); }));
  const auto reply = command::control_call(socket, {"fleet", {}}, 60'000).value_or(command::Reply{});
  EXPECT_EQ(reply.status, 1);
  EXPECT_NE(reply.error.find("start it with --mqtt"), std::string::npos) << reply.error;
  demo.signal(SIGTERM);
  static_cast<void>(demo.end());
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
