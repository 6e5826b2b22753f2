#include <fcntl.h>
#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <linux/sockios.h>
#include <sys/ioctl.h>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include <algorithm>
#include <cstdio>
#include <deque>
#include <optional>
#include <thread>

#include "berth/io/open_port.hpp"
#include "berth/io/socketcan_port.hpp"
#include "tests/vm/interface.hpp"

namespace berth::io {
namespace {

using namespace std::chrono_literals;
using test::shell;
using test::until;

constexpr can::IdRange everything[] = {can::all_base, can::all_extended};

class Ear final : public can::Listener {
 public:
  explicit Ear(rt::Executor& executor) : executor_(&executor) {}
  void received(const can::Frame& f, rt::Time at) noexcept override {
    ++frames;
    note("< " + can::to_string(f), at);
    last_frame = f;
  }
  void sent(std::uint32_t tag, rt::Time at) noexcept override {
    ++confirmed;
    note("sent " + std::to_string(tag), at);
  }
  void changed(const can::Status& s, rt::Time at) noexcept override {
    states.push_back(s);
    note(s.bus_off ? "bus-off" : s.up ? "up" : "down", at);
  }
  std::vector<std::string> log;
  std::vector<can::Status> states;
  can::Frame last_frame;
  unsigned frames = 0;
  unsigned confirmed = 0;
  bool times_hold = true;  // each before now and not before the last
  bool keeps_log = true;
  rt::Time last = rt::Time::min();

 private:
  void note(std::string text, rt::Time at) {
    if (keeps_log) log.push_back(std::move(text));
    times_hold = times_hold && at >= last && at <= executor_->now();
    last = at;
  }
  rt::Executor* executor_;
};

class SocketCan : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto why = test::no_interface("vcan0");
    if (!why.empty()) GTEST_SKIP() << why;
    vcan_.emplace("bvcan0");
  }
  std::unique_ptr<can::Port> open(const PortOptions& options = {}) {
    auto port = open_port(loop_, {can::PortKind::socketcan, vcan_->name()}, options);
    EXPECT_TRUE(port) << port.error();
    return port ? std::move(*port) : nullptr;
  }
  bool until(const std::function<bool()>& holds) { return test::until(loop_, holds); }
  void cansend(const std::string& frame) { ASSERT_TRUE(shell("cansend " + vcan_->name() + " " + frame)); }

  rt::Executor executor_;
  Loop loop_{executor_};
  std::optional<test::Vcan> vcan_;
};

