// A thousand clients on one thread, against one Mosquitto; and names that are looked up.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <atomic>
#include <fstream>
#include <thread>

#include "../pch.hpp"
#include "heard.hpp"

namespace berth::mqtt {
namespace {

using namespace std::chrono_literals;
using test::Broker;
using test::is_up;
using test::quick;
using test::Station;
using test::Story;

constexpr std::size_t many = 1'000;

// Five descriptors for each client, and as many again for Mosquitto, which this process starts.
bool raise_limit() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return false;
  limit.rlim_cur = limit.rlim_max;
  return ::setrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur >= 6 * many;
}

std::size_t resident_kib() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmRSS:")) return std::stoul(line.substr(6));
  }
  return 0;
}

// Counts, for a thousand clients at once.
struct Crowd {
  std::atomic<std::size_t> up{0}, published{0}, unpublished{0}, heard{0};
  template <class So>
  [[nodiscard]] static bool until(So so) {
    const auto end = std::chrono::steady_clock::now() + 2 * test::patience;
    while (!so() && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(5ms);
    return so();
  }
};

struct Member final : Handler {
  explicit Member(Crowd& all) : crowd(&all) {}
  std::optional<Will> connecting() noexcept override { return Will{.topic = "gone"}; }
  void connected(const Connected& told) noexcept override {
    number = told.connection;
    ++crowd->up;
  }
  void disconnected(const Disconnected& told) noexcept override { crowd->up -= told.was_connected ? 1 : 0; }
  void message(std::string_view, std::span<const std::uint8_t>, bool) noexcept override { ++crowd->heard; }
  void published(MessageId) noexcept override { ++crowd->published; }
  void unpublished(MessageId, std::string_view) noexcept override { ++crowd->unpublished; }
  Crowd* crowd;
  std::atomic<ConnectionNumber> number{0};
  std::unique_ptr<Client> client{};
};

void publish_all(std::vector<std::unique_ptr<Member>>& members, Crowd& crowd) {
  const auto before = crowd.published.load();
  for (auto& member : members)
    ASSERT_TRUE(member->client->publish(
        {.connection = member->number, .topic = "to/all", .payload = {1, 2, 3}, .qos = Qos::at_least_once}));
  ASSERT_TRUE(Crowd::until([&] { return crowd.published == before + many; })) << crowd.published;
}

}  // namespace

// Connected, subscribed, each message acknowledged; the broker killed and started again: all are back and publish.
TEST(MqttMany, AThousandClientsOnOneThread) {
  NEEDS_BROKER();
  if (!raise_limit()) GTEST_SKIP() << "needs descriptors: 6000 of them, ulimit -Hn";
  Broker broker("max_connections -1");
  const auto thread = test::thread();
  Crowd crowd;
  std::vector<std::unique_ptr<Member>> members;
  Random random(1);
  const auto begin = std::chrono::steady_clock::now();
  const auto passed = [&] {
    return std::to_string(
        std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::steady_clock::now() - begin).count());
  };
  const auto before = resident_kib();
  for (std::size_t i = 0; i < many; ++i) {
    members.push_back(std::make_unique<Member>(crowd));
    auto options = quick(broker.where(), "client-" + std::to_string(i), i % 2 == 0 ? Version::v5 : Version::v3_1_1);
    options.subscriptions = {"own/" + std::to_string(i), "to/nobody"};
    options.pauses = {.first = 200ms, .longest = 1'000ms, .good_after = 0ms};
    members.back()->client = Client::start(*thread, options, random.fork(), *members.back()).value();
  }
  ASSERT_TRUE(Crowd::until([&] { return crowd.up == many; })) << crowd.up;
  RecordProperty("ms_until_connected", passed());
  RecordProperty("kib_a_client", std::to_string((resident_kib() - before) / many));
  publish_all(members, crowd);
  RecordProperty("ms_until_published", passed());
  broker.kill();
  ASSERT_TRUE(Crowd::until([&] { return crowd.up == 0; })) << crowd.up;
  broker.start();
  ASSERT_TRUE(Crowd::until([&] { return crowd.up == many; })) << crowd.up;
  RecordProperty("ms_until_back", passed());
  publish_all(members, crowd);
  for (auto& member : members) member->client->end(Parting::without_will);
  ASSERT_TRUE(Crowd::until([&] { return crowd.up == 0; })) << crowd.up;
  for (auto& member : members) EXPECT_TRUE(member->client->has_ended());
  members.clear();
  EXPECT_EQ(crowd.published, 2 * many);
  EXPECT_EQ(crowd.unpublished, 0U);
}

