// How a client comes back, what waits to be sent, and the words for what went wrong: all without a network.
#include "berth/mqtt/attempts.hpp"

#include <gtest/gtest.h>
#include <openssl/x509_vfy.h>

#include <set>
#include <thread>

#include "../pch.hpp"
#include "berth/mqtt/outbox.hpp"
#include "berth/mqtt/postbox.hpp"

namespace berth::mqtt {
namespace {

using namespace std::chrono_literals;

Options options_of(Version version) {
  Options options{.where = {false, "broker", 1883}, .client_id = "one", .version = version};
  options.pauses = {.first = 1'000ms, .longest = 60'000ms, .good_after = 10'000ms};
  return options;
}

const Cause refused{Why::refused, ""}, closed{Why::closed, ""}, version{Why::version_refused, ""};

Message message(ConnectionNumber connection, std::size_t size, Need need = Need::must, Qos qos = Qos::at_most_once) {
  return {
      .connection = connection, .topic = "t", .payload = std::vector<std::uint8_t>(size - 1), .qos = qos, .need = need};
}

}  // namespace

// 1 s to 60 s: between half and all of a bound that doubles, until a connection has held.
RC_GTEST_PROP(MqttAttempts, PausesGrowAndDifferAndBeginAnew, ()) {
  Attempts attempts(options_of(Version::v5), Random(*rc::gen::arbitrary<std::uint64_t>()));
  for (const int bound : {1'000, 2'000, 4'000, 8'000, 16'000, 32'000, 60'000, 60'000, 60'000}) {
    const auto pause = attempts.after(refused, Stage::before_broker, 0ms);
    RC_ASSERT(pause.count() >= bound / 2);
    RC_ASSERT(pause.count() <= bound);
  }
  RC_ASSERT(attempts.after(closed, Stage::connected, 9'999ms) >= 30'000ms);
  RC_ASSERT(attempts.after(closed, Stage::connected, 10'000ms) <= 1'000ms);
  RC_ASSERT(attempts.after(refused, Stage::before_broker, 0ms) >= 1'000ms);
}

TEST(MqttAttempts, MachinesDoNotComeBackInOneInstant) {
  std::set<std::int64_t> pauses;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    Attempts attempts(options_of(Version::v5), Random(seed));
    pauses.insert(attempts.after(closed, Stage::connected, 60'000ms).count());
  }
  EXPECT_GT(pauses.size(), 50U);
}

TEST(MqttAttempts, WhoeverWasTakenOverWaitsLongest) {
  Attempts attempts(options_of(Version::v5), Random(1));
  EXPECT_GE(attempts.after({Why::taken_over, ""}, Stage::connected, 3'600'000ms), 30'000ms);
}

TEST(MqttAttempts, EachAddressIsTriedBeforeAPause) {
  Attempts attempts(options_of(Version::v5), Random(1));
  const std::vector<std::string> found{"::1", "10.0.0.1", "10.0.0.2"};
  EXPECT_EQ(attempts.address(found), "::1");
  EXPECT_EQ(attempts.after(refused, Stage::before_broker, 0ms), 0ms);
  EXPECT_EQ(attempts.address(found), "10.0.0.1");
  EXPECT_EQ(attempts.after({Why::no_answer, ""}, Stage::before_broker, 0ms), 0ms);
  EXPECT_EQ(attempts.address(found), "10.0.0.2");
  EXPECT_GT(attempts.after({Why::unreachable, ""}, Stage::before_broker, 0ms), 0ms);
  EXPECT_EQ(attempts.address(found), "::1");
  // What listens there is the broker: the next address would be another.
  EXPECT_GT(attempts.after({Why::bad_login, ""}, Stage::asked, 0ms), 0ms);
  EXPECT_EQ(attempts.address(found), "::1");
  // One that worked stays.
  EXPECT_EQ(attempts.after(refused, Stage::before_broker, 0ms), 0ms);
  EXPECT_GT(attempts.after(closed, Stage::connected, 60'000ms), 0ms);
  EXPECT_EQ(attempts.address(found), "10.0.0.1");
  EXPECT_EQ(attempts.address({"10.0.0.9"}), "10.0.0.9");
}

TEST(MqttAttempts, TheVersionThatIsRefusedIsNotAskedForAgain) {
  Attempts attempts(options_of(Version::automatic), Random(1));
  EXPECT_EQ(attempts.version(), Version::v5);
  EXPECT_EQ(attempts.after(version, Stage::asked, 0ms), 0ms);
  EXPECT_EQ(attempts.version(), Version::v3_1_1);
  static_cast<void>(attempts.after(closed, Stage::asked, 0ms));
  EXPECT_EQ(attempts.version(), Version::v3_1_1);
  static_cast<void>(attempts.after(closed, Stage::connected, 0ms));
  EXPECT_EQ(attempts.version(), Version::v3_1_1);
  // Neither is known there: no loop without a pause.
  EXPECT_GT(attempts.after(version, Stage::asked, 0ms), 0ms);
  EXPECT_EQ(attempts.version(), Version::v5);
}

TEST(MqttAttempts, ABrokerThatOnlyClosesIsAskedByBothVersionsUntilOneWorks) {
  Attempts attempts(options_of(Version::automatic), Random(1));
  EXPECT_GT(attempts.after(closed, Stage::asked, 0ms), 0ms);
  EXPECT_EQ(attempts.version(), Version::v3_1_1);
  // It was not reached: that says nothing of its version.
  static_cast<void>(attempts.after(refused, Stage::before_broker, 0ms));
  EXPECT_EQ(attempts.version(), Version::v3_1_1);
  static_cast<void>(attempts.after({Why::protocol, ""}, Stage::asked, 0ms));
  EXPECT_EQ(attempts.version(), Version::v5);
  static_cast<void>(attempts.after(closed, Stage::connected, 0ms));
  static_cast<void>(attempts.after(closed, Stage::asked, 0ms));
  EXPECT_EQ(attempts.version(), Version::v5);
  Attempts chosen(options_of(Version::v3_1_1), Random(1));
  static_cast<void>(chosen.after(version, Stage::asked, 0ms));
  EXPECT_EQ(chosen.version(), Version::v3_1_1);
}

TEST(MqttPostbox, RoomIsLeftForWhatMustBeSent) {
  Postbox postbox({.outgoing_messages = 100, .outgoing_bytes = 1'000});
  EXPECT_EQ(postbox.accept(message(1, 10)).error(), Refusal::not_connected);
  postbox.open(1, 500);
  EXPECT_EQ(postbox.accept(message(2, 10)).error(), Refusal::not_connected);
  EXPECT_EQ(postbox.accept(message(0, 10)).error(), Refusal::not_connected);
  EXPECT_EQ(postbox.accept(message(1, 501)).error(), Refusal::too_large);
  const auto first = postbox.accept(message(1, 500, Need::may)).value();
  EXPECT_EQ(first.id, 1U);
  EXPECT_TRUE(postbox.accept(message(1, 250, Need::may)));
  EXPECT_EQ(postbox.accept(message(1, 1, Need::may)).error(), Refusal::no_room);
  EXPECT_TRUE(postbox.accept(message(1, 250, Need::must)));
  EXPECT_EQ(postbox.accept(message(1, 1, Need::must)).error(), Refusal::no_room);
  postbox.give_back(first);
  EXPECT_EQ(postbox.accept(message(1, 1, Need::may)).value().id, 4U);
  const auto counts = postbox.counts();
  EXPECT_EQ(counts.accepted, 4U);
  EXPECT_EQ(counts.no_room_may, 1U);
  EXPECT_EQ(counts.no_room_must, 1U);
  EXPECT_EQ(counts.waiting, 3U);
  EXPECT_EQ(counts.waiting_bytes, 501U);
  postbox.ask_to_part(Parting::without_will);
  EXPECT_EQ(postbox.accept(message(1, 1)).error(), Refusal::not_connected);
}

TEST(MqttPostbox, ALimitOfMessagesHoldsBesideThatOfBytes) {
  Postbox postbox({.outgoing_messages = 4, .outgoing_bytes = 1'000'000});
  postbox.open(1, 1'000);
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(postbox.accept(message(1, 1, Need::may)));
  EXPECT_EQ(postbox.accept(message(1, 1, Need::may)).error(), Refusal::no_room);
  EXPECT_TRUE(postbox.accept(message(1, 1, Need::must)));
  EXPECT_EQ(postbox.accept(message(1, 1, Need::must)).error(), Refusal::no_room);
}

// One thread accepts and puts, another takes and gives back: nothing is lost, and there is a place for all that is
// accepted.
TEST(MqttPostbox, BetweenTwoThreads) {
  Postbox postbox({.outgoing_messages = 7, .outgoing_bytes = 1'000});
  postbox.open(1, 1'000);
  constexpr MessageId count = 20'000;
  std::thread publisher([&] {
    for (MessageId sent = 0; sent < count;) {
      auto letter = postbox.accept(message(1, 1 + sent % 50));
      if (letter) {
        postbox.put(std::move(*letter));
        ++sent;
      } else {
        std::this_thread::yield();
      }
    }
  });
  for (MessageId taken = 0; taken < count;) {
    const auto letter = postbox.take();
    if (!letter) {
      std::this_thread::yield();
      continue;
    }
    ASSERT_EQ(letter->id, ++taken);
    ASSERT_EQ(letter->bytes, 1 + (taken - 1) % 50);
    postbox.give_back(*letter);
  }
  publisher.join();
  EXPECT_EQ(postbox.counts().waiting, 0U);
  EXPECT_EQ(postbox.counts().waiting_bytes, 0U);
}

TEST(MqttOutbox, TheWindowHoldsBackTheOnesBehindIt) {
  Outbox outbox;
  for (const MessageId id : {1U, 2U, 3U, 4U})
    outbox.add({id, 1, message(1, 1, Need::must, id == 4 ? Qos::at_most_once : Qos::at_least_once)});
  ASSERT_TRUE(outbox.may_send(2));
  outbox.send().packet = 11;
  ASSERT_TRUE(outbox.may_send(2));
  outbox.send().packet = 12;
  EXPECT_FALSE(outbox.may_send(2));
  EXPECT_FALSE(outbox.out(99));
  EXPECT_EQ(outbox.out(12)->id, 2U);
  ASSERT_TRUE(outbox.may_send(2));
  outbox.send().packet = 13;
  EXPECT_TRUE(outbox.may_send(0)) << "QoS 0 needs no acknowledgement";
  // What is left comes back in the order in which it went.
  std::vector<MessageId> left;
  while (const auto letter = outbox.take_any()) left.push_back(letter->id);
  EXPECT_EQ(left, (std::vector<MessageId>{1, 3, 4}));
  EXPECT_TRUE(outbox.is_empty());
}

TEST(MqttOutbox, WhatCannotBeSentTakesNoPlaceInTheWindow) {
  Outbox outbox;
  for (const MessageId id : {1U, 2U}) outbox.add({id, 1, message(1, 1, Need::must, Qos::at_least_once)});
  static_cast<void>(outbox.send());
  EXPECT_EQ(outbox.failed().id, 1U);
  EXPECT_TRUE(outbox.may_send(1));
}

// Each kind has its word, and no two the same; each reason says what to do.
TEST(MqttCauses, EachHasAName) {
  std::set<std::string> names;
  for (unsigned i = 0; i <= static_cast<unsigned>(Why::own_computer); ++i) names.insert(name(static_cast<Why>(i)));
  EXPECT_EQ(names.size(), static_cast<std::size_t>(Why::own_computer) + 1);
  EXPECT_STREQ(name(Why::taken_over), "taken-over");
  EXPECT_STREQ(name(Why::certificate_untrusted), "certificate-untrusted");
  EXPECT_STREQ(name(Why::own_computer), "own-computer");
}

TEST(MqttCauses, OfCertificates) {
  EXPECT_EQ(of_verification("b", X509_V_ERR_CERT_HAS_EXPIRED).why, Why::certificate_expired);
  EXPECT_EQ(of_verification("b", X509_V_ERR_CERT_NOT_YET_VALID).why, Why::certificate_early);
  EXPECT_EQ(of_verification("b", X509_V_ERR_HOSTNAME_MISMATCH).why, Why::certificate_name);
  EXPECT_EQ(of_verification("b", X509_V_ERR_IP_ADDRESS_MISMATCH).why, Why::certificate_name);
  EXPECT_EQ(of_verification("b", X509_V_ERR_SELF_SIGNED_CERT_IN_CHAIN).why, Why::certificate_untrusted);
  EXPECT_EQ(of_verification("b", X509_V_ERR_CERT_REVOKED).why, Why::certificate);
}

}  // namespace berth::mqtt
