#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <string>

#include "rig.hpp"

namespace berth::serve {
namespace {

class Server : public Rig {};

/// "< frame 123 1700000000.123456 1A22 >" without its time.
std::string without_times(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '1' && text.compare(i, 10, "1700000000") == 0) {
      out += 'T';
      i += 16;
    } else {
      out += text[i];
    }
  }
  return out;
}

TEST_F(Server, FramesGoBothWaysAsSocketcandWritesThem) {
  serve();
  Socket client(*this);
  client.join();
  client.say("< send 7E5 8 4 1 0 0 0 0 0 ff >< send 1F940000 0 >< send 123 0  >");  // python-can's two blanks, too
  ASSERT_TRUE(run_until([&] { return ear_.frames.size() == 3; }));
  EXPECT_EQ(ear_.frames[0], can::Frame::base(0x7E5, {4, 1, 0, 0, 0, 0, 0, 0xFF}));
  EXPECT_EQ(ear_.frames[1], can::Frame::ext(0x1F940000, {}));
  EXPECT_EQ(ear_.frames[2], can::Frame::base(0x123, {}));
  peer_->send(can::Frame::base(0x7E4, {0x4F, 0xA0}), 0);
  peer_->send(can::Frame::base(0x701, {}), 0);
  ASSERT_TRUE(run_until([&] { return std::ranges::count(client.heard(), '>') >= 2; }));
  EXPECT_EQ(without_times(client.heard()), "< frame 7E4 T 4FA0 >< frame 701 T  >");
  EXPECT_EQ(server_->counters().frames_in, 3U);
  EXPECT_EQ(server_->counters().frames_out, 2U);
}

// python-can 4 compares each answer of the handshake with what one recv brings.
TEST_F(Server, FramesOnABusyBusWaitUntilTheAnswerToRawmodeWasTaken) {
  serve();
  bool alone = false;
  for (int i = 0; i < 10 && !alone; ++i) {  // a machine that sleeps for 100 ms here spoils one trial
    Socket client(*this);
    ASSERT_TRUE(client.hear("< hi >"));
    client.say("< open backbone >");
    ASSERT_TRUE(client.hear("< ok >"));
    for (int k = 0; k < 100; ++k) peer_->send(can::Frame::base(0x181, {1}), 0);
    client.say("< rawmode >");
    ASSERT_TRUE(run_until([&] { return client.heard().size() >= 6; }));
    alone = client.heard() == "< ok >";
    client.forget();
    EXPECT_TRUE(client.contains("< frame 181 "));  // by itself, later
  }
  EXPECT_TRUE(alone);
}

TEST_F(Server, ClientsHearEachOtherAndNotThemselves) {
  serve();
  Socket a(*this);
  Socket b(*this);
  a.join();
  b.join();
  EXPECT_EQ(server_->clients(), 2U);
  a.say("< send 181 1 1 >");
  EXPECT_TRUE(b.contains("< frame 181 "));
  b.say("< send 182 1 2 >");
  EXPECT_TRUE(a.contains("< frame 182 "));
  EXPECT_EQ(without_times(a.heard()).find("181"), std::string::npos);
  EXPECT_EQ(without_times(b.heard()).find("182"), std::string::npos);
}

TEST_F(Server, AnElementInPiecesAndManyInOne) {
  serve();
  Socket client(*this);
  client.join();
  for (const char c : std::string("< send 123 2 ab cd >")) client.say({&c, 1});
  client.say("\r\n< send 124 0 >\n< send 125");
  ASSERT_TRUE(run_until([&] { return ear_.frames.size() == 2; }));
  client.say(" 1 7 >");
  ASSERT_TRUE(run_until([&] { return ear_.frames.size() == 3; }));
  EXPECT_EQ(ear_.frames[0], can::Frame::base(0x123, {0xAB, 0xCD}));
  EXPECT_EQ(ear_.frames[2], can::Frame::base(0x125, {7}));
}