TEST_F(SocketCan, OwnFramesAreConfirmedAndNeverReceivedAndOthersHearThem) {
  auto a = open({.bit_rate = 250'000});
  auto b = open();
  ASSERT_TRUE(a && b);
  EXPECT_TRUE(a->status().up);
  EXPECT_EQ(a->status().bit_rate, 250'000U);
  EXPECT_TRUE(a->status().bit_rate_is_label);
  EXPECT_EQ(b->status().bit_rate, 0U);
  Ear ear_a(executor_);
  Ear ear_b(executor_);
  a->listen(&ear_a, everything);
  b->listen(&ear_b, everything);
  EXPECT_EQ(a->send(can::Frame::base(0x601, {1, 2, 3}), 7), can::Queued::yes);
  EXPECT_EQ(a->send(can::Frame::ext(0x601, {4}), 0), can::Queued::yes);
  EXPECT_EQ(a->send(can::Frame::request(0x701, 1), 9), can::Queued::yes);
  EXPECT_TRUE(ear_a.log.empty());  // never from inside send
  ASSERT_TRUE(until([&] { return ear_b.log.size() == 3 && ear_a.log.size() == 2; }));
  test::idle(loop_, 50ms);
  EXPECT_EQ(ear_a.log, (std::vector<std::string>{"sent 7", "sent 9"}));
  EXPECT_EQ(ear_b.log, (std::vector<std::string>{"< 601#010203", "< 00000601#04", "< 701#R1"}));
  EXPECT_TRUE(ear_a.times_hold && ear_b.times_hold);
  EXPECT_EQ(a->status().queued, 0);
}

TEST_F(SocketCan, AConfirmationStandsInOrderWithWhatWasHeard) {
  auto a = open();
  auto b = open();
  ASSERT_TRUE(a && b);
  Ear ear(executor_);
  a->listen(&ear, everything);
  for (std::uint32_t i = 0; i < 50; ++i) {
    ASSERT_EQ(b->send(can::Frame::base(0x100 + i, {}), 0), can::Queued::yes);
    loop_.serve();
    ASSERT_EQ(a->send(can::Frame::base(0x7E5, {0x51}), i + 1), can::Queued::yes);
    loop_.serve();
  }
  ASSERT_TRUE(until([&] { return ear.log.size() == 100; }));
  for (std::uint32_t i = 0; i < 50; ++i) {
    EXPECT_EQ(ear.log[2 * i], "< " + can::to_string(can::Frame::base(0x100 + i, {})));
    EXPECT_EQ(ear.log[2 * i + 1], "sent " + std::to_string(i + 1));
  }
  EXPECT_TRUE(ear.times_hold);
}

// A device that says its boot-up and only then begins to listen to its SDO server: whoever answers at once is heard.
TEST_F(SocketCan, WhatAJobSendsLeavesWhenTheJobIsOver) {
  auto a = open();
  ASSERT_TRUE(a);
  const int raw = ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK, CAN_RAW);
  ASSERT_GE(raw, 0);
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex(vcan_->name().c_str()));
  const void* const plain = &address;
  ASSERT_EQ(::bind(raw, static_cast<const sockaddr*>(plain), sizeof address), 0);
  Ear ear(executor_);
  a->listen(&ear, {});
  class Boot final : public rt::Job {
   public:
    Boot(can::Port& port, Ear& ear, int raw) : port_(&port), ear_(&ear), raw_(raw) {}
    void run() noexcept override {
      port_->send(can::Frame::base(0x705, {0}), 0);
      can_frame frame{};
      left_early = ::read(raw_, &frame, sizeof frame) > 0;
      constexpr can::IdRange own[] = {can::only(0x605)};
      port_->listen(ear_, own);
    }
    bool left_early = false;

   private:
    can::Port* port_;
    Ear* ear_;
    int raw_;
  };
  Boot boot(*a, ear, raw);
  executor_.post(boot);
  loop_.serve();
  EXPECT_FALSE(boot.left_early);
  can_frame frame{};
  EXPECT_GT(::read(raw, &frame, sizeof frame), 0);
  EXPECT_EQ(frame.can_id, 0x705U);
  ::close(raw);
  cansend("605#4000100000000000");
  ASSERT_TRUE(until([&] { return ear.frames == 1; }));
}

TEST_F(SocketCan, OnlyWhatIsListenedToComes) {
  auto a = open();
  auto b = open();
  ASSERT_TRUE(a && b);
  Ear ear(executor_);
  constexpr can::IdRange some[] = {
      {0x181, 0x184}, can::only(0x700), {can::extended_flag | 0x100, can::extended_flag | 0x1FF}};
  a->listen(&ear, some);
  const auto offer = [&] {
    for (std::uint32_t id : {0x180U, 0x181U, 0x184U, 0x185U, 0x700U}) b->send(can::Frame::base(id, {}), 0);
    b->send(can::Frame::request(0x182, 2), 0);
    for (std::uint32_t id : {0xFFU, 0x100U, 0x1FFU, 0x200U}) b->send(can::Frame::ext(id, {}), 0);
    b->send(can::Frame::base(0x100, {}), 0);
  };
  offer();
  const std::vector<std::string> wanted{"< 181#", "< 184#", "< 700#", "< 182#R2", "< 00000100#", "< 000001FF#"};
  ASSERT_TRUE(until([&] { return ear.log.size() >= wanted.size(); }));
  test::idle(loop_, 50ms);
  EXPECT_EQ(ear.log, wanted);
  ear.log.clear();
  constexpr can::IdRange one[] = {can::only(0x185)};
  a->listen(&ear, one);
  offer();
  ASSERT_TRUE(until([&] { return !ear.log.empty(); }));
  test::idle(loop_, 50ms);
  EXPECT_EQ(ear.log, std::vector<std::string>{"< 185#"});
  ear.log.clear();
  a->listen(nullptr, {});
  offer();
  test::idle(loop_, 50ms);
  EXPECT_TRUE(ear.log.empty());
}

TEST_F(SocketCan, OtherLocalProgramsAreHeardAndHear) {
  auto a = open();
  ASSERT_TRUE(a);
  Ear ear(executor_);
  a->listen(&ear, everything);
  cansend("701#7F");
  ASSERT_TRUE(until([&] { return ear.frames == 1; }));
  EXPECT_EQ(ear.log.back(), "< 701#7F");
  std::FILE* dump = ::popen(("timeout 120 candump -n 1 -L " + vcan_->name()).c_str(), "r");
  ASSERT_NE(dump, nullptr);
  std::string line(200, 0);
  // When candump listens nobody tells; so it is sent until it was heard.
  std::size_t n = 0;
  std::thread reader([&] { n = std::fread(line.data(), 1, line.size(), dump); });
  std::uint32_t tag = 1;
  const auto end = std::chrono::steady_clock::now() + 120s;
  while (n == 0 && std::chrono::steady_clock::now() < end) {
    a->send(can::Frame::base(0x581, {0x43}), tag++);
    test::idle(loop_, 50ms);
  }
  reader.join();
  ::pclose(dump);
  EXPECT_NE(line.find("581#43"), std::string::npos) << line;
}

TEST_F(SocketCan, FdFramesGoWhereTheInterfaceTakesThem) {
  auto a = open();
  auto b = open();
  ASSERT_TRUE(a && b);
  Ear ear(executor_);
  Ear own(executor_);
  a->listen(&own, everything);
  b->listen(&ear, everything);
  can::Frame f;
  f.id = 0x123;
  f.fd = f.brs = true;
  f.size = 64;
  for (std::size_t i = 0; i < 64; ++i) f.data[i] = static_cast<std::uint8_t>(i * 3);
  ASSERT_EQ(a->send(f, 5), can::Queued::yes);
  ASSERT_TRUE(until([&] { return ear.frames == 1 && own.confirmed == 1; }));
  EXPECT_EQ(ear.last_frame, f);
  f.size = 9;  // no such length
  EXPECT_EQ(a->send(f, 6), can::Queued::closed);
  vcan_->down();
  ASSERT_TRUE(shell("ip link set bvcan0 mtu 16 up"));
  ASSERT_TRUE(until([&] { return own.states.size() >= 2 && own.states.back().up; }));
  f.size = 8;
  EXPECT_EQ(a->send(f, 7), can::Queued::closed);
  EXPECT_EQ(a->send(can::Frame::base(0x123, {1}), 8), can::Queued::yes);
  ASSERT_TRUE(until([&] { return own.confirmed == 2; }));
}

TEST_F(SocketCan, DownAndUpAreToldAndNothingOldIsSent) {
  auto a = open({.bit_rate = 125'000});
  ASSERT_TRUE(a);
  Ear ear(executor_);
  a->listen(&ear, everything);
  vcan_->down();
  ASSERT_TRUE(until([&] { return !ear.log.empty(); }));
  EXPECT_EQ(ear.log.back(), "down");
  EXPECT_FALSE(a->status().up);
  EXPECT_EQ(a->send(can::Frame::base(0x1, {}), 1), can::Queued::closed);
  vcan_->up();
  ASSERT_TRUE(until([&] { return ear.log.size() == 2; }));
  EXPECT_EQ(ear.log.back(), "up");
  EXPECT_EQ(ear.states.back().bit_rate, 125'000U);
  EXPECT_EQ(a->send(can::Frame::base(0x2, {}), 2), can::Queued::yes);
  loop_.serve();
  cansend("003#");
  ASSERT_TRUE(until([&] { return ear.log.size() == 4; }));
  EXPECT_EQ(ear.log, (std::vector<std::string>{"down", "up", "sent 2", "< 003#"}));
}

TEST_F(SocketCan, AnInterfaceThatVanishesAndComesBackIsBoundAgainAndWhatItReceivedIsDelivered) {
  auto a = open();
  auto b = open();
  ASSERT_TRUE(a && b);
  Ear ear(executor_);
  Ear other(executor_);
  a->listen(&ear, everything);
  b->listen(&other, everything);
  for (int round = 0; round < 3; ++round) {
    ear.log.clear();
    cansend("123#01");  // waits in the socket while the interface goes
    vcan_->drop();
    ASSERT_TRUE(until([&] { return ear.log.size() >= 2; }));
    EXPECT_EQ(ear.log.size(), 2U);
    EXPECT_EQ(std::ranges::count(ear.log, "< 123#01"), 1);
    EXPECT_EQ(std::ranges::count(ear.log, "down"), 1);
    EXPECT_EQ(a->send(can::Frame::base(0x1, {}), 1), can::Queued::closed);
    test::idle(loop_, 30ms);  // it is not bound again while there is none
    vcan_->make();
    ASSERT_TRUE(until([&] { return a->status().up && b->status().up; }));
    ASSERT_EQ(a->send(can::Frame::base(0x42, {1}), 2), can::Queued::yes);
    ASSERT_TRUE(until([&] { return ear.log.back() == "sent 2" && other.log.back() == "< 042#01"; }));
    cansend("333#03");
    ASSERT_TRUE(until([&] { return ear.log.back() == "< 333#03"; }));
  }
}

TEST_F(SocketCan, GoneAndBackBeforeAnybodyLooked) {
  auto a = open();
  ASSERT_TRUE(a);
  Ear ear(executor_);
  a->listen(&ear, everything);
  vcan_->drop();
  vcan_->make();
  ASSERT_TRUE(until([&] { return ear.log.size() >= 2; }));
  EXPECT_EQ(ear.log, (std::vector<std::string>{"down", "up"}));
  cansend("321#");
  ASSERT_TRUE(until([&] { return ear.frames == 1; }));
}

// Another program's frames while nobody reads.
class Flood {
 public:
  explicit Flood(const char* interface) : fd_(::socket(PF_CAN, SOCK_RAW, CAN_RAW)) {
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(interface));
    const void* const plain = &address;
    EXPECT_EQ(::bind(fd_, static_cast<const sockaddr*>(plain), sizeof address), 0);
  }
  ~Flood() { ::close(fd_); }
  Flood(const Flood&) = delete;
  Flood& operator=(const Flood&) = delete;
  bool send(std::uint32_t count) {
    can_frame f{};
    f.can_id = 0x123;
    f.len = 4;
    for (std::uint32_t i = 0; i < count; ++i) {
      std::memcpy(f.data, &i, sizeof i);
      if (::write(fd_, &f, sizeof f) != sizeof f) return false;
    }
    return true;
  }

 private:
  int fd_;
};

TEST_F(SocketCan, OfABurstThatNobodyReadNothingIsLostUncounted) {
  auto a = open();
  ASSERT_TRUE(a);
  Ear ear(executor_);
  ear.keeps_log = false;
  a->listen(&ear, everything);
  Flood flood("bvcan0");
  ASSERT_TRUE(flood.send(20'000));  // a second of a full bus at 1 Mbit/s
  ASSERT_TRUE(until([&] { return ear.frames + a->status().lost == 20'000; }))
      << ear.frames << " received, " << a->status().lost << " lost";
  EXPECT_EQ(a->status().lost, 0U);
  ASSERT_TRUE(flood.send(40'000));  // more than the receive buffer holds
  ASSERT_TRUE(until([&] { return ear.frames + a->status().lost == 60'000; }))
      << ear.frames << " received, " << a->status().lost << " lost";
  EXPECT_GT(a->status().lost, 0U);
  EXPECT_GT(ear.frames, 30'000U);
  const auto lost = a->status().lost;
  const auto before = ear.frames;
  ASSERT_TRUE(flood.send(500));
  ASSERT_TRUE(until([&] { return ear.frames == before + 500; }));
  EXPECT_EQ(a->status().lost, lost);
}

TEST_F(SocketCan, SendersAndReceiversInOneLoopLoseNothing) {
  constexpr std::uint32_t all = 5'000;
  auto a = open();
  auto b = open();
  ASSERT_TRUE(a && b);
  Ear ear(executor_);
  Ear own(executor_);
  ear.keeps_log = own.keeps_log = false;
  a->listen(&own, {});
  b->listen(&ear, everything);
  std::uint32_t given = 0;
  const auto go_on = [&] {
    for (int i = 0; i < 50 && given < all; ++i) {
      can::Frame f = can::Frame::base(0x200 + given % 64, {0, 0, 0, 0});
      std::memcpy(f.data.data(), &given, 4);
      if (a->send(f, given + 1) != can::Queued::yes) break;
      ++given;
    }
    loop_.serve();
    return ear.frames >= all && own.confirmed >= all;
  };
  EXPECT_TRUE(test::until(loop_, go_on, 120s));
  EXPECT_EQ(ear.frames, all);
  EXPECT_EQ(own.confirmed, all);
  EXPECT_EQ(b->status().lost, 0U);
  EXPECT_TRUE(own.times_hold && ear.times_hold);
}

TEST_F(SocketCan, TheLabelOfAVirtualInterfaceCanBeChanged) {
  auto a = open({.bit_rate = 125'000});
  ASSERT_TRUE(a);
  EXPECT_FALSE(a->restart(0));
  EXPECT_TRUE(a->restart(500'000));
  EXPECT_EQ(a->status().bit_rate, 500'000U);
  EXPECT_TRUE(a->status().up);
}

TEST_F(SocketCan, ListenOnlySendsNothing) {
  auto a = open({.listen_only = true});
  ASSERT_TRUE(a);
  EXPECT_TRUE(a->status().listen_only);
  EXPECT_EQ(a->send(can::Frame::base(1, {}), 1), can::Queued::listen_only);
}

TEST_F(SocketCan, WhatIsWrongWhenOpeningIsSaidWithTheCommandThatHelps) {
  vcan_->down();
  auto port = open_port(loop_, {can::PortKind::socketcan, "bvcan0"}, {});
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error(), "socketcan:bvcan0: is down; as root: ip link set bvcan0 up");
  port = open_port(loop_, {can::PortKind::socketcan, "bvcan0"}, {.bit_rate = 125'000});  // root may
  EXPECT_TRUE(port) << port.error();
  port = open_port(loop_, {can::PortKind::socketcan, "vcan77"}, {});
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error(),
            "socketcan:vcan77: there is no such interface; as root: ip link add dev vcan77 type vcan && ip link set "
            "vcan77 up");
  port = open_port(loop_, {can::PortKind::socketcan, "lo"}, {});
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error(), "socketcan:lo: is not a CAN interface");
  port = open_port(loop_, {can::PortKind::socketcan, "a-name-that-is-too-long"}, {});
  ASSERT_FALSE(port);
}

// Error frames come from drivers; another program can write them, too.
TEST_F(SocketCan, ErrorFramesTellTheState) {
  auto a = open({.bit_rate = 125'000});
  ASSERT_TRUE(a);
  Ear ear(executor_);
  a->listen(&ear, everything);
  cansend("20000088#0000040000000000");
  ASSERT_TRUE(until([&] { return a->status().errors >= 1; }));
  EXPECT_TRUE(ear.log.empty());  // not for each error
  cansend("20000204#0020000000008005");
  ASSERT_TRUE(until([&] { return ear.states.size() == 1; }));
  EXPECT_TRUE(ear.states[0].error_passive() && ear.states[0].knows_counters);
  EXPECT_EQ(ear.states[0].tec, 128);
  EXPECT_EQ(ear.states[0].rec, 5);
  cansend("20000004#0001000000000000");
  ASSERT_TRUE(until([&] { return a->status().lost == 1; }));
  cansend("20000040#0000000000000000");
  ASSERT_TRUE(until([&] { return a->status().bus_off; }));
  EXPECT_TRUE(a->status().up);
  EXPECT_EQ(a->send(can::Frame::base(1, {}), 1), can::Queued::bus_off);
  cansend("20000100#0000000000000000");
  ASSERT_TRUE(until([&] { return !a->status().bus_off; }));
  EXPECT_EQ(a->status().tec, 0);
  cansend("20000040#0000000000000000");
  ASSERT_TRUE(until([&] { return a->status().bus_off; }));
  EXPECT_TRUE(a->restart(125'000));
  EXPECT_FALSE(a->status().bus_off);
  EXPECT_EQ(a->send(can::Frame::base(1, {}), 1), can::Queued::yes);
  ASSERT_TRUE(until([&] { return ear.confirmed == 1; }));
}

// ---- two emulated controllers on one bus ----

class Controllers : public ::testing::Test {
 protected:
  void SetUp() override {
    auto why = test::no_interface("can0");
    if (why.empty()) why = test::no_interface("can1");
    if (!why.empty()) GTEST_SKIP() << why;
    ASSERT_TRUE(shell(
        "ip link set can0 down; ip link set can1 down; ip link set can0 type can listen-only off bitrate 250000"));
    ASSERT_TRUE(shell("ip link set can1 txqueuelen 10 type can bitrate 250000 && ip link set can1 up"));
    ASSERT_TRUE(shell("ip link set can0 txqueuelen 10 up"));
    ASSERT_TRUE(test::runs("can0") && test::runs("can1"));
  }
  std::unique_ptr<SocketCanPort> open(const std::string& name, const PortOptions& options) {
    auto port = SocketCanPort::open(loop_, name, options);
    EXPECT_TRUE(port) << port.error();
    return port ? std::move(*port) : nullptr;
  }
  bool until(const std::function<bool()>& holds) { return test::until(loop_, holds); }
  static bool shows(const std::string& name, const std::string& words) {
    return shell("ip -details link show " + name + " | grep -q '" + words + "'");
  }
  rt::Executor executor_;
  Loop loop_{executor_};
};

TEST_F(Controllers, TheirRateIsReadAndSetAndFramesGoAcross) {
  auto a = open("can0", {});
  ASSERT_TRUE(a);
  EXPECT_EQ(a->status().bit_rate, 250'000U);
  EXPECT_FALSE(a->status().bit_rate_is_label);
  EXPECT_TRUE(a->status().knows_sent && a->status().knows_counters && a->status().up);
  auto b = open("can1", {.bit_rate = 125'000});
  ASSERT_TRUE(b);
  EXPECT_TRUE(shows("can1", "bitrate 125000 sample-point 0.875"));
  Ear ear_a(executor_);
  Ear ear_b(executor_);
  a->listen(&ear_a, everything);
  b->listen(&ear_b, everything);
  EXPECT_TRUE(a->restart(125'000)) << a->trouble();
  EXPECT_TRUE(shows("can0", "bitrate 125000"));
  EXPECT_TRUE(a->status().up);
  ASSERT_EQ(a->send(can::Frame::base(0x601, {1, 2}), 1), can::Queued::yes);
  ASSERT_TRUE(until([&] { return ear_b.frames == 1 && ear_a.confirmed == 1; }));
  EXPECT_TRUE(ear_a.times_hold && ear_b.times_hold);
  EXPECT_EQ(ear_a.frames, 0U);
  EXPECT_FALSE(a->restart(7'777'777));
  EXPECT_NE(a->trouble().find("ip link set can0"), std::string::npos) << a->trouble();
  ASSERT_TRUE(until([&] { return a->status().up; }));  // put back
  EXPECT_EQ(a->status().bit_rate, 125'000U);
  test::idle(loop_, 1500ms);  // it is looked at again each second, and stays up
  EXPECT_TRUE(a->status().up);
}

TEST_F(Controllers, WithoutTheRightTheErrorHasTheCommand) {
  ASSERT_EQ(::seteuid(65534), 0);
  const auto other = SocketCanPort::open(loop_, "can0", {.bit_rate = 500'000});
  const auto same = SocketCanPort::open(loop_, "can0", {.bit_rate = 250'000});
  const bool restarts = same && (*same)->restart(125'000);
  ASSERT_EQ(::seteuid(0), 0);
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error(),
            "can0: setting it up needs root or CAP_NET_ADMIN; as root: ip link set can0 down && "
            "ip link set can0 up type can bitrate 500000");
  ASSERT_TRUE(same);
  EXPECT_FALSE(restarts);
  EXPECT_NE((*same)->trouble().find("bitrate 125000"), std::string::npos);
  EXPECT_TRUE((*same)->status().up);
  EXPECT_TRUE(shows("can0", "bitrate 250000"));
}

TEST_F(Controllers, AListenerThatSetsTheRateIsSilentAndPutsBackWhatWas) {
  {
    auto a = open("can0", {.bit_rate = 125'000, .listen_only = true});
    ASSERT_TRUE(a);
    EXPECT_TRUE(shows("can0", "LISTEN-ONLY"));
    EXPECT_TRUE(a->status().listen_only);
    EXPECT_TRUE(a->restart(500'000)) << a->trouble();
    EXPECT_TRUE(shows("can0", "LISTEN-ONLY"));
    EXPECT_TRUE(shows("can0", "bitrate 500000"));
  }
  EXPECT_FALSE(shows("can0", "LISTEN-ONLY"));
  EXPECT_TRUE(shows("can0", "bitrate 250000"));
  auto a = open("can0", {.bit_rate = 250'000, .listen_only = true});  // as wanted: stays
  ASSERT_TRUE(a);
  EXPECT_FALSE(shows("can0", "LISTEN-ONLY"));
}

TEST_F(Controllers, DownAndUp) {
  auto a = open("can0", {});
  ASSERT_TRUE(a);
  Ear ear(executor_);
  a->listen(&ear, everything);
  ASSERT_TRUE(shell("ip link set can0 down"));
  ASSERT_TRUE(until([&] { return !a->status().up; }));
  EXPECT_NE(a->trouble().find("ip link set can0 up type can bitrate 250000"), std::string::npos) << a->trouble();
  ASSERT_TRUE(shell("ip link set can0 type can bitrate 1000000 && ip link set can0 up"));
  ASSERT_TRUE(until([&] { return a->status().up; }));
  EXPECT_EQ(a->status().bit_rate, 1'000'000U);
  EXPECT_TRUE(a->trouble().empty());
  ASSERT_EQ(a->send(can::Frame::base(1, {}), 1), can::Queued::yes);
  ASSERT_TRUE(until([&] { return ear.confirmed == 1; }));
}

TEST_F(Controllers, ABurstGoesOutInOrderAndWhatOverranIsCounted) {
  auto a = open("can0", {});
  auto b = open("can1", {});
  ASSERT_TRUE(a && b);
  Ear ear_a(executor_);
  Ear ear_b(executor_);
  ear_b.keeps_log = false;
  a->listen(&ear_a, {});
  b->listen(&ear_b, everything);
  std::uint32_t given = 0;
  ASSERT_TRUE(until([&] {
    while (given < 600 &&
           a->send(can::Frame::base(0x100 + given % 256, {1, 2, 3, 4, 5, 6, 7, 8}), given + 1) == can::Queued::yes)
      ++given;
    return ear_a.confirmed == 600;
  })) << ear_a.confirmed;
  for (std::uint32_t i = 0; i < 600; ++i) ASSERT_EQ(ear_a.log[i], "sent " + std::to_string(i + 1));
  test::idle(loop_, 200ms);
  std::printf("600 frames from controller to controller: %u received, %u losses told\n", ear_b.frames,
              b->status().lost);
  EXPECT_TRUE(ear_b.frames == 600 || b->status().lost > 0);
}

// ---- a serial adapter's kernel driver: its queue fills when nobody reads the line ----

class FullQueue : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto why = test::no_interface("vcan0");
    if (!why.empty()) GTEST_SKIP() << why;
    master_ = ::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    ASSERT_GE(master_, 0);
    ASSERT_EQ(::grantpt(master_), 0);
    ASSERT_EQ(::unlockpt(master_), 0);
    slave_ = ::open(::ptsname(master_), O_RDWR | O_NOCTTY);
    ASSERT_GE(slave_, 0);
    const int slcan = 17;  // N_SLCAN
    if (::ioctl(slave_, TIOCSETD, &slcan) != 0) GTEST_SKIP() << "no slcan in this kernel: " << std::strerror(errno);
    char name[64] = {};
    ASSERT_EQ(::ioctl(slave_, SIOCGIFNAME, name), 0);
    name_ = name;
    ASSERT_TRUE(shell("ip link set " + name_ + " txqueuelen 10 up"));
    ASSERT_TRUE(test::runs(name_));
  }
  void TearDown() override {
    if (slave_ >= 0) ::close(slave_);
    if (master_ >= 0) ::close(master_);
  }
  bool until(const std::function<bool()>& holds) { return test::until(loop_, holds); }
  std::string read_line() {
    std::string all(65536, 0);
    const auto n = ::read(master_, all.data(), all.size());
    all.resize(n > 0 ? static_cast<std::size_t>(n) : 0);
    return all;
  }
  rt::Executor executor_;
  Loop loop_{executor_};
  int master_ = -1;
  int slave_ = -1;
  std::string name_;
};

TEST_F(FullQueue, WhatTheKernelDoesNotTakeWaitsInOrderAndCanBeWithdrawn) {
  auto port = SocketCanPort::open(loop_, name_, {});
  ASSERT_TRUE(port) << port.error();
  can::Port& p = **port;
  Ear ear(executor_);
  p.listen(&ear, {});
  // Until this port's own queue is full: the line's, the kernel's and that are.
  std::uint32_t given = 0;
  while (given < 20'000 &&
         p.send(can::Frame::base(0x123, {static_cast<std::uint8_t>(given >> 8U), static_cast<std::uint8_t>(given)}),
                given + 1) == can::Queued::yes)
    ++given;
  ASSERT_LT(given, 20'000U);
  ASSERT_GT(given, SocketCanPort::queue_depth);
  EXPECT_EQ(p.send(can::Frame::base(0x7FF, {}), 0), can::Queued::full);
  EXPECT_GE(p.status().queued, SocketCanPort::queue_depth);
  p.withdraw(given);  // the last, which waits here
  std::string expected;
  for (std::uint32_t i = 0; i + 1 < given; ++i) {
    char text[32];
    std::snprintf(text, sizeof text, "t1232%04X\r", i);
    expected += text;
  }
  // The driver takes one after the other when the line was read.
  std::string line;
  const auto of_frames = [&line] { return line.substr(std::min(line.find("t123"), line.size())); };
  EXPECT_TRUE(until([&] {
    line += read_line();
    return of_frames().size() >= expected.size();
  }));
  test::idle(loop_, 100ms);
  line += read_line();
  EXPECT_TRUE(of_frames() == expected) << of_frames().size() << " bytes of " << expected.size();
  ASSERT_TRUE(until([&] { return ear.confirmed == given - 1; }));
  for (std::uint32_t i = 0; i + 1 < given; ++i) ASSERT_EQ(ear.log[i], "sent " + std::to_string(i + 1));
  std::printf("%u frames given until full, all but the withdrawn one on the line in order\n", given);
}

// The adapter is pulled out while frames wait.
TEST_F(FullQueue, AnAdapterPulledOutTakesItsFramesAlong) {
  auto port = SocketCanPort::open(loop_, name_, {});
  ASSERT_TRUE(port) << port.error();
  can::Port& p = **port;
  Ear ear(executor_);
  p.listen(&ear, {});
  std::uint32_t given = 0;
  while (given < 20'000 && p.send(can::Frame::base(0x123, {1}), given + 1) == can::Queued::yes) ++given;
  ::close(slave_);
  ::close(master_);
  slave_ = master_ = -1;
  ASSERT_TRUE(test::until(loop_, [&] { return !p.status().up; }));
  EXPECT_EQ(p.status().queued, 0);
  EXPECT_EQ(p.send(can::Frame::base(1, {}), 1), can::Queued::closed);
  EXPECT_EQ(std::ranges::count(ear.log, "down"), 1);
}

}  // namespace
}  // namespace berth::io
