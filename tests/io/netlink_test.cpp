#include "berth/io/netlink.hpp"

#include <gtest/gtest.h>
#include <cstdint>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/io/socketcan_setup.hpp"

namespace berth::io {
namespace {

// Bytes as on x86 and ARM: the kernel's messages are in host order.
using Bytes = std::vector<std::uint8_t>;

Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}
Bytes u32(std::uint32_t v) {
  return {static_cast<std::uint8_t>(v), static_cast<std::uint8_t>(v >> 8U), static_cast<std::uint8_t>(v >> 16U),
          static_cast<std::uint8_t>(v >> 24U)};
}
Bytes u16(unsigned v) { return {static_cast<std::uint8_t>(v), static_cast<std::uint8_t>(v >> 8U)}; }
// rtnetlink(7): length and type, the value, padded to 4.
Bytes attribute(unsigned type, const Bytes& value) {
  Bytes a = u16(static_cast<unsigned>(4 + value.size())) + u16(type) + value;
  while (a.size() % 4 != 0) a.push_back(0);
  return a;
}
Bytes text(std::string_view t) {
  Bytes b(t.begin(), t.end());
  b.push_back(0);
  return b;
}
// netlink(7): length, type, flags, sequence, port.
Bytes message(unsigned type, unsigned flags, std::uint32_t sequence, const Bytes& body) {
  return u32(static_cast<std::uint32_t>(16 + body.size())) + u16(type) + u16(flags) + u32(sequence) + u32(0) + body;
}
// struct ifinfomsg: family, padding, type, index, flags, change.
Bytes info(unsigned type, std::uint32_t index, std::uint32_t flags) {
  return Bytes{0, 0} + u16(type) + u32(index) + u32(flags) + u32(0);
}

constexpr unsigned new_link = 16, del_link = 17, get_link = 18, nl_error = 2;  // RTM_*, NLMSG_ERROR
constexpr unsigned arphrd_can = 280;
constexpr unsigned mtu = 4, ifname = 3, txqlen = 13, linkinfo = 18, kind = 1, data = 2;                    // IFLA_*
constexpr unsigned bittiming = 1, can_state = 4, ctrlmode = 5, restart_ms = 6, berr = 8, data_timing = 9;  // IFLA_CAN_*

Bytes bit_timing(std::uint32_t rate) { return u32(rate) + Bytes(28, 0); }

// As `ip -details link show can0` shows: UP, RUNNING, ECHO, LOWER_UP; 250 kbit/s, error passive, listen-only,
// restart-ms 100.
Bytes can0() {
  const Bytes controller = attribute(bittiming, bit_timing(250'000)) + attribute(can_state, u32(2)) +
                           attribute(ctrlmode, u32(0) + u32(0x02 | 0x10)) + attribute(restart_ms, u32(100)) +
                           attribute(berr, u16(130) + u16(7)) + attribute(data_timing, bit_timing(2'000'000));
  return message(new_link, 0, 0,
                 info(arphrd_can, 5, 0x10000 | 0x40000 | 0x40 | 0x1) + attribute(ifname, text("can0")) +
                     attribute(mtu, u32(16)) + attribute(txqlen, u32(10)) + attribute(0x7FFF, Bytes{1, 2, 3}) +
                     attribute(linkinfo | 0x8000, attribute(kind, text("can")) + attribute(data | 0x8000, controller)));
}

TEST(Netlink, AControllerIsReadWhole) {
  const auto notices = decode_links(can0());
  ASSERT_EQ(notices.size(), 1U);
  EXPECT_EQ(notices[0].kind, LinkNotice::Kind::link);
  const Link& l = notices[0].link;
  EXPECT_EQ(l.index, 5);
  EXPECT_EQ(l.name, "can0");
  EXPECT_EQ(l.kind, "can");
  EXPECT_TRUE(l.can && l.up && l.running && l.echo && l.controller());
  EXPECT_EQ(l.mtu, 16U);
  EXPECT_EQ(l.queue, 10U);
  EXPECT_EQ(l.bit_rate, 250'000U);
  EXPECT_EQ(l.data_bit_rate, 2'000'000U);
  EXPECT_EQ(l.state, CanState::passive);
  EXPECT_TRUE(l.listen_only && l.reports_errors && l.counts);
  EXPECT_EQ(l.restart_ms, 100U);
  EXPECT_EQ(l.tec, 130);
  EXPECT_EQ(l.rec, 7);
}

TEST(Netlink, AVirtualInterfaceHasNoRateAndAnyOtherIsNoCan) {
  const Bytes vcan = message(new_link, 0, 9,
                             info(arphrd_can, 3, 0x10000 | 0x40 | 1) + attribute(ifname, text("vcan0")) +
                                 attribute(mtu, u32(72)) + attribute(linkinfo, attribute(kind, text("vcan"))));
  const Bytes lo = message(new_link, 0, 0, info(772, 1, 0x49) + attribute(ifname, text("lo")));
  const Bytes gone = message(del_link, 0, 0, info(arphrd_can, 5, 0) + attribute(ifname, text("can0")));
  const auto notices = decode_links(vcan + lo + gone);
  ASSERT_EQ(notices.size(), 3U);
  EXPECT_EQ(notices[0].sequence, 9U);
  EXPECT_TRUE(notices[0].link.can && !notices[0].link.controller() && !notices[0].link.echo);
  EXPECT_EQ(notices[0].link.bit_rate, 0U);
  EXPECT_EQ(notices[0].link.mtu, 72U);
  EXPECT_FALSE(notices[1].link.can);
  EXPECT_EQ(notices[2].kind, LinkNotice::Kind::gone);
  EXPECT_EQ(notices[2].link.index, 5);
}

// The data stands before the kind that explains it.
TEST(Netlink, TheOrderOfAttributesDoesNotMatter) {
  const Bytes m =
      message(new_link, 0, 0,
              info(arphrd_can, 2, 0) +
                  attribute(linkinfo, attribute(data, attribute(can_state, u32(3))) + attribute(kind, text("can"))) +
                  attribute(ifname, text("can1")));
  const auto notices = decode_links(m);
  ASSERT_EQ(notices.size(), 1U);
  EXPECT_EQ(notices[0].link.state, CanState::bus_off);
  EXPECT_EQ(notices[0].link.name, "can1");
}

// slcan's CAN_BITRATE_UNKNOWN
TEST(Netlink, AnUnknownRateIsNone) {
  const Bytes m = message(
      new_link, 0, 0,
      info(arphrd_can, 2, 0) + attribute(linkinfo, attribute(kind, text("can")) +
                                                       attribute(data, attribute(bittiming, bit_timing(0xFFFFFFFF)))));
  const auto notices = decode_links(m);
  ASSERT_EQ(notices.size(), 1U);
  EXPECT_EQ(notices[0].link.bit_rate, 0U);
}

TEST(Netlink, AReplyHasItsErrorAndTheKernelsWords) {
  const Bytes request_head = u32(32) + u16(16) + u16(5) + u32(7) + u32(0);
  const auto done = decode_links(message(nl_error, 0x100, 7, u32(0) + request_head));  // capped
  ASSERT_EQ(done.size(), 1U);
  EXPECT_EQ(done[0].kind, LinkNotice::Kind::reply);
  EXPECT_EQ(done[0].error, 0);
  EXPECT_EQ(done[0].sequence, 7U);
  const auto refused =
      decode_links(message(nl_error, 0x100 | 0x200, 7,
                           u32(static_cast<std::uint32_t>(-22)) + request_head + attribute(1, text("too fast"))));
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_EQ(refused[0].error, 22);  // EINVAL
  EXPECT_EQ(refused[0].text, "too fast");
  // Not capped: the whole request stands before the words.
  const auto whole = decode_links(
      message(nl_error, 0x200, 7,
              u32(static_cast<std::uint32_t>(-1)) + request_head + Bytes(16, 0xEE) + attribute(1, text("no"))));
  ASSERT_EQ(whole.size(), 1U);
  EXPECT_EQ(whole[0].error, 1);
  EXPECT_EQ(whole[0].text, "no");
}

TEST(Netlink, RequestsAsTheKernelReadsThem) {
  // IFLA_EXT_MASK 29: RTEXT_FILTER_SKIP_STATS 8
  EXPECT_EQ(ask_link(3, "can0"),
            message(get_link, 1, 3, info(0, 0, 0) + attribute(ifname, text("can0")) + attribute(29, u32(8))));
  EXPECT_TRUE(ask_link(3, "").empty());
  EXPECT_TRUE(ask_link(3, "sixteen-is-too-l").empty());
  EXPECT_FALSE(ask_link(3, "fifteen-is-good").empty());
  Bytes down = message(new_link, 5, 4, info(0, 9, 0));
  down[16 + 12] = 1;  // change: IFF_UP
  EXPECT_EQ(change_link(4, 9, {.up = false}), down);
  Bytes set =
      message(new_link, 5, 4,
              info(0, 9, 1) +
                  attribute(linkinfo | 0x8000, attribute(kind, text("can")) +
                                                   attribute(data | 0x8000, attribute(bittiming, bit_timing(125'000)) +
                                                                                attribute(ctrlmode, u32(2) + u32(2)))));
  set[16 + 12] = 1;
  EXPECT_EQ(change_link(4, 9, {.up = true, .bit_rate = 125'000, .listen_only = true}), set);
  const Bytes again =
      message(new_link, 5, 4,
              info(0, 9, 0) + attribute(linkinfo | 0x8000,
                                        attribute(kind, text("can")) + attribute(data | 0x8000, attribute(7, u32(1)))));
  EXPECT_EQ(change_link(4, 9, {.restart = true}), again);
}

// Every beginning, and anything with some bytes wrong: no crash, and what stood whole before counts.
TEST(Netlink, WhatIsCutOrWrongEndsTheReading) {
  const Bytes two = can0() + can0();
  for (std::size_t n = 0; n < two.size(); ++n) {
    const auto notices = decode_links(std::span(two).first(n));
    ASSERT_EQ(notices.size(), n / can0().size());
  }
  Random r(3);
  for (int i = 0; i < 20'000; ++i) {
    Bytes wrong = two;
    for (auto k = r.below(6) + 1; k > 0; --k) wrong[r.below(wrong.size())] = static_cast<std::uint8_t>(r.below(256));
    EXPECT_LE(decode_links(wrong).size(), wrong.size() / 16);
  }
}

// ---- what is to be done, and what a person types ----

Link controller(std::uint32_t rate, bool up, bool listen_only = false) {
  Link l;
  l.index = 1;
  l.name = "can0";
  l.kind = "can";
  l.can = true;
  l.up = l.running = up;
  l.bit_rate = rate;
  l.listen_only = listen_only;
  return l;
}

TEST(SocketCanSetup, NothingIsDoneUnasked) {
  EXPECT_TRUE(steps_to(controller(0, false), {}, true).none());
  EXPECT_TRUE(steps_to(controller(125'000, true), {.listen_only = true}, true).none());
  EXPECT_TRUE(steps_to(controller(125'000, true), {.bit_rate = 125'000}, false).none());
}

TEST(SocketCanSetup, OneThatIsUpAsWantedStaysAsOthersUseIt) {
  EXPECT_TRUE(steps_to(controller(125'000, true), {.bit_rate = 125'000, .listen_only = true}, false).none());
  const auto strictly = steps_to(controller(125'000, true), {.bit_rate = 125'000, .listen_only = true}, true);
  EXPECT_TRUE(strictly.first_down);
  EXPECT_EQ(strictly.change.listen_only, true);
  EXPECT_EQ(strictly.change.up, true);
  EXPECT_FALSE(strictly.change.bit_rate);
}

TEST(SocketCanSetup, AnotherRateWantsDownAndUpAndTakesTheModeAlong) {
  const auto steps = steps_to(controller(125'000, true), {.bit_rate = 250'000, .listen_only = true}, false);
  EXPECT_TRUE(steps.first_down);
  EXPECT_EQ(steps.change.bit_rate, 250'000U);
  EXPECT_EQ(steps.change.listen_only, true);
  EXPECT_EQ(steps.change.up, true);
  const auto from_down = steps_to(controller(0, false), {.bit_rate = 250'000}, false);
  EXPECT_FALSE(from_down.first_down);
  EXPECT_EQ(from_down.change.bit_rate, 250'000U);
  EXPECT_FALSE(from_down.change.listen_only);
  const auto loud = steps_to(controller(250'000, true, true), {.bit_rate = 250'000}, false);
  EXPECT_TRUE(loud.first_down);
  EXPECT_EQ(loud.change.listen_only, false);
}

TEST(SocketCanSetup, AVirtualOneIsOnlyBroughtUp) {
  Link v;
  v.name = "vcan0";
  v.kind = "vcan";
  const auto steps = steps_to(v, {.bit_rate = 250'000, .listen_only = true}, true);
  EXPECT_FALSE(steps.first_down || steps.change.bit_rate || steps.change.listen_only);
  EXPECT_EQ(steps.change.up, true);
  EXPECT_EQ(ip_command(v, {.bit_rate = 250'000}), "ip link set vcan0 up");
}

TEST(SocketCanSetup, TheCommandIsWhatAPersonTypes) {
  EXPECT_EQ(ip_command(controller(0, false), {}), "ip link set can0 up type can bitrate RATE");
  EXPECT_EQ(ip_command(controller(125'000, false), {}), "ip link set can0 up type can bitrate 125000");
  EXPECT_EQ(ip_command(controller(125'000, true), {.bit_rate = 500'000}),
            "ip link set can0 down && ip link set can0 up type can bitrate 500000");
  EXPECT_EQ(ip_command(controller(125'000, true), {.bit_rate = 500'000, .listen_only = true}),
            "ip link set can0 down && ip link set can0 up type can bitrate 500000 listen-only on");
}

}  // namespace
}  // namespace berth::io
