// A client against Debian's Mosquitto, by both versions of MQTT.
#include "berth/mqtt/client.hpp"

#include <gtest/gtest.h>

#include <semaphore>
#include <thread>

#include "../pch.hpp"
#include "heard.hpp"

namespace berth::mqtt {
namespace {

using namespace std::chrono_literals;
using test::Broker;
using test::bytes;
using test::is_up;
using test::quick;
using test::Station;
using test::Story;

class Mqtt : public testing::TestWithParam<Version> {
 protected:
  static Options options(const Broker& broker, const std::string& client_id,
                         const std::vector<std::string>& subscriptions = {}) {
    auto made = quick(broker.where(), client_id, GetParam());
    made.subscriptions = subscriptions;
    return made;
  }
};

INSTANTIATE_TEST_SUITE_P(Versions, Mqtt, testing::Values(Version::v5, Version::v3_1_1), [](const auto& version) {
  return std::string(version.param == Version::v5 ? "V5" : "V3_1_1");
});

std::function<std::optional<Will>(const Story&)> will_of(const std::string& topic) {
  return [topic](const Story& story) {
    const auto attempts = std::ranges::count(story.order, "connecting");
    return Will{topic, bytes("attempt " + std::to_string(attempts)), Qos::at_least_once, false};
  };
}

}  // namespace

TEST_P(Mqtt, SubscribesBeforeItTellsAndHearsWhatIsPublished) {
  NEEDS_BROKER();
  const Broker broker;
  Station station(options(broker, "one", {"a/+", "b/#"}));
  ASSERT_TRUE(station.heard.until(is_up));
  EXPECT_EQ(station.heard.story().connected[0].version, GetParam());
  EXPECT_FALSE(station.heard.story().connected[0].session_present);
  EXPECT_TRUE(station.heard.story().connected[0].refused.empty());
  const auto first = station.publish("a/x", "at most once", Qos::at_most_once);
  const auto second = station.publish("b/y/z", std::string("with\0NUL", 8), Qos::at_least_once);
  ASSERT_TRUE(first && second);
  ASSERT_TRUE(station.heard.until([](const Story& s) { return s.messages.size() == 2 && s.published.size() == 2; }));
  const auto story = station.heard.story();
  EXPECT_EQ(story.messages[0].topic, "a/x");
  EXPECT_EQ(story.messages[0].payload, "at most once");
  EXPECT_EQ(story.messages[1].topic, "b/y/z");
  EXPECT_EQ(story.messages[1].payload, std::string("with\0NUL", 8));
  EXPECT_FALSE(story.messages[0].retained);
  EXPECT_EQ(story.published, (std::vector{*first, *second}));
  EXPECT_EQ(station.client->counts().waiting, 0U);
}

TEST_P(Mqtt, WhatIsRetainedComesBehindConnected) {
  NEEDS_BROKER();
  const Broker broker;
  Station writer(options(broker, "writer"));
  ASSERT_TRUE(writer.heard.until(is_up));
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(writer.publish("kept/" + std::to_string(i), "v", Qos::at_least_once, true));
  ASSERT_TRUE(writer.heard.until([](const Story& s) { return s.published.size() == 20; }));
  Station reader(options(broker, "reader", {"kept/#"}));
  ASSERT_TRUE(reader.heard.until([](const Story& s) { return s.messages.size() == 20; }));
  const auto story = reader.heard.story();
  EXPECT_EQ(story.order[1], "connected");
  EXPECT_TRUE(std::ranges::all_of(story.messages, &test::Arrived::retained));
}

TEST_P(Mqtt, AnEmptyPayloadRemovesWhatIsRetained) {
  NEEDS_BROKER();
  const Broker broker;
  Station writer(options(broker, "writer"));
  ASSERT_TRUE(writer.heard.until(is_up));
  ASSERT_TRUE(writer.publish("kept", "v", Qos::at_least_once, true));
  ASSERT_TRUE(writer.publish("kept", "", Qos::at_least_once, true));
  ASSERT_TRUE(writer.publish("last", "v", Qos::at_least_once, true));
  ASSERT_TRUE(writer.heard.until([](const Story& s) { return s.published.size() == 3; }));
  Station reader(options(broker, "reader", {"#"}));
  ASSERT_TRUE(reader.heard.until([](const Story& s) { return s.has("last"); }));
  EXPECT_FALSE(reader.heard.story().has("kept"));
}

// The will of each connection is the one that was asked for before it.
TEST_P(Mqtt, TheWillOfAKilledProcessIsThatOfItsLastConnection) {
  NEEDS_BROKER();
  Broker broker;
  test::Process victim(::fork());
  if (!victim.is_running()) {  // the child: it has no such child itself
    Station station(options(broker, "victim"), will_of("will"));
    for (;;) ::pause();
  }
}

}  // namespace berth::mqtt