TEST_F(Server, WrongCommandsAreAnsweredAsBySocketcand) {
  serve();
  Socket client(*this);
  ASSERT_TRUE(client.hear("< hi >"));
  client.say("< send 123 0 >");
  EXPECT_TRUE(client.hear("< error unknown command >"));
  client.say("< open backbone >");
  EXPECT_TRUE(client.hear("< ok >"));
  client.say("< nonsense >");
  EXPECT_TRUE(client.hear("< error unknown command >"));
  client.say("< bcmmode >");  // it is there already: no change, so no command
  EXPECT_TRUE(client.hear("< error unknown command >"));
  client.say("< rawmode >");
  EXPECT_TRUE(client.hear("< ok >"));
  client.say("< subscribe 0 0 123 >");  // of BCM mode
  EXPECT_TRUE(client.hear("< error unknown command >"));
  client.say("< send 123 9 1 >< send 800 0 >< echo >");  // passed over in silence
  EXPECT_TRUE(client.hear("< echo >"));
  EXPECT_EQ(server_->counters().malformed, 2U);
  EXPECT_TRUE(ear_.frames.empty());
}

TEST_F(Server, ABusThatIsNotThere) {
  serve();
  Socket client(*this);
  ASSERT_TRUE(client.hear("< hi >"));
  client.say("< open \x1b[31mcan7 >");
  EXPECT_TRUE(client.hung_up());
  EXPECT_EQ(client.heard(), "< error could not open bus >");
  ASSERT_TRUE(run_until([&] { return server_->clients() == 0; }));
  // As it came: what prints it filters it (berth/text/printable.hpp).
  EXPECT_TRUE(std::ranges::any_of(told_, [](const auto& line) { return line.find("\x1b[31mcan7") != line.npos; }));
}

TEST_F(Server, ABusNameWithBlanks) {
  serve();
  Socket client(*this);
  client.join("left side");
  client.say("< send 1 0 >");
  EXPECT_TRUE(run_until([&] { return ear_.frames.size() == 1; }));
}

TEST_F(Server, NobodyMaySetTheBitTiming) {
  serve();
  Socket client(*this);
  ASSERT_TRUE(client.hear("< hi >"));
  client.say("< backbone B 125000 875 500 6 7 2 1 8 >");
  EXPECT_TRUE(client.hung_up());
  EXPECT_EQ(client.heard(), "< error configuring interface backbone >");
}

