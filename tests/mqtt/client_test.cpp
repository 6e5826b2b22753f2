// A client against Debian's Mosquitto, by both versions of MQTT.
#include "berth/mqtt/client.hpp"

#include <gtest/gtest.h>

#include <sys/prctl.h>

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

// The will of each connection is the one that was asked for before it: a connection whose process is killed leaves the
// second attempt's.
TEST_P(Mqtt, TheWillOfAKilledProcessIsThatOfItsLastConnection) {
  NEEDS_BROKER();
  Broker broker;
  const pid_t child = ::fork();
  if (child == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    Station station(options(broker, "victim"), will_of("will"));
    if (!station.heard.until(is_up) || !station.publish("here", "1", Qos::at_least_once, true)) ::_exit(1);
    if (!station.heard.until([](const Story& s) { return s.connected.size() == 2; })) ::_exit(1);
    static_cast<void>(station.publish("here", "2", Qos::at_least_once, true));
    for (;;) ::pause();
  }
  test::Process victim(child);
  Station watcher(options(broker, "watcher", {"will", "here"}));
  ASSERT_TRUE(watcher.heard.until([](const Story& s) { return s.has("here"); }));
  broker.kill();
  broker.start();
  ASSERT_TRUE(watcher.heard.until([](const Story& s) { return s.messages.back().payload == "2"; }));
  victim.end(SIGKILL);
  ASSERT_TRUE(watcher.heard.until([](const Story& s) { return s.has("will"); }));
  const auto story = watcher.heard.story();
  const auto will = std::ranges::find(story.messages, "will", &test::Arrived::topic);
  EXPECT_EQ(will->payload, "attempt 2");
}

TEST_P(Mqtt, ARestartedBrokerIsFoundAgain) {
  NEEDS_BROKER();
  Broker broker;
  Station station(options(broker, "one", {"a"}), will_of("will"));
  ASSERT_TRUE(station.heard.until(is_up));
  const auto first = station.heard.number();
  broker.kill();
  ASSERT_TRUE(station.heard.until([](const Story& s) { return s.disconnected.size() >= 3; }));
  EXPECT_EQ(station.client->publish({.connection = first, .topic = "a"}).error(), Refusal::not_connected);
  broker.start();
  ASSERT_TRUE(station.heard.until(is_up));
  EXPECT_EQ(station.heard.number(), first + 1);
  EXPECT_EQ(station.client->publish({.connection = first, .topic = "a"}).error(), Refusal::not_connected);
  ASSERT_TRUE(station.publish("a", "again"));
  ASSERT_TRUE(station.heard.until([](const Story& s) { return s.has("a"); }));
  const auto story = station.heard.story();
  EXPECT_TRUE(story.disconnected[0].was_connected);
  EXPECT_EQ(story.disconnected[0].why, Why::closed);
  EXPECT_EQ(story.disconnected[1].why, Why::refused);
  EXPECT_FALSE(story.disconnected[1].was_connected);
  ASSERT_TRUE(story.disconnected[1].retry_in);
  EXPECT_GT(story.disconnected[1].retry_in->count(), 0);
  EXPECT_EQ(
      story.disconnected[1].words,
      to_string(broker.where()) + ": nothing listens at this port: look whether the broker runs, and at its port");
}

