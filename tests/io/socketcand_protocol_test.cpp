#include "berth/io/socketcand_protocol.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/io/stream.hpp"

namespace berth::io::socketcand_protocol_tests {
namespace {

using namespace std::chrono_literals;
using Kind = SocketcandCommand::Kind;
using Said = SocketcandNotice::Kind;

std::vector<std::string> all(ElementReader& reader) {
  std::vector<std::string> found;
  while (const auto element = reader.next()) found.emplace_back(*element);
  return found;
}

using Texts = std::vector<std::string>;

TEST(Socketcand, ElementsInAnyPieces) {
  const std::string stream = "< hi >< ok >\r\n< frame 123 1.000001  >  <rawmode>";
  const Texts expected{"hi", "ok", "frame 123 1.000001", "rawmode"};
  for (std::size_t piece = 1; piece <= stream.size(); ++piece) {
    ElementReader reader;
    Texts found;
    for (std::size_t i = 0; i < stream.size(); i += piece) {
      reader.add(std::string_view(stream).substr(i, piece));
      for (auto& element : all(reader)) found.push_back(std::move(element));
    }
    EXPECT_EQ(found, expected) << piece;
    EXPECT_EQ(reader.faults(), 0U);
    EXPECT_EQ(reader.kept(), 0U);
  }
}

TEST(Socketcand, WhatIsNoElementIsAFaultWithItsPlace) {
  ElementReader reader;
  reader.add("< hi > GET / HTTP/1.1\r\n\r\n");
  EXPECT_EQ(all(reader), Texts{"hi"});
  EXPECT_EQ(reader.faults(), 1U);
  EXPECT_EQ(reader.fault_at(), 7U);
  reader.add("x< echo >");  // the same rubbish goes on
  EXPECT_EQ(all(reader), Texts{"echo"});
  EXPECT_EQ(reader.faults(), 1U);
  reader.add("y< echo >");
  EXPECT_EQ(all(reader), Texts{"echo"});
  EXPECT_EQ(reader.faults(), 2U);
}

TEST(Socketcand, AnElementThatNeverEndsIsBounded) {
  ElementReader reader;
  for (int i = 0; i < 1000; ++i) {
    reader.add(std::string(1000, i % 2 == 0 ? 'a' : '<'));
    EXPECT_FALSE(reader.next());
    EXPECT_LE(reader.kept(), longest_element + 1000);
  }
  EXPECT_EQ(reader.faults(), 1U);
  reader.add(">< echo >");
  const auto found = all(reader);
  ASSERT_FALSE(found.empty());
  EXPECT_EQ(found.back(), "echo");
}

TEST(Socketcand, TheLongestElementIsOneAndOneMoreIsNone) {
  ElementReader reader;
  reader.add('<' + std::string(longest_element - 2, 'a') + '>');
  ASSERT_EQ(all(reader).size(), 1U);
  EXPECT_EQ(reader.faults(), 0U);
  reader.add('<' + std::string(longest_element - 1, 'a') + '>');
  EXPECT_TRUE(all(reader).empty());
  EXPECT_EQ(reader.faults(), 1U);
}

// From doc/protocol.md, and what python-can 4.1 and 4.4 send.
TEST(Socketcand, Commands) {
  auto c = parse_command("open can0");
  EXPECT_EQ(c.kind, Kind::open);
  EXPECT_EQ(c.bus, "can0");
  c = parse_command("open left side ");
  EXPECT_EQ(c.bus, "left side");
  c = parse_command("send 123 0");
  EXPECT_EQ(c.kind, Kind::send);
  EXPECT_EQ(c.frame, can::Frame::base(0x123, {}));
  c = parse_command("send 1AAAAAAA 2 1 f1");
  EXPECT_EQ(c.kind, Kind::send);
  EXPECT_EQ(c.frame, can::Frame::ext(0x1AAAAAAA, {0x01, 0xF1}));
  c = parse_command("send 000007E5 1 4");
  EXPECT_EQ(c.frame, can::Frame::ext(0x7E5, {4}));
  c = parse_command("add 0 20000 123 4 42 42 42 42");
  EXPECT_EQ(c.kind, Kind::add);
  EXPECT_EQ(c.interval, rt::Duration(20ms));
  EXPECT_EQ(c.frame, can::Frame::base(0x123, {0x42, 0x42, 0x42, 0x42}));
  c = parse_command("update 123 3 11 22 33");
  EXPECT_EQ(c.kind, Kind::update);
  EXPECT_EQ(c.frame, can::Frame::base(0x123, {0x11, 0x22, 0x33}));
  c = parse_command("delete 123");
  EXPECT_EQ(c.kind, Kind::remove);
  c = parse_command("filter 1 500000 123 8 FF 00 F8 00 00 00 00 00");
  EXPECT_EQ(c.kind, Kind::filter);
  EXPECT_EQ(c.interval, rt::Duration(1500ms));
  EXPECT_EQ(c.frame, can::Frame::base(0x123, {0xFF, 0, 0xF8, 0, 0, 0, 0, 0}));
  c = parse_command("subscribe 0 0 12345678");
  EXPECT_EQ(c.kind, Kind::subscribe);
  EXPECT_EQ(c.frame.key(), 0x12345678U | can::extended_flag);
  EXPECT_EQ(parse_command("unsubscribe 123").kind, Kind::unsubscribe);
  EXPECT_EQ(parse_command("echo").kind, Kind::echo);
  EXPECT_EQ(parse_command("rawmode").kind, Kind::raw_mode);
  EXPECT_EQ(parse_command("bcmmode").kind, Kind::bcm_mode);
  EXPECT_EQ(parse_command("controlmode").kind, Kind::control_mode);
  c = parse_command("statistics 1000");
  EXPECT_EQ(c.kind, Kind::statistics);
  EXPECT_EQ(c.interval, rt::Duration(1s));
  c = parse_command("can0 B 125000 875 500 6 7 2 1 8");
  EXPECT_EQ(c.kind, Kind::configure);
  EXPECT_EQ(c.bus, "can0");
}

TEST(Socketcand, CommandsWithWrongWords) {
  for (const auto* text : {"send 123",
                           "send 123 1",
                           "send 123 1 11 22",
                           "send 123 9 1 2 3 4 5 6 7 8 9",
                           "send 800 0",
                           "send 20000000 0",
                           "send 1234567 0",
                           "send xyz 0",
                           "send 123 1 100",
                           "send 123 1 -1",
                           "send 123 0x1 1",
                           "send 123 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1",
                           "add 0 123 0",
                           "add -1 0 123 0",
                           "add 99999999999999999999 0 123 0",
                           "update 123",
                           "delete 123 4",
                           "delete",
                           "subscribe 0 123",
                           "subscribe 0 0 123 4",
                           "statistics -1",
                           "statistics 4294967296",
                           "filter 0 0 123 1"}) {
    const auto kind = parse_command(text).kind;
    EXPECT_TRUE(kind == Kind::malformed || kind == Kind::unknown) << text;
    if (std::string_view(text) != "delete") {
      EXPECT_EQ(kind, Kind::malformed) << text;
    }
  }
  for (const auto* text :
       {"", "opens can0", "open", "sent 123 0", "isotpmode", "hi", "rawmode x", "muxfilter 0 0 123 2 FF"})
    EXPECT_EQ(parse_command(text).kind, Kind::unknown) << text;
}

// By socketcand's own format strings ("< frame %03X %lld.%06lld " and " >").
TEST(Socketcand, FramesAsSocketcandWritesThem) {
  std::string text;
  append_frame(text, can::Frame::base(0x123, {0x1A, 0x22, 0x03, 0x44}), 23'424'242us, false);
  EXPECT_EQ(text, "< frame 123 23.424242 1A220344 >");
  text.clear();
  append_frame(text, can::Frame::base(0x7, {}), 1'700'000'000'000'001us, false);
  EXPECT_EQ(text, "< frame 007 1700000000.000001  >");
  text.clear();
  append_frame(text, can::Frame::ext(0x1F94, {0x80}), -5us, true);
  EXPECT_EQ(text, "< frame 00001F94 0.000000 80  >");
  text.clear();
  append_send(text, can::Frame::base(0x7E5, {0x04, 0xA0, 0x00}));
  EXPECT_EQ(text, "< send 7E5 3 4 a0 0 >");
}

TEST(Socketcand, Notices) {
  EXPECT_EQ(parse_notice("hi").kind, Said::hi);
  EXPECT_EQ(parse_notice("ok").kind, Said::ok);
  EXPECT_EQ(parse_notice("echo").kind, Said::echo);
  EXPECT_EQ(parse_notice("stat 1 2 3 4").kind, Said::stat);
  const auto error = parse_notice("error could not open bus");
  EXPECT_EQ(error.kind, Said::error);
  EXPECT_EQ(error.text, "could not open bus");
  auto n = parse_notice("frame 123 23.424242 1A220344");
  EXPECT_EQ(n.kind, Said::frame);
  EXPECT_EQ(n.frame, can::Frame::base(0x123, {0x1A, 0x22, 0x03, 0x44}));
  EXPECT_EQ(n.at, 23'424'242us);
  n = parse_notice("frame 123 23.424242 1A 22 03 44");  // BCM mode
  EXPECT_EQ(n.frame, can::Frame::base(0x123, {0x1A, 0x22, 0x03, 0x44}));
  n = parse_notice("frame 1F940000 0.5");
  EXPECT_EQ(n.kind, Said::frame);
  EXPECT_EQ(n.frame, can::Frame::ext(0x1F940000, {}));
  EXPECT_EQ(n.at, 500ms);
  for (const auto* text :
       {"frame", "frame 123", "frame 800 1.0", "frame 123 x", "frame 123 1.0 1", "frame 123 1.0 112233445566778899",
        "frame 123 1.0 GG", "frame 123 -1.0 11", "frame 123 1. 11"})
    EXPECT_EQ(parse_notice(text).kind, Said::malformed) << text;
}

can::Frame any_frame(Random& r) {
  can::Frame f;
  f.extended = r.below(2) == 0;
  f.id = static_cast<std::uint32_t>(r.below((f.extended ? can::extended_mask : can::base_mask) + 1ULL));
  f.size = static_cast<std::uint8_t>(r.below(9));
  for (auto& b : f.data) b = static_cast<std::uint8_t>(r.below(256));
  return f;
}

RC_GTEST_PROP(SocketcandProperty, FramesComeBackEqualInAnyPieces, (std::uint64_t seed)) {
  Random r(seed);
  std::string out;
  std::vector<can::Frame> given;
  const bool spaced = r.below(2) == 0;
  const auto count = 1 + r.below(20);
  for (std::uint64_t i = 0; i < count; ++i) {
    given.push_back(any_frame(r));
    if (i % 2 == 0) {
      append_send(out, given.back());
    } else {
      append_frame(out, given.back(), std::chrono::microseconds(r.below(1ULL << 40U)), spaced);
    }
  }
  ElementReader reader;
  std::vector<can::Frame> found;
  for (std::size_t at = 0; at < out.size();) {
    const auto n = 1 + r.below(40);
    reader.add(std::string_view(out).substr(at, n));
    at += n;
    while (const auto element = reader.next()) {
      const bool sent = element->starts_with("send");
      const auto command = parse_command(*element);
      const auto notice = parse_notice(*element);
      const bool good = sent ? command.kind == Kind::send : notice.kind == Said::frame;
      RC_ASSERT(good);
      found.push_back(sent ? command.frame : notice.frame);
    }
  }
  RC_ASSERT(found.size() == given.size());
  for (std::size_t i = 0; i < found.size(); ++i) RC_ASSERT(found[i] == given[i]);
}

TEST(Endpoint, TextsOfIt) {
  EXPECT_EQ(parse_endpoint("10.0.0.7:123", 5), (Endpoint{"10.0.0.7", 123}));
  EXPECT_EQ(parse_endpoint("host", 5), (Endpoint{"host", 5}));
  EXPECT_EQ(parse_endpoint(":80", 5), (Endpoint{"127.0.0.1", 80}));
  EXPECT_EQ(parse_endpoint("[::1]:80", 5), (Endpoint{"::1", 80}));
  EXPECT_EQ(parse_endpoint("[::1]", 5), (Endpoint{"::1", 5}));
  for (const auto* text :
       {"", "host:", "host:65536", "host:-1", "host:1x", "[::1", "[]:1", "a b:1", "[::1]80", "x/y:1"})
    EXPECT_FALSE(parse_endpoint(text, 5)) << text;
  EXPECT_EQ(to_string(Endpoint{"::1", 80}), "[::1]:80");
  EXPECT_EQ(to_string(Endpoint{"host", 80}), "host:80");
}

}  // namespace
}  // namespace berth::io::socketcand_protocol_tests