TEST_F(Server, WhoSpeaksSomethingElseIsLetGoAndNobodyElse) {
  serve();
  Socket good(*this);
  good.join();
  for (const auto& text : {std::string("GET / HTTP/1.1\r\n\r\n"), std::string(20'000, '<'), std::string("\xff\xfe")}) {
    Socket bad(*this);
    ASSERT_TRUE(bad.hear("< hi >"));
    bad.say(text);
    EXPECT_TRUE(bad.hung_up());
  }
  EXPECT_EQ(server_->counters().misbehaved, 3U);
  good.say("< echo >");
  EXPECT_TRUE(good.hear("< echo >"));
  EXPECT_EQ(server_->clients(), 1U);
}

TEST_F(Server, OneTooManyIsToldSo) {
  serve({.seats = {.most = 2}});
  Socket a(*this);
  Socket b(*this);
  ASSERT_TRUE(a.hear("< hi >"));
  ASSERT_TRUE(b.hear("< hi >"));
  {
    Socket c(*this);
    EXPECT_TRUE(c.hung_up());
    EXPECT_EQ(c.heard(), "< error too many clients >");
  }
  a.close();
  ASSERT_TRUE(run_until([&] { return server_->clients() == 1; }));
  Socket d(*this);
  EXPECT_TRUE(d.hear("< hi >"));
}

TEST_F(Server, WhoOpensNothingIsLetGo) {
  serve({.seats = {.patience = 200ms}});
  Socket idle(*this);
  ASSERT_TRUE(idle.hear("< hi >"));
  idle.say("< op");
  EXPECT_TRUE(idle.hung_up());
}

// The clocks of the seats are the executor's: the test moves it, and waits for nothing.
TEST_F(Server, HalfAnElementDoesNotHoldASeat) {
  serve();
  Socket half(*this);
  Socket listener(*this);
  half.join("backbone", false);
  listener.join("backbone", false);
  half.say("< send 123 1 ");
  ASSERT_TRUE(run_until([&] { return server_->clients() == 2; }));
  run_for(20ms);
  pass(31s);
  EXPECT_TRUE(half.hung_up());
  EXPECT_EQ(server_->counters().silent, 1U);
  pass(10h);
  EXPECT_EQ(server_->clients(), 1U) << "one that listens may stay";
}

TEST_F(Server, ASilentClientMakesRoomForAnother) {
  serve({.seats = {.most = 3}});
  Socket first(*this);
  first.join("backbone", false);
  pass(1s);
  Socket second(*this);
  second.join("backbone", false);
  Socket third(*this);
  third.join();
  pass(11s);
  first.say("< echo >");
  ASSERT_TRUE(first.hear("< echo >"));
  peer_->send(can::Frame::base(0x181, {1}), 0);
  ASSERT_TRUE(third.contains("181"));
  Socket late(*this);
  EXPECT_TRUE(late.hear("< hi >"));
  EXPECT_TRUE(second.hung_up()) << "idle for the longest";
  EXPECT_FALSE(first.ended || third.ended);
  Socket one_too_many(*this);
  EXPECT_TRUE(one_too_many.contains("too many clients")) << "nobody is idle any more";
}

TEST_F(Server, AClientThatTakesNothingLosesItsSeat) {
  serve();
  Socket slow(*this, 4096);
  slow.join();
  int given = 0;
  ASSERT_TRUE(run_until([&] {
    for (; given < 20'000 && peer_->send(can::Frame::base(0x181, {1, 2}), 0) == can::Queued::yes;) ++given;
    return server_->counters().frames_out >= 20'000;
  }));
  EXPECT_EQ(server_->clients(), 1U);
  pass(61s);
  EXPECT_EQ(server_->clients(), 0U);
  EXPECT_EQ(server_->counters().silent, 1U);
}

TEST_F(Server, ConnectionsFillNoLog) {
  serve();
  for (int i = 0; i < 300; ++i) {
    Socket stranger(*this);
    stranger.say("x");
    ASSERT_TRUE(stranger.hung_up());
  }
  EXPECT_EQ(server_->counters().misbehaved, 300U);
  EXPECT_LT(told_.size(), 250U);
}

// It is thrown out; meanwhile the bus works, and the other client gets every frame.
TEST_F(Server, ASlowClientIsLetGoAndSlowsNobody) {
  serve({.most_waiting = 200'000});
  Socket good(*this);
  Socket slow(*this, 4096);
  good.join();
  slow.join();
  constexpr int frames = 20'000;
  int given = 0;
  std::size_t heard = 0;
  ASSERT_TRUE(run_until([&] {
    for (; given < frames && peer_->send(can::Frame::base(0x181, {1, 2}), 0) == can::Queued::yes;) ++given;
    heard += static_cast<std::size_t>(std::ranges::count(good.heard(), '>'));
    good.forget();
    return heard >= frames || good.ended;
  })) << heard
      << " of " << given;
  EXPECT_EQ(heard, static_cast<std::size_t>(frames));
  EXPECT_EQ(server_->counters().too_slow, 1U);
  EXPECT_EQ(server_->clients(), 1U);
  EXPECT_FALSE(good.ended);
}

// Faster than the bus: it waits, nothing is lost, the order is kept.
TEST_F(Server, AClientThatSendsTooFastWaits) {
  serve();
  Socket client(*this);
  client.join();
  constexpr unsigned frames = 3000;
  std::string all;
  for (unsigned i = 0; i < frames; ++i) {
    all += "< send 100 2 " + std::string(1, "0123456789abcdef"[i % 16]) + " " +
           std::string(1, "0123456789abcdef"[i / 16 % 16]) + " >";
  }
  client.say(all);
  ASSERT_TRUE(run_until([&] { return ear_.frames.size() == frames; }));
  for (unsigned i = 0; i < frames; ++i) {
    ASSERT_EQ(ear_.frames[i],
              can::Frame::base(0x100, {static_cast<std::uint8_t>(i % 16), static_cast<std::uint8_t>(i / 16 % 16)}));
  }
}

// On a bus where nobody acknowledges a frame waits for ever. The client is told nothing false, may ask, and may leave.
TEST_F(Server, ABusThatTakesNothing) {
  serve();
  Socket client(*this);
  client.join();
  peer_->power(false);
  client.say("< send 1 0 >< echo >");
  EXPECT_TRUE(client.hear("< echo >"));  // 100 ms later
  std::string many;
  for (int i = 0; i < 200; ++i) many += "< send 2 0 >";
  client.say(many + "< echo >");
  run_for(300ms);
  EXPECT_EQ(client.heard(), "");  // it waits for room
  peer_->power(true);
  EXPECT_TRUE(run_until([&] { return ear_.frames.size() == 201; }));
  EXPECT_TRUE(client.hear("< echo >"));
  peer_->power(false);
  client.say(many);
  run_for(50ms);
  client.close();
  EXPECT_TRUE(run_until([&] { return server_->clients() == 0; }));
}

// python-can: send, shutdown.
TEST_F(Server, WhatAClientSentBeforeItHungUpIsSentAllTheSame) {
  serve();
  std::string many;
  for (int i = 0; i < 200; ++i) many += "< send 5 8 1 2 3 4 5 6 7 8 >";
  {
    Socket client(*this);
    client.join();
    client.say(many);
  }
  EXPECT_TRUE(run_until([&] { return ear_.frames.size() == 200; }));
  EXPECT_TRUE(run_until([&] { return server_->clients() == 0; }));
}

TEST_F(Server, TheEchoComesWhenTheFramesBeforeItWereSent) {
  serve();
  Socket client(*this);
  client.join();
  for (int i = 0; i < 50; ++i) {
    client.say("< send 3 0 >< echo >");
    const auto before = ear_.frames.size();
    ASSERT_TRUE(client.hear("< echo >"));
    EXPECT_GE(ear_.frames.size(), before);
    EXPECT_EQ(ear_.frames.size(), static_cast<std::size_t>(i) + 1);
  }
}

TEST_F(Server, RemoteFramesCannotBeSaidAndAreCounted) {
  serve();
  Socket client(*this);
  client.join();
  peer_->send(can::Frame::request(0x701, 1), 0);
  peer_->send(can::Frame::base(0x702, {}), 0);
  EXPECT_TRUE(client.contains("< frame 702 "));
  EXPECT_EQ(without_times(client.heard()).find("701"), std::string::npos);
  EXPECT_EQ(server_->counters().unspeakable, 1U);
}

TEST_F(Server, ANodeLeavesTheBusWithItsClient) {
  serve();
  {
    Socket client(*this);
    client.join();
    client.say("< send 1");
  }
  ASSERT_TRUE(run_until([&] { return server_->clients() == 0; }));
  // The peer is alone again: nobody acknowledges.
  peer_->send(can::Frame::base(1, {}), 9);
  run_for(50ms);
  EXPECT_TRUE(ear_.tags.empty());
}

// ---- BCM mode ----

TEST_F(Server, SubscriptionsAndFilters) {
  serve();
  Socket client(*this);
  client.join("backbone", false);
  client.say("< subscribe 0 0 123 >< filter 0 0 124 1 F0 >< echo >");
  ASSERT_TRUE(client.hear("< echo >"));
  const auto say = [&](std::uint32_t id, std::uint8_t value) { peer_->send(can::Frame::base(id, {value}), 0); };
  say(0x123, 2);
  say(0x123, 2);
  say(0x124, 0x11);  // the first is told
  say(0x124, 0x12);  // no bit of the mask
  say(0x124, 0x21);
  say(0x125, 1);
  say(0x123, 3);
  ASSERT_TRUE(run_until([&] { return std::ranges::count(client.heard(), '>') >= 5; }));
  EXPECT_EQ(without_times(client.heard()),
            "< frame 123 T 02  >< frame 123 T 02  >< frame 124 T 11  >< frame 124 T 21  >< frame 123 T 03  >");
  client.forget();
  client.say("< unsubscribe 123 >< echo >");
  ASSERT_TRUE(client.hear("< echo >"));
  say(0x123, 4);
  say(0x124, 0x31);
  EXPECT_TRUE(client.contains("< frame 124 "));
  EXPECT_EQ(without_times(client.heard()).find("123"), std::string::npos) << "digits of a time are none";
}

TEST_F(Server, ASubscriptionWithAnIntervalTellsTheLastFrame) {
  serve();
  Socket client(*this);
  client.join("backbone", false);
  client.say("< subscribe 0 200000 123 >< echo >");
  ASSERT_TRUE(client.hear("< echo >"));
  for (std::uint8_t i = 1; i <= 5; ++i) peer_->send(can::Frame::base(0x123, {i}), 0);
  ASSERT_TRUE(run_until([&] { return std::ranges::count(client.heard(), '>') >= 2; }));
  EXPECT_EQ(without_times(client.heard()), "< frame 123 T 01  >< frame 123 T 05  >");
}

TEST_F(Server, CyclicJobs) {
  serve();
  Socket client(*this);
  client.join("backbone", false);
  client.say("< add 0 10000 123 1 7 >< add 0 0 124 0 >");
  ASSERT_TRUE(run_until([&] { return ear_.frames.size() >= 6; }));
  EXPECT_EQ(std::ranges::count(ear_.frames, can::Frame::base(0x124, {})), 1);
  client.say("< update 123 1 8 >");
  ASSERT_TRUE(run_until([&] { return ear_.frames.back() == can::Frame::base(0x123, {8}); }));
  client.say("< delete 123 >< echo >");
  ASSERT_TRUE(client.hear("< echo >"));
  const auto count = ear_.frames.size();
  run_for(100ms);
  EXPECT_EQ(ear_.frames.size(), count);
  client.say("< add 0 10000 123 1 7 >< rawmode >");  // they end with the mode
  ASSERT_TRUE(client.hear("< ok >"));
  run_for(30ms);
  const auto then = ear_.frames.size();
  run_for(100ms);
  EXPECT_EQ(ear_.frames.size(), then);
}

TEST_F(Server, Statistics) {
  serve();
  Socket client(*this);
  client.join();
  client.say("< send 1 2 1 1 >< send 1 0 >< echo >");
  ASSERT_TRUE(client.hear("< echo >"));
  peer_->send(can::Frame::base(2, {1, 2, 3}), 0);
  ASSERT_TRUE(client.contains("< frame 002 "));
  client.forget();
  client.say("< controlmode >");
  ASSERT_TRUE(client.hear("< ok >"));
  client.say("< statistics 20 >");
  EXPECT_TRUE(client.contains("< stat 3 1 2 2 >< stat 3 1 2 2 >"));
}

TEST(ServerAlone, AnAddressThatIsTaken) {
  rt::Executor executor;
  io::Loop loop(executor);
  const auto none = [](const std::string&, std::string&) { return std::unique_ptr<can::Port>(); };
  const auto first = SocketcandServer::listen(loop, {"127.0.0.1", 0}, none, {});
  ASSERT_TRUE(first);
  const auto second = SocketcandServer::listen(loop, (*first)->where(), none, {});
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().find("another program listens there"), std::string::npos) << second.error();
  const auto third = SocketcandServer::listen(loop, {"no.such.host.invalid", 0}, none, {});
  EXPECT_FALSE(third);
}

}  // namespace
}  // namespace berth::serve