// One client hangs in its broker; another, on the same thread, does not notice.
TEST(MqttMany, OneThatHangsHoldsNobodyUp) {
  NEEDS_BROKER();
  const Broker frozen, lively;
  const auto thread = test::thread();
  Station stuck(quick(frozen.where(), "stuck"), {}, thread.get());
  ASSERT_TRUE(stuck.heard.until(is_up));
  frozen.freeze();
  for (int i = 0; i < 100; ++i) static_cast<void>(stuck.publish("a", std::string(10'000, 'x')));
  auto options = quick(lively.where(), "lively");
  options.subscriptions = {"a"};
  Station other(options, {}, thread.get());
  ASSERT_TRUE(other.heard.until(is_up));
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(other.publish("a", "x"));
  EXPECT_TRUE(other.heard.until([](const Story& s) { return s.messages.size() == 100; }));
  EXPECT_EQ(stuck.client->counts().waiting, 100U);
  frozen.thaw();
  EXPECT_TRUE(stuck.heard.until([](const Story& s) { return s.published.size() == 100; }));
}

TEST(MqttNames, AHostThatIsNotThereIsSaid) {
  Station station(quick({false, "no-such-broker.invalid", 1883}, "one"));
  ASSERT_TRUE(station.heard.until([](const Story& s) { return s.disconnected.size() == 2; }));
  const auto told = station.heard.story().disconnected[0];
  EXPECT_EQ(told.why, Why::name_not_found) << told.words;
  EXPECT_NE(told.words.find("no-such-broker.invalid"), std::string::npos);
  EXPECT_EQ(station.heard.story().order.front(), "disconnected") << "no will was asked for";
}

// localhost is ::1 first on many computers, where this broker is not.
TEST(MqttNames, ANameIsLookedUpAndEachAddressTried) {
  NEEDS_BROKER();
  const Broker broker;
  auto options = quick(broker.where(false, "localhost"), "one");
  options.pauses = {.first = 3'600'000ms, .longest = 3'600'000ms};
  Station station(options);
  EXPECT_TRUE(station.heard.until(is_up));
}

TEST(MqttNames, AClientThatIsDestroyedDoesNotWaitForTheNameServer) {
  for (int i = 0; i < 20; ++i) {
    const Station station(quick({false, "no-such-broker-" + std::to_string(i) + ".invalid", 1883}, "one"));
  }
}

TEST(MqttOptions, WhatContradictsItselfIsRefused) {
  const auto thread = test::thread();
  test::Heard heard;
  const auto why = [&](const std::function<void(Options&)>& change) {
    auto options = quick({false, "127.0.0.1", 1}, "one");
    change(options);
    const auto client = Client::start(*thread, options, Random(1), heard);
    return client ? std::string() : client.error();
  };
  EXPECT_EQ(why([](Options&) {}), "");
  EXPECT_EQ(why([](Options& o) { o.where.host.clear(); }), "the broker's address is missing");
  EXPECT_EQ(why([](Options& o) { o.client_id.clear(); }), "the client-ID has 1 to 65535 bytes");
  EXPECT_EQ(why([](Options& o) { o.client_id = std::string("a\0b", 3); }), "the client-ID has a NUL character");
  EXPECT_EQ(why([](Options& o) { o.keep_alive = 4s; }), "the keep-alive time is 5 to 65535 seconds");
  EXPECT_EQ(why([](Options& o) { o.keep_alive = 65'536s; }), "the keep-alive time is 5 to 65535 seconds");
  EXPECT_EQ(why([](Options& o) { o.tls.key = "x"; }),
            "a client's certificate and its key belong together: name both files");
  EXPECT_EQ(why([](Options& o) { o.pauses.longest = 1ms; }),
            "the pauses between attempts grow from the first, above 0, to the longest");
  EXPECT_EQ(why([](Options& o) { o.subscriptions = {""}; }), "a topic filter has 1 to 65535 bytes, and no NUL");
  EXPECT_EQ(why([](Options& o) { o.subscriptions.assign(65, "a"); }),
            "there are 65 subscriptions, and at most 64 are allowed");
  EXPECT_EQ(why([](Options& o) { o.limits.incoming = 1'000; }),
            "incoming packets are limited to 1024 to 268435455 bytes");
  EXPECT_EQ(why([](Options& o) { o.limits.outgoing_bytes = 0; }), "there is no room for outgoing messages");
  EXPECT_EQ(why([](Options& o) { o.limits.unacknowledged = 21; }),
            "1 to 20 messages may wait for their acknowledgement");
  EXPECT_EQ(why([](Options& o) { o.login_file = "/none"; }), "/none: No such file or directory");
}

// libmosquitto looks at these itself, when they are used.
TEST(MqttOptions, AFilterThatIsNoneIsSaidAtTheConnection) {
  NEEDS_BROKER();
  const Broker broker;
  auto options = quick(broker.where(), "one");
  options.subscriptions = {"a/#/b"};
  Station station(options);
  ASSERT_TRUE(station.heard.until([](const Story& s) { return !s.disconnected.empty(); }));
  EXPECT_EQ(station.heard.story().disconnected[0].why, Why::refused_otherwise);
  EXPECT_NE(station.heard.story().disconnected[0].words.find("\"a/#/b\" is no topic filter"), std::string::npos);
}

}  // namespace berth::mqtt
