// What a client says and stands, byte by byte, against a server of the test that is no broker.
#include <gtest/gtest.h>

#include <thread>

#include "../pch.hpp"
#include "heard.hpp"
#include "raw_broker.hpp"

namespace berth::mqtt {
namespace {

using namespace std::chrono_literals;
using test::bytes;
using test::is_up;
using test::quick;
using test::RawBroker;
using test::Station;
using test::Story;
using std::string_view_literals::operator""sv;

std::string u16(std::size_t value) { return {static_cast<char>(value >> 8U), static_cast<char>(value)}; }
std::string text(std::string_view words) { return u16(words.size()) + std::string(words); }

// A PUBLISH of QoS 0, as MQTT 5 has it (one more byte: no properties) or 3.1.1.
std::string publish(std::string_view topic, std::string_view payload, bool v5) {
  std::string body = text(topic);
  if (v5) body += '\0';
  body += payload;
  return std::string("\x30") + static_cast<char>(body.size()) + body;
}

// The answer to the SUBSCRIBE `asked`, with these codes.
std::string suback(const test::Packet& asked, std::string_view codes, bool v5) {
  std::string body = asked.body.substr(0, 2);
  if (v5) body += '\0';
  body += codes;
  return std::string("\x90") + static_cast<char>(body.size()) + body;
}

class Wire : public testing::TestWithParam<Version> {
 protected:
  [[nodiscard]] static bool v5() { return GetParam() == Version::v5; }
  [[nodiscard]] static std::string_view connack() { return v5() ? test::connack_5 : test::connack_3; }
};

INSTANTIATE_TEST_SUITE_P(Versions, Wire, testing::Values(Version::v5, Version::v3_1_1), [](const auto& version) {
  return std::string(version.param == Version::v5 ? "V5" : "V3_1_1");
});

}  // namespace

// MQTT 5.0 §3.1: clean start, the will with its QoS and retain, no session expiry (absent is 0), Maximum Packet Size.
TEST(WireConnect, AClientOfMqtt5SaysWhatItTakes) {
  const RawBroker broker;
  test::Folder folder;
  auto options = quick(broker.where(), "line-3", Version::v5);
  options.login_file = folder.write("login", "user\r\npass word\n");
  options.keep_alive = 300s;
  options.limits.incoming = 0x12345;
  Station station(options, [](const Story&) { return Will{"w", bytes("gone"), Qos::at_least_once, true}; });
  const auto client = broker.accept();
  const auto asked = client.packet();
  ASSERT_TRUE(asked);
  EXPECT_EQ(asked->type, 0x10);
  EXPECT_EQ(asked->body.substr(0, 10), text("MQTT") + "\x05" + "\xEE" + u16(300));
  EXPECT_EQ(asked->body[10], 8) << "bytes of properties";
  const auto listed = asked->body.substr(11, 8);
  EXPECT_NE(listed.find("\x27\x00\x01\x23\x45"sv), std::string::npos) << "Maximum Packet Size";
  EXPECT_NE(listed.find("\x21\x00\x14"sv), std::string::npos) << "Receive Maximum";
  EXPECT_EQ(asked->body.substr(19),
            text("line-3") + '\0' + text("w") + text("gone") + text("user") + text("pass word"));
}

// MQTT 3.1.1 §3.1: clean session.
TEST(WireConnect, AClientOfMqtt311AsksForACleanSession) {
  const RawBroker broker;
  Station station(quick(broker.where(), "line-3", Version::v3_1_1));
  const auto client = broker.accept();
  const auto asked = client.packet();
  ASSERT_TRUE(asked);
  EXPECT_EQ(asked->body, text("MQTT") + "\x04" + "\x02" + u16(30) + text("line-3"));
}

TEST_P(Wire, NothingIsToldOrPublishedBeforeTheAnswerToTheSubscriptions) {
  const RawBroker broker;
  auto options = quick(broker.where(), "one", GetParam());
  options.subscriptions = {"command/#", "state"};
  Station station(options);
  const auto client = broker.accept();
  ASSERT_TRUE(client.packet());
  client.say(connack());
  const auto asked = client.packet();
  ASSERT_TRUE(asked);
  EXPECT_EQ(asked->kind(), test::subscribe_packet);
  const std::string behind_id = asked->body.substr(v5() ? 3 : 2);
  EXPECT_EQ(behind_id, text("command/#") + '\x01' + text("state") + '\x01');
  client.say(publish("state", "early", v5()));
  EXPECT_EQ(station.client->publish({.connection = 1, .topic = "birth"}).error(), Refusal::not_connected);
  EXPECT_EQ(station.heard.story().order, std::vector<std::string>{"connecting"});
  client.say(suback(*asked, "\x01\x01", v5()) + publish("state", "late", v5()));
  ASSERT_TRUE(station.heard.until([](const Story& s) { return s.messages.size() == 2; }));
  EXPECT_EQ(station.heard.story().order,
            (std::vector<std::string>{"connecting", "connected", "message state", "message state"}));
  EXPECT_EQ(station.heard.story().messages[0].payload, "early");
}

TEST_P(Wire, ARefusedSubscriptionIsTold) {
  const RawBroker broker;
  auto options = quick(broker.where(), "one", GetParam());
  options.subscriptions = {"open", "closed"};
  Station station(options);
  const auto client = broker.accept();
  ASSERT_TRUE(client.packet());
  client.say(connack());
  const auto asked = client.packet();
  ASSERT_TRUE(asked);
  client.say(suback(*asked, v5() ? "\x01\x87" : "\x01\x80", v5()));
  ASSERT_TRUE(station.heard.until(is_up));
  const auto connected = station.heard.story().connected[0];
  ASSERT_EQ(connected.refused.size(), 1U);
  EXPECT_EQ(connected.refused[0].filter, "closed");
  EXPECT_EQ(connected.refused[0].words, of_reason_code(v5() ? 135 : 128).words);
}

// A broker of 3.1.1 refuses MQTT 5 with its own CONNACK and closes (3.1.1 §3.1.2.2).
TEST(WireVersion, RefusedMqtt5IsFollowedByMqtt311AtOnce) {
  const RawBroker broker;
  auto options = quick(broker.where(), "one", Version::automatic);
  options.pauses = {.first = 3'600'000ms, .longest = 3'600'000ms};
  Station station(options);
  {
    const auto first = broker.accept();
    const auto asked = first.packet();
    ASSERT_TRUE(asked);
    EXPECT_EQ(asked->body[6], 5);
    first.say("\x20\x02\x00\x01"sv);
  }
  const auto second = broker.accept();
  const auto asked = second.packet();
  ASSERT_TRUE(asked);
  EXPECT_EQ(asked->body[6], 4);
  second.say(test::connack_3);
  ASSERT_TRUE(station.heard.until(is_up));
  const auto story = station.heard.story();
  EXPECT_EQ(story.connected[0].version, Version::v3_1_1);
  ASSERT_EQ(story.disconnected.size(), 1U);
  EXPECT_EQ(story.disconnected[0].why, Why::version_refused);
  EXPECT_EQ(story.disconnected[0].retry_in, 0ms);
}

TEST(WireVersion, ABrokerThatOnlyClosesIsAskedByTheOtherVersionInItsTurn) {
  const RawBroker broker;
  Station station(quick(broker.where(), "one", Version::automatic));
  for (const int wanted : {5, 4, 5, 4}) {
    const auto client = broker.accept();
    const auto asked = client.packet();
    ASSERT_TRUE(asked);
    EXPECT_EQ(asked->body[6], wanted);
  }
  const auto last = broker.accept();
  ASSERT_TRUE(last.packet());
  const auto story = station.heard.story();
  EXPECT_EQ(story.disconnected[0].why, Why::closed);
  EXPECT_NE(story.disconnected[0].words.find("closed the connection before it answered"), std::string::npos)
      << story.disconnected[0].words;
}

TEST(WireVersion, AChosenVersionIsKept) {
  const RawBroker broker;
  Station station(quick(broker.where(), "one", Version::v5));
  for (int i = 0; i < 3; ++i) {
    const auto client = broker.accept();
    const auto asked = client.packet();
    ASSERT_TRUE(asked);
    EXPECT_EQ(asked->body[6], 5);
    client.say("\x20\x03\x00\x84\x00"sv);
  }
  ASSERT_TRUE(station.heard.until([](const Story& s) { return s.disconnected.size() >= 2; }));
  EXPECT_EQ(station.heard.story().disconnected[1].why, Why::version_refused);
}

// Reason codes of CONNACK, as brokers send them.
TEST(WireReasons, OfARefusal) {
  struct Case {
    Version version;
    std::string connack;
    Why why;
  };
  using namespace std::string_literals;
  for (const auto& [version, connack, why] : {Case{Version::v3_1_1, "\x20\x02\x00\x01"s, Why::version_refused},
                                              Case{Version::v3_1_1, "\x20\x02\x00\x02"s, Why::client_id_refused},
                                              Case{Version::v3_1_1, "\x20\x02\x00\x03"s, Why::unavailable},
                                              Case{Version::v3_1_1, "\x20\x02\x00\x04"s, Why::bad_login},
                                              Case{Version::v3_1_1, "\x20\x02\x00\x05"s, Why::not_authorised},
                                              Case{Version::v5, "\x20\x03\x00\x85\x00"s, Why::client_id_refused},
                                              Case{Version::v5, "\x20\x03\x00\x86\x00"s, Why::bad_login},
                                              Case{Version::v5, "\x20\x03\x00\x87\x00"s, Why::not_authorised},
                                              Case{Version::v5, "\x20\x03\x00\x89\x00"s, Why::unavailable},
                                              Case{Version::v5, "\x20\x03\x00\x95\x00"s, Why::packet_too_large},
                                              Case{Version::v5, "\x20\x03\x00\xFE\x00"s, Why::refused_otherwise}}) {
    const RawBroker broker;
    Station station(quick(broker.where(), "one", version));
    const auto client = broker.accept();
    ASSERT_TRUE(client.packet());
    client.say(connack);
    ASSERT_TRUE(station.heard.until([](const Story& s) { return !s.disconnected.empty(); }));
    EXPECT_EQ(station.heard.story().disconnected[0].why, why) << station.heard.story().disconnected[0].words;
    EXPECT_FALSE(station.heard.story().disconnected[0].was_connected);
  }
}

// Reason codes of DISCONNECT (MQTT 5.0 §3.14.2.1).
TEST(WireReasons, OfAnEnd) {
  for (const auto& [code, why] :
       {std::pair(0x8B, Why::shutting_down), std::pair(0x8D, Why::keep_alive), std::pair(0x8E, Why::taken_over),
        std::pair(0x95, Why::packet_too_large), std::pair(0x87, Why::not_authorised)}) {
    const RawBroker broker;
    auto options = quick(broker.where(), "one", Version::v5);
    options.pauses = {.first = 1ms, .longest = 3'600'000ms, .good_after = 0ms};
    Station station(options);
    const auto client = broker.accept();
    ASSERT_TRUE(client.packet());
    client.say(test::connack_5);
    ASSERT_TRUE(station.heard.until(is_up));
    client.say(std::string("\xE0\x01") + static_cast<char>(code));
    ASSERT_TRUE(station.heard.until([](const Story& s) { return !s.disconnected.empty(); }));
    const auto told = station.heard.story().disconnected[0];
    EXPECT_EQ(told.why, why) << told.words;
    EXPECT_TRUE(told.was_connected);
    // Whoever has the session now keeps it.
    EXPECT_EQ(*told.retry_in >= 1'800'000ms, why == Why::taken_over);
  }
}

// The broker says why it ends the connection, and reads nothing of what is on its way to it.
TEST(WireReasons, IsHeardAlsoWhileMuchWaitsToBeSent) {
  const RawBroker broker;
  auto options = quick(broker.where(), "one", Version::v5);
  options.limits.outgoing_bytes = 100'000'000;
  Station station(options);
  {
    const auto client = broker.accept();
    ASSERT_TRUE(client.packet());
    client.say(test::connack_5);
    ASSERT_TRUE(station.heard.until(is_up));
    for (int i = 0; i < 40; ++i) ASSERT_TRUE(station.publish("a", std::string(1'000'000, 'x'), Qos::at_most_once));
    client.say("\xE0\x01\x97"sv);
    ASSERT_TRUE(station.heard.until([](const Story& s) { return !s.disconnected.empty(); }));
  }
  EXPECT_NE(station.heard.story().disconnected[0].words.find("a quota of the broker is used up"), std::string::npos)
      << station.heard.story().disconnected[0].words;
  EXPECT_EQ(station.heard.story().published.size() + station.heard.story().unpublished.size(), 40U);
}

TEST_P(Wire, WhatIsNotMqttIsSaidToBe) {
  const RawBroker broker;
  Station station(quick(broker.where(), "one", GetParam()));
  const auto client = broker.accept();
  ASSERT_TRUE(client.packet());
  client.say("HTTP/1.1 400 Bad Request\r\nConnection: close\r\n\r\n");
  EXPECT_TRUE(client.is_ended()) << "the client ends it";
  ASSERT_TRUE(station.heard.until([](const Story& s) { return !s.disconnected.empty(); }));
  EXPECT_EQ(station.heard.story().disconnected[0].why, Why::protocol) << station.heard.story().disconnected[0].words;
}

// Bytes without sense, at each stage of a connection: it ends, and the client lives and comes again.
TEST_P(Wire, GarbageEndsAConnectionAndNoMore) {
  const RawBroker broker;
  auto options = quick(broker.where(), "one", GetParam());
  options.subscriptions = {"a"};
  options.pauses = {.first = 1ms, .longest = 1ms, .good_after = 0ms};
  Station station(options);
  Random random(20261130);
  for (int round = 0; round < 150; ++round) {
    const auto client = broker.accept();
    ASSERT_TRUE(client.packet());
    if (round % 3 > 0) {
      client.say(connack());
      const auto asked = client.packet();
      ASSERT_TRUE(asked);
      if (round % 3 == 2) client.say(suback(*asked, "\x01", v5()));
    }
    std::string garbage(1 + random.below(300), '\0');
    for (char& c : garbage) c = static_cast<char>(random.below(256));
    client.say(garbage);
  }
  const auto client = broker.accept();
  ASSERT_TRUE(client.packet());
  client.say(connack());
  const auto asked = client.packet();
  ASSERT_TRUE(asked);
  client.say(suback(*asked, "\x01", v5()));
  EXPECT_TRUE(station.heard.until(is_up));
}

// A packet is announced with 256 MB, against what the broker was told: the connection ends at once.
TEST(WireLimit, APacketThatIsTooLargeEndsTheConnection) {
  const RawBroker broker;
  Station station(quick(broker.where(), "one", Version::v5));
  const auto client = broker.accept();
  ASSERT_TRUE(client.packet());
  client.say(test::connack_5);
  ASSERT_TRUE(station.heard.until(is_up));
  client.say("\x30\xFF\xFF\xFF\x7F"sv);
  EXPECT_TRUE(client.is_ended());
  ASSERT_TRUE(station.heard.until([](const Story& s) { return !s.disconnected.empty(); }));
  EXPECT_EQ(station.heard.story().disconnected[0].why, Why::packet_too_large);
}

// 500 answers to pings and 2 MB of small messages are no such packet.
TEST_P(Wire, ManyPacketsAreNotOneThatDoesNotEnd) {
  const RawBroker broker;
  auto options = quick(broker.where(), "one", GetParam());
  options.limits.incoming = 100'000;
  Station station(options);
  const auto client = broker.accept();
  ASSERT_TRUE(client.packet());
  client.say(connack());
  ASSERT_TRUE(station.heard.until(is_up));
  std::string many;
  for (int i = 0; i < 20'000; ++i) many += publish("a", std::string(100, 'x'), v5());
  for (int i = 0; i < 500; ++i) many += "\xD0\x00"sv;
  ASSERT_TRUE(client.say(many + publish("last", "", v5())));
  EXPECT_TRUE(station.heard.until([](const Story& s) { return s.has("last"); }));
  EXPECT_EQ(station.heard.story().messages.size(), 20'001U);
}

// DISCONNECT is the last packet, and the broker's end is waited for: a reset could take the last messages along.
TEST_P(Wire, AnEndInOrder) {
  const RawBroker broker;
  Station station(quick(broker.where(), "one", GetParam()));
  auto client = broker.accept();
  ASSERT_TRUE(client.packet());
  client.say(connack());
  ASSERT_TRUE(station.heard.until(is_up));
  ASSERT_TRUE(station.publish("last", "x", Qos::at_most_once));
  station.client->end(Parting::with_will);
  client.say(publish("meanwhile", "x", v5()));
  const auto published = client.packet();
  ASSERT_TRUE(published);
  EXPECT_EQ(published->kind(), test::publish_packet);
  const auto last = client.packet();
  ASSERT_TRUE(last);
  EXPECT_EQ(last->type, 0xE0);
  EXPECT_EQ(last->body, v5() ? "\x04" : "");
  EXPECT_FALSE(client.hear(1)) << "nothing follows";
  // What a broker still says does not come to a closed door: that would reset the connection.
  for (int i = 0; i < 20; ++i) {
    EXPECT_TRUE(client.say(publish("afterwards", "x", v5())));
    std::this_thread::sleep_for(5ms);
  }
  EXPECT_FALSE(station.client->has_ended());
  client.close();
  ASSERT_TRUE(station.heard.until([](const Story& s) { return !s.disconnected.empty(); }));
  EXPECT_EQ(station.heard.story().disconnected[0].why, Why::ended);
}

// The broker's Receive Maximum (MQTT 5.0 §3.2.2.3.3) holds, and each acknowledgement makes room for one more.
TEST(WireWindow, NoMoreThanTheBrokerAllowsIsUnacknowledged) {
  const RawBroker broker;
  Station station(quick(broker.where(), "one", Version::v5));
  const auto client = broker.accept();
  ASSERT_TRUE(client.packet());
  client.say("\x20\x06\x00\x00\x03\x21\x00\x02"sv);
  ASSERT_TRUE(station.heard.until(is_up));
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(station.publish("a", std::to_string(i)));
  std::vector<std::string> ids;
  for (int i = 0; i < 2; ++i) {
    const auto packet = client.packet();
    ASSERT_TRUE(packet);
    ids.push_back(packet->body.substr(3, 2));
  }
  for (int i = 2; i < 5; ++i) {
    EXPECT_EQ(station.client->counts().waiting, 7U - static_cast<unsigned>(i));
    client.say("\x40\x02" + ids[static_cast<std::size_t>(i) - 2]);
    const auto packet = client.packet();
    ASSERT_TRUE(packet);
    EXPECT_EQ(packet->body.substr(6), std::to_string(i));
    ids.push_back(packet->body.substr(3, 2));
  }
}

// What was not acknowledged is handed back, and is not sent again on the next connection.
TEST_P(Wire, NothingOfAnOldConnectionIsSentOnANewOne) {
  const RawBroker broker;
  Station station(quick(broker.where(), "one", GetParam()));
  {
    const auto client = broker.accept();
    ASSERT_TRUE(client.packet());
    client.say(connack());
    ASSERT_TRUE(station.heard.until(is_up));
    ASSERT_TRUE(station.publish("old", "x"));
    ASSERT_TRUE(client.packet());
  }
  const auto client = broker.accept();
  ASSERT_TRUE(client.packet());
  client.say(connack());
  ASSERT_TRUE(station.heard.until([](const Story& s) { return s.connected.size() == 2; }));
  EXPECT_EQ(station.heard.story().unpublished.size(), 1U);
  ASSERT_TRUE(station.publish("new", "x"));
  const auto packet = client.packet();
  ASSERT_TRUE(packet);
  EXPECT_EQ(packet->body.substr(0, 5), text("new"));
}

}  // namespace berth::mqtt
