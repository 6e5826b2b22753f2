// The client port before the server of this house, and before servers that a test plays by hand; the hub.
#include "berth/io/socketcand_port.hpp"

#include <gtest/gtest.h>
#include <algorithm>
#include <atomic>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include "berth/io/open_port.hpp"
#include "berth/serve/hub.hpp"
#include "rig.hpp"

namespace berth::serve {
namespace {

using io::SocketcandPort;

class Port : public Rig {
 protected:
  // `connect` waits for the server, which is in this thread: it asks in another.
  std::unique_ptr<can::Port> open(const std::string& text, std::string* why = nullptr) {
    tl::expected<std::unique_ptr<can::Port>, std::string> port = tl::unexpected(std::string("none"));
    std::atomic<bool> over = false;
    std::thread client([&] {
      port = io::open_port(other_loop_, *can::parse_port(text), {.bit_rate = 1'000'000});
      over = true;
    });
    while (!over) loop_.turn(1ms);
    client.join();
    if (!port && why != nullptr) *why = port.error();
    if (port) (*port)->listen(&heard_, everything);
    return port ? std::move(*port) : nullptr;
  }
  [[nodiscard]] std::string address(const std::string& bus = "backbone") const {
    return "127.0.0.1:" + std::to_string(port_) + "/" + bus;
  }
  // Comes up by itself.
  std::unique_ptr<SocketcandPort> begin(const std::string& bus = "backbone") {
    auto port = SocketcandPort::connect(other_loop_, address(bus), {.bit_rate = 1'000'000, .timeout = 0s});
    EXPECT_TRUE(port) << port.error();
    (*port)->listen(&heard_, everything);
    return std::move(*port);
  }
  Ear heard_;
};

TEST_F(Port, FramesBothWaysAndOwnOnesAreSentWhenTheyWereAcknowledged) {
  serve();
  const auto port = open("socketcand://" + address());
  ASSERT_TRUE(port);
  const auto status = port->status();
  EXPECT_TRUE(status.up && status.bit_rate_is_label && status.bit_rate == 1'000'000);
  EXPECT_FALSE(status.knows_sent || status.knows_counters || status.knows_errors);
  peer_->send(can::Frame::base(0x7E4, {0x4F, 0xA0}), 0);
  peer_->send(can::Frame::ext(0x1F940000, {}), 0);
  ASSERT_TRUE(run_until([&] { return heard_.frames.size() == 2; }));
  EXPECT_EQ(heard_.frames[0], can::Frame::base(0x7E4, {0x4F, 0xA0}));
  EXPECT_EQ(heard_.frames[1], can::Frame::ext(0x1F940000, {}));
  for (std::uint32_t i = 1; i <= 20; ++i) {
    EXPECT_EQ(port->send(can::Frame::base(0x100 + i, {1, 2, 3}), i), can::Queued::yes);
    ASSERT_TRUE(run_until([&] { return heard_.tags.size() == i; }));
    EXPECT_EQ(ear_.frames.size(), i);  // on the bus already
    EXPECT_EQ(heard_.tags.back(), i);
  }
  EXPECT_EQ(heard_.frames.size(), 2U);  // none of its own
  EXPECT_EQ(port->status().queued, 0U);
}

TEST_F(Port, TheFilterTheQueueAndWhatCannotBeSaid) {
  serve();
  const auto port = open("socketcand://" + address());
  ASSERT_TRUE(port);
  const can::IdRange some[] = {{0x100, 0x1FF}};
  port->listen(&heard_, some);
  peer_->send(can::Frame::base(0x200, {}), 0);
  peer_->send(can::Frame::base(0x180, {}), 0);
  ASSERT_TRUE(run_until([&] { return !heard_.frames.empty(); }));
  EXPECT_EQ(heard_.frames[0].id, 0x180U);
  EXPECT_EQ(port->send(can::Frame::request(0x701, 1), 1), can::Queued::closed);
  can::Frame fd = can::Frame::base(1, {});
  fd.fd = true;
  EXPECT_EQ(port->send(fd, 1), can::Queued::closed);
  unsigned given = 0;
  while (port->send(can::Frame::base(1, {}), given + 1) == can::Queued::yes) ++given;
  EXPECT_GE(given, SocketcandPort::queue_depth - 1);
  EXPECT_EQ(port->send(can::Frame::base(1, {}), 99), can::Queued::full);
  port->withdraw(1);
  ASSERT_TRUE(run_until([&] { return port->status().queued == 0; }));
  run_for(20ms);
  EXPECT_EQ(heard_.tags.size(), given - 1);
  EXPECT_EQ(std::ranges::count(heard_.tags, 1U), 0);
  EXPECT_TRUE(port->restart(1'000'000));
  EXPECT_FALSE(port->restart(125'000));
}

TEST_F(Port, WhatIsWrongIsTold) {
  serve();
  std::string why;
  EXPECT_FALSE(open("socketcand://" + address("nowhere"), &why));
  EXPECT_NE(why.find("could not open bus"), std::string::npos) << why;
  server_.reset();
  EXPECT_FALSE(open("socketcand://" + address(), &why));
  EXPECT_NE(why.find("refused"), std::string::npos) << why;
  for (const auto* text : {"", "host", "host/", "host:x/can0", "host/a<b"}) {
    const auto port = SocketcandPort::connect(other_loop_, text, {});
    ASSERT_FALSE(port) << text;
    EXPECT_NE(port.error().find("socketcand://HOST:PORT/BUS"), std::string::npos) << port.error();
  }
}

TEST_F(Port, TheServerGoesAndComesBack) {
  serve();
  const auto port = open("socketcand://" + address("left side"));
  ASSERT_TRUE(port);
  server_.reset();
  ASSERT_TRUE(run_until([&] { return heard_.ups.size() == 1; }));
  EXPECT_FALSE(heard_.ups[0]);
  EXPECT_FALSE(port->status().up);
  EXPECT_EQ(port->send(can::Frame::base(1, {}), 1), can::Queued::closed);
  run_for(600ms);
  serve();  // at the same port
  ASSERT_TRUE(run_until([&] { return heard_.ups.size() == 2; }));
  EXPECT_TRUE(heard_.ups[1]);
  EXPECT_EQ(port->send(can::Frame::base(0x123, {}), 7), can::Queued::yes);
  ASSERT_TRUE(run_until([&] { return !heard_.tags.empty(); }));
  EXPECT_EQ(ear_.frames.back(), can::Frame::base(0x123, {}));
}

// A server played by hand: what it says comes in pieces, with errors and rubbish between.
class ByHand : public Port {
 protected:
  ByHand() {
    listening_ = io::listen_tcp({"127.0.0.1", 0}).value();
    port_ = io::local_endpoint(listening_)->port;
  }
  ~ByHand() override {
    if (fd_ >= 0) ::close(fd_);
    ::close(listening_);
  }
  void accept() {
    ASSERT_TRUE(run_until([&] { return (fd_ = ::accept(listening_, nullptr, nullptr)) >= 0; }));
  }
  void say(const std::string& text) const {
    ASSERT_EQ(::send(fd_, text.data(), text.size(), MSG_NOSIGNAL), static_cast<ssize_t>(text.size()));
  }
  bool hears(const std::string& expected) {
    return run_until([&] {
      std::array<char, 4096> buffer;
      const auto n = ::recv(fd_, buffer.data(), buffer.size(), MSG_DONTWAIT);
      if (n > 0) heard_text_.append(buffer.data(), static_cast<std::size_t>(n));
      return heard_text_.ends_with(expected);  // between may be the question whether somebody is there
    });
  }
  void hang_up() {
    ::close(fd_);
    fd_ = -1;
    heard_text_.clear();
  }
  void greet() {
    say("< hi >");
    ASSERT_TRUE(hears("< open backbone >"));
    say("< ok >");
    ASSERT_TRUE(hears("< open backbone >< rawmode >"));
    say("< ok >");
    ASSERT_TRUE(hears("< open backbone >< rawmode >< echo >"));
    heard_text_.clear();
    say("< echo >");
  }
  int listening_ = -1;
  int fd_ = -1;
  std::string heard_text_;
};

TEST_F(ByHand, AnythingAServerMaySay) {
  const auto port = begin();
  accept();
  greet();
  ASSERT_TRUE(run_until([&] { return port->status().up; }));
  for (const char c : std::string("< frame 123 1.5 1122 >")) {
    say(std::string(1, c));
    run_for(1ms);
  }
  say("< error 004 1.000000 >< stat 1 2 3 4 >< what is this >< frame 999 1.0 11 >rubbish\r\n< frame 124 1.0 11 22  >");
  ASSERT_TRUE(run_until([&] { return heard_.frames.size() == 2; }));
  EXPECT_EQ(heard_.frames[0], can::Frame::base(0x123, {0x11, 0x22}));
  EXPECT_EQ(heard_.frames[1], can::Frame::base(0x124, {0x11, 0x22}));
  EXPECT_EQ(port->status().errors, 1U);
  EXPECT_EQ(port->status().lost, 2U);  // a frame with an impossible identifier, and rubbish
  EXPECT_EQ(port->faults().count, 2U);
  EXPECT_TRUE(port->status().up);
  EXPECT_EQ(port->send(can::Frame::base(0x7E5, {0x04, 0xA0}), 3), can::Queued::yes);
  ASSERT_TRUE(hears("< send 7E5 2 4 a0 >< echo >"));
  EXPECT_TRUE(heard_.tags.empty());
  say("< echo >< echo >< echo >");
  ASSERT_TRUE(run_until([&] { return !heard_.tags.empty(); }));
}

TEST_F(ByHand, WhoSpeaksSomethingElseIsLeftAndTriedAgain) {
  const auto port = begin();
  accept();
  say("220 mail.example.org ESMTP\r\n");
  ASSERT_TRUE(run_until([&] { return port->faults().what.find("another protocol") != std::string::npos; }));
  hang_up();
  accept();
  say("< hi >");
  ASSERT_TRUE(hears("< open backbone >"));
  say("< error could not open bus >");
  ASSERT_TRUE(run_until([&] { return port->faults().what.find("could not open bus") != std::string::npos; }));
  hang_up();
  accept();
  greet();
  ASSERT_TRUE(run_until([&] { return port->status().up; }));
  EXPECT_EQ(port->connections(), 1U);
}

// Half open: the server's machine is gone, and nobody says so.
TEST_F(ByHand, AServerThatAnswersNoMoreIsLeft) {
  const auto port = begin();
  accept();
  greet();
  ASSERT_TRUE(run_until([&] { return port->status().up; }));
  ASSERT_TRUE(hears("< echo >"));  // after 2 s of silence it asks
  ASSERT_TRUE(run_until([&] { return !port->status().up; }));
  EXPECT_NE(port->faults().what.find("does not answer"), std::string::npos);
}

// ---- the hub ----

TEST(Hub, UsersHearEachOtherTheBusAndNotThemselves) {
  sim::World world;
  auto& bus = world.add_bus("a", 1'000'000);
  Ear peer_ear;
  const auto peer = bus.attach({.name = "peer"});
  peer->listen(&peer_ear, everything);
  serve::Hub hub(world.executor(), bus.attach({.name = "shared"}));
  Ear a_ear;
  Ear b_ear;
  const auto a = hub.attach();
  auto b = hub.attach();
  a->listen(&a_ear, everything);
  const can::IdRange some[] = {{0x100, 0x1FF}};
  b->listen(&b_ear, some);
  EXPECT_EQ(a->send(can::Frame::base(0x123, {1}), 5), can::Queued::yes);
  EXPECT_EQ(a->send(can::Frame::base(0x223, {1}), 6), can::Queued::yes);
  world.run_for(10ms);
  EXPECT_EQ(peer_ear.frames.size(), 2U);
  EXPECT_EQ(a_ear.tags, (std::vector<std::uint32_t>{5, 6}));
  EXPECT_TRUE(a_ear.frames.empty());
  ASSERT_EQ(b_ear.frames.size(), 1U);
  EXPECT_EQ(b_ear.frames[0].id, 0x123U);
  peer->send(can::Frame::base(0x150, {}), 0);
  world.run_for(10ms);
  EXPECT_EQ(a_ear.frames.size(), 1U);
  EXPECT_EQ(b_ear.frames.size(), 2U);
  // One leaves while its frame is under way; the others go on.
  EXPECT_EQ(b->send(can::Frame::base(0x101, {}), 9), can::Queued::yes);
  b.reset();
  world.run_for(10ms);
  EXPECT_EQ(hub.users(), 1U);
  EXPECT_EQ(a->send(can::Frame::base(0x102, {}), 10), can::Queued::yes);
  world.run_for(10ms);
  EXPECT_EQ(a_ear.tags.back(), 10U);
}

TEST(Hub, TheQueueOfOneIsNotTheOthers) {
  sim::World world;
  auto& bus = world.add_bus("a", 1'000'000);
  Ear peer_ear;
  const auto peer = bus.attach({.name = "peer"});
  peer->listen(&peer_ear, everything);
  serve::Hub hub(world.executor(), bus.attach({.name = "shared", .queue_depth = 4}));
  const auto greedy = hub.attach();
  const auto modest = hub.attach();
  Ear ear;
  modest->listen(&ear, everything);
  unsigned given = 0;
  while (greedy->send(can::Frame::base(0x100, {}), ++given) == can::Queued::yes) {
  }
  EXPECT_GE(given, serve::Hub::queue_depth);
  EXPECT_LE(given, serve::Hub::queue_depth + 5);
  EXPECT_EQ(modest->send(can::Frame::base(0x200, {}), 1), can::Queued::yes);
  while (ear.tags.empty()) world.run_for(100us);
  EXPECT_LT(peer_ear.frames.size(), 10U);  // it did not wait for all of the other's
  world.run_for(50ms);
  EXPECT_EQ(peer_ear.frames.size(), given - 1 + 1);
}

}  // namespace
}  // namespace berth::serve