// What is accepted ends as published or unpublished, once; what has no room is counted by its need; the caller never
// waits; room is left for what must be sent.
TEST_P(Mqtt, ABrokerThatStopsReadingFillsTheQueueAndIsGivenUp) {
  NEEDS_BROKER();
  Broker broker;
  auto chosen = options(broker, "one");
  chosen.keep_alive = 5s;
  Station station(chosen);
  ASSERT_TRUE(station.heard.until(is_up));
  broker.freeze();
  std::vector<MessageId> accepted;
  const auto fill = [&](Need need) {
    // What the system has room for, some megabytes, is published; then nothing is for a while.
    for (int refused = 0; refused < 30;) {
      const auto id = station.client->publish({.connection = 1,
                                               .topic = "a",
                                               .payload = std::vector<std::uint8_t>(50'000),
                                               .qos = Qos::at_most_once,
                                               .need = need});
      if (id) accepted.push_back(*id);
      if (!id && id.error() == Refusal::not_connected) return;
      refused = id ? 0 : refused + 1;
      if (!id) std::this_thread::sleep_for(10ms);
    }
  };
  fill(Need::may);
  const auto without_must = station.client->counts();
  EXPECT_GE(without_must.no_room_may, 30U);
  EXPECT_EQ(without_must.no_room_must, 0U);
  EXPECT_LE(without_must.waiting_bytes, chosen.limits.outgoing_bytes / 4 * 3);
  fill(Need::must);
  const auto full = station.client->counts();
  EXPECT_GE(full.no_room_must, 30U);
  EXPECT_GT(full.waiting_bytes, chosen.limits.outgoing_bytes / 4 * 3);
  EXPECT_LE(full.waiting_bytes, chosen.limits.outgoing_bytes);
  ASSERT_TRUE(station.heard.until([](const Story& s) { return !s.disconnected.empty(); }));
  const auto story = station.heard.story();
  EXPECT_EQ(story.disconnected[0].why, Why::keep_alive);
  EXPECT_EQ(story.published.size() + story.unpublished.size(), accepted.size());
  EXPECT_GT(story.unpublished.size(), 0U);
  for (const auto id : story.published) EXPECT_FALSE(story.unpublished.contains(id));
  EXPECT_EQ(station.client->counts().accepted, accepted.size());
  EXPECT_EQ(station.client->counts().waiting, 0U);
  EXPECT_EQ(station.client->counts().waiting_bytes, 0U);
  broker.thaw();
  EXPECT_TRUE(station.heard.until(is_up));
}

TEST_P(Mqtt, ABrokerThatHangsFromTheBeginningIsGivenUp) {
  NEEDS_BROKER();
  Broker broker;
  broker.freeze();
  auto chosen = options(broker, "one");
  chosen.answer_within = 200ms;
  Station station(chosen);
  ASSERT_TRUE(station.heard.until([](const Story& s) { return s.disconnected.size() == 2; }));
  const auto told = station.heard.story().disconnected[0];
  EXPECT_EQ(told.why, Why::no_answer);
  EXPECT_NE(told.words.find("did not answer within 0.2 s"), std::string::npos) << told.words;
  EXPECT_FALSE(told.was_connected);
  broker.thaw();
}

// While the clients' thread is in a call of the handler, the publishing thread goes on.
TEST_P(Mqtt, PublishingDoesNotWaitForTheClientsThread) {
  NEEDS_BROKER();
  const Broker broker;
  struct Slow : test::Heard {
    std::binary_semaphore entered{0}, go{0};
    void message(std::string_view topic, std::span<const std::uint8_t> payload, bool retained) noexcept override {
      entered.release();
      go.acquire();
      test::Heard::message(topic, payload, retained);
    }
  } slow;
  const auto thread = test::thread();
  const auto client = Client::start(*thread, options(broker, "slow", {"in"}), Random(1), slow).value();
  ASSERT_TRUE(slow.until(is_up));
  ASSERT_TRUE(client->publish({.connection = 1, .topic = "in", .qos = Qos::at_most_once}));
  slow.entered.acquire();
  unsigned accepted = 1;
  for (;; ++accepted) {
    const auto id = client->publish({.connection = 1, .topic = "out", .qos = Qos::at_most_once});
    if (!id) {
      EXPECT_EQ(id.error(), Refusal::no_room);
      break;
    }
  }
  EXPECT_GE(accepted, Limits{}.outgoing_messages);
  slow.go.release();
  EXPECT_TRUE(slow.until([&](const Story& s) { return s.published.size() == accepted; }));
}

TEST_P(Mqtt, TheOrderOfMessagesIsKept) {
  NEEDS_BROKER();
  const Broker broker;
  auto chosen = options(broker, "one", {"n"});
  chosen.limits.unacknowledged = 2;
  Station station(chosen);
  ASSERT_TRUE(station.heard.until(is_up));
  constexpr int count = 300;
  for (int i = 0; i < count; ++i)
    ASSERT_TRUE(station.publish("n", std::to_string(i), i % 3 == 0 ? Qos::at_least_once : Qos::at_most_once));
  ASSERT_TRUE(
      station.heard.until([](const Story& s) { return s.messages.size() == count && s.published.size() == count; }));
  const auto story = station.heard.story();
  for (int i = 0; i < count; ++i) EXPECT_EQ(story.messages[static_cast<std::size_t>(i)].payload, std::to_string(i));
}

// All that was accepted is out before DISCONNECT, and the broker drops the will.
TEST_P(Mqtt, AClientThatEndsSendsWhatWaitsAndLeavesNoWill) {
  NEEDS_BROKER();
  const Broker broker;
  Station watcher(options(broker, "watcher", {"last/#", "will"}));
  ASSERT_TRUE(watcher.heard.until(is_up));
  constexpr std::size_t count = 200;
  {
    Station leaver(options(broker, "leaver", {"last/#"}), will_of("will"));
    ASSERT_TRUE(leaver.heard.until(is_up));
    for (std::size_t i = 0; i < count; ++i)
      ASSERT_TRUE(
          leaver.publish("last/" + std::to_string(i), "x", i % 2 == 0 ? Qos::at_most_once : Qos::at_least_once));
    leaver.client->end(Parting::without_will);
    EXPECT_FALSE(leaver.publish("last/late", "x"));
    ASSERT_TRUE(leaver.heard.until([](const Story& s) { return !s.disconnected.empty(); }));
    const auto story = leaver.heard.story();
    EXPECT_EQ(story.published.size(), count);
    EXPECT_TRUE(story.unpublished.empty());
    EXPECT_EQ(story.disconnected[0].why, Why::ended);
    EXPECT_FALSE(story.disconnected[0].retry_in);
    EXPECT_NE(story.disconnected[0].words.find("this client ended the connection"), std::string::npos);
  }
  ASSERT_TRUE(watcher.heard.until([&](const Story& s) { return s.messages.size() == count; }));
  ASSERT_TRUE(watcher.publish("last/mark", "x"));
  ASSERT_TRUE(watcher.heard.until([](const Story& s) { return s.has("last/mark"); }));
  EXPECT_FALSE(watcher.heard.story().has("will"));
}

TEST_P(Mqtt, DestroyedWithoutAWordItEndsInOrder) {
  NEEDS_BROKER();
  const Broker broker;
  Station watcher(options(broker, "watcher", {"#"}));
  ASSERT_TRUE(watcher.heard.until(is_up));
  {
    Station leaver(options(broker, "leaver"), will_of("will"));
    ASSERT_TRUE(leaver.heard.until(is_up));
    ASSERT_TRUE(leaver.publish("last", "x", Qos::at_most_once));
  }
  ASSERT_TRUE(watcher.heard.until([](const Story& s) { return s.has("last"); }));
  ASSERT_TRUE(watcher.publish("mark", "x"));
  ASSERT_TRUE(watcher.heard.until([](const Story& s) { return s.has("mark"); }));
  EXPECT_FALSE(watcher.heard.story().has("will"));
}

TEST_P(Mqtt, AClientMayEndWithItsWill) {
  NEEDS_BROKER();
  const Broker broker;
  Station watcher(options(broker, "watcher", {"will", "mark"}));
  ASSERT_TRUE(watcher.heard.until(is_up));
  Station leaver(options(broker, "leaver"), will_of("will"));
  ASSERT_TRUE(leaver.heard.until(is_up));
  leaver.client->end(Parting::with_will);
  ASSERT_TRUE(leaver.heard.until([](const Story& s) { return !s.disconnected.empty(); }));
  if (GetParam() == Version::v5) {
    EXPECT_TRUE(watcher.heard.until([](const Story& s) { return s.has("will"); }));
  } else {
    ASSERT_TRUE(watcher.publish("mark", "x"));
    ASSERT_TRUE(watcher.heard.until([](const Story& s) { return s.has("mark"); }));
    EXPECT_FALSE(watcher.heard.story().has("will"));
  }
}

// The broker does not take what waits: the destructor comes back, and all of it was handed back.
TEST_P(Mqtt, EndingWaitsNoLongerThanTheFarewell) {
  NEEDS_BROKER();
  Broker broker;
  auto chosen = options(broker, "one");
  chosen.farewell = 100ms;
  Station station(chosen);
  ASSERT_TRUE(station.heard.until(is_up));
  broker.freeze();
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(station.publish("a", "x"));
  station.client.reset();
  const auto story = station.heard.story();
  EXPECT_EQ(story.unpublished.size(), 10U);
  ASSERT_EQ(story.disconnected.size(), 1U);
  EXPECT_EQ(story.disconnected[0].why, Why::ended);
  EXPECT_EQ(story.order.back(), "disconnected");
  broker.thaw();
}

TEST_P(Mqtt, AHandlerMayPublishAndEnd) {
  NEEDS_BROKER();
  const Broker broker;
  struct Quick : test::Heard {
    Client* client = nullptr;
    std::binary_semaphore known{0};
    void connected(const Connected& told) noexcept override {
      known.acquire();
      for (int i = 0; i < 3; ++i)
        EXPECT_TRUE(client->publish({.connection = told.connection, .topic = "birth", .qos = Qos::at_least_once}));
      client->end(Parting::without_will);
      EXPECT_FALSE(client->publish({.connection = told.connection, .topic = "birth"}));
      test::Heard::connected(told);
    }
  } quick_handler;
  const auto thread = test::thread();
  const auto client = Client::start(*thread, options(broker, "quick"), Random(1), quick_handler).value();
  quick_handler.client = client.get();
  quick_handler.known.release();
  ASSERT_TRUE(quick_handler.until([](const Story& s) { return !s.disconnected.empty(); }));
  EXPECT_EQ(quick_handler.story().published.size(), 3U);
  EXPECT_TRUE(quick_handler.story().unpublished.empty());
}

// Mosquitto 2.0 closes the older connection without a word, also by MQTT 5. The two take the session from each other,
// but less and less often.
TEST_P(Mqtt, TwoClientsWithOneClientIdSlowDown) {
  NEEDS_BROKER();
  const Broker broker;
  auto chosen = options(broker, "twin");
  chosen.pauses = {.first = 20ms, .longest = 3'600'000ms, .good_after = 3'600'000ms};
  Station first(chosen);
  ASSERT_TRUE(first.heard.until(is_up));
  Station second(chosen);
  ASSERT_TRUE(first.heard.until([](const Story& s) { return s.disconnected.size() >= 3; }));
  const auto told = first.heard.story().disconnected;
  EXPECT_EQ(told[0].why, Why::closed);
  EXPECT_NE(told[0].words.find("client-ID"), std::string::npos) << told[0].words;
  EXPECT_LE(*told[0].retry_in, 20ms);
  EXPECT_GE(*told[1].retry_in, 20ms);
  EXPECT_GE(*told[2].retry_in, 40ms);
}

TEST_P(Mqtt, AWrongPasswordIsSaid) {
  NEEDS_BROKER();
  test::Folder folder;
  ASSERT_EQ(test::run({"mosquitto_passwd", "-H", "sha512", "-c", "-b", folder.file("users"), "line-3", "secret"},
                      folder.file("log")),
            0)
      << folder.read("log");
  const Broker broker("allow_anonymous false\npassword_file " + folder.file("users"));
  auto chosen = options(broker, "one", {"a"});
  chosen.login_file = folder.write("login", "line-3\nwrong\n");
  Station station(chosen);
  ASSERT_TRUE(station.heard.until([](const Story& s) { return !s.disconnected.empty(); }));
  const auto told = station.heard.story().disconnected[0];
  EXPECT_TRUE(told.why == Why::not_authorised || told.why == Why::bad_login) << told.words;
  EXPECT_EQ(told.words.find("wrong\n"), std::string::npos);
  // The file is read again before each attempt.
  folder.write("login", "line-3\nsecret\n");
  ASSERT_TRUE(station.heard.until(is_up));
  // Nobody else's business: an open file is refused, at the start and later.
  folder.write("login", "line-3\nsecret\n", 0640);
  const auto refused = Client::start(*test::thread(), chosen, Random(1), station.heard);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error(),
            folder.file("login") + ": other users can read the password in it: chmod 600 " + folder.file("login"));
}

TEST_P(Mqtt, WhatTheRightsForbidIsSaid) {
  NEEDS_BROKER();
  test::Folder folder;
  const auto acl = folder.write("acl", "topic readwrite open/#\n", 0644);
  const Broker broker("acl_file " + acl);
  Station station(options(broker, "one"));
  ASSERT_TRUE(station.heard.until(is_up));
  const auto good = station.publish("open/a", "x");
  const auto bad = station.publish("closed/a", "x");
  ASSERT_TRUE(good && bad);
  ASSERT_TRUE(station.heard.until([](const Story& s) { return s.published.size() + s.unpublished.size() == 2; }));
  const auto story = station.heard.story();
  if (GetParam() == Version::v5) {
    EXPECT_EQ(story.published, std::vector{*good});
    EXPECT_EQ(story.unpublished.at(*bad), of_reason_code(135).words);
  } else {
    EXPECT_EQ(story.published, (std::vector{*good, *bad})) << "3.1.1 acknowledges what it drops";
  }
}

// By MQTT 5 the broker knows the limit, and does not send what is larger. By 3.1.1 it is dropped here, and
// acknowledged: the broker would stop after twenty that were not.
TEST_P(Mqtt, AMessageThatIsTooLargeToTakeIsDroppedAndCounted) {
  NEEDS_BROKER();
  const Broker broker;
  Station writer(options(broker, "writer"));
  auto chosen = options(broker, "reader", {"#"});
  chosen.limits.incoming = 2'000;
  Station reader(chosen);
  ASSERT_TRUE(writer.heard.until(is_up) && reader.heard.until(is_up));
  // Mosquitto 2.0 counts what it does not send as on its way, and stops after twenty.
  const int acknowledged = GetParam() == Version::v5 ? 10 : 25;
  for (int i = 0; i < 5 + acknowledged; ++i)
    ASSERT_TRUE(writer.publish("large", std::string(20'000, 'x'), i < 5 ? Qos::at_most_once : Qos::at_least_once));
  ASSERT_TRUE(writer.publish("small", std::string(1'900, 'x')));
  ASSERT_TRUE(reader.heard.until([](const Story& s) { return s.has("small"); }));
  EXPECT_FALSE(reader.heard.story().has("large"));
  EXPECT_TRUE(reader.heard.story().disconnected.empty());
  EXPECT_EQ(reader.client->counts().incoming_dropped, GetParam() == Version::v5 ? 0U : 30U);
}

TEST(MqttLargest, WhatIsTooLargeForTheBrokerIsRefused) {
  NEEDS_BROKER();
  const Broker broker("max_packet_size 1000");
  Station station(quick(broker.where(), "one", Version::v5));
  ASSERT_TRUE(station.heard.until(is_up));
  EXPECT_EQ(station.publish("a", std::string(1'000, 'x')).error(), Refusal::too_large);
  ASSERT_TRUE(station.publish("a", std::string(900, 'x')));
  ASSERT_TRUE(station.heard.until([](const Story& s) { return s.published.size() == 1; }));
  EXPECT_EQ(station.heard.story().disconnected.size(), 0U);
}

TEST(MqttRefused, TopicsThatAreNone) {
  NEEDS_BROKER();
  const Broker broker;
  Station station(quick(broker.where(), "one"));
  EXPECT_EQ(station.client->publish({.connection = 0, .topic = "a"}).error(), Refusal::not_connected);
  ASSERT_TRUE(station.heard.until(is_up));
  for (const std::string& topic :
       {std::string(), std::string("a/+"), std::string("#"), std::string("a\0b", 3), std::string(65'536, 'a')})
    EXPECT_EQ(station.publish(topic, "x").error(), Refusal::wrong_topic);
  const auto not_utf8 = station.publish("\xFF", "x");
  ASSERT_TRUE(not_utf8);
  ASSERT_TRUE(station.heard.until([](const Story& s) { return s.unpublished.size() == 1; }));
  EXPECT_TRUE(station.heard.story().unpublished.contains(*not_utf8));
  ASSERT_TRUE(station.publish("a", "x"));
  EXPECT_TRUE(station.heard.until([](const Story& s) { return s.published.size() == 1; }));
}

// libmosquitto turns SIGPIPE off for the whole process; whether it is on is the program's business.
TEST(MqttProcess, SignalsAreThoseOfTheProgram) {
  NEEDS_BROKER();
  const Broker broker;
  struct sigaction before {};
  ASSERT_EQ(::sigaction(SIGPIPE, nullptr, &before), 0);
  ASSERT_EQ(before.sa_handler, SIG_DFL);
  Station station(quick(broker.where(), "one"));
  ASSERT_TRUE(station.heard.until(is_up));
  struct sigaction after {};
  ASSERT_EQ(::sigaction(SIGPIPE, nullptr, &after), 0);
  EXPECT_EQ(after.sa_handler, SIG_DFL);
}

}  // namespace berth::mqtt
