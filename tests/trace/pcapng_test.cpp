// pcapng by hand: the blocks of the specification, both byte orders, and everything that can be cut or broken.
#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/trace/pcapng.hpp"

#include "formats.hpp"

namespace berth::trace {
namespace {

using namespace std::chrono_literals;
using test::read;

// Builds blocks as the specification draws them, in either byte order.
class Blocks {
 public:
  explicit Blocks(bool big = false) : big_(big) {}
  std::string u16(unsigned v) const {
    const char a = static_cast<char>(v >> 8);
    const char b = static_cast<char>(v);
    return big_ ? std::string{a, b} : std::string{b, a};
  }
  std::string u32(std::uint32_t v) const {
    return big_ ? u16(v >> 16) + u16(v & 0xFFFF) : u16(v & 0xFFFF) + u16(v >> 16);
  }
  std::string block(std::uint32_t type, const std::string& body) const {
    const auto length = static_cast<std::uint32_t>(body.size() + 12);
    return u32(type) + u32(length) + body + u32(length);
  }
  std::string option(unsigned code, std::string value) const {
    const auto length = static_cast<unsigned>(value.size());
    while (value.size() % 4 != 0) value += '\0';
    return u16(code) + u16(length) + value;
  }
  std::string section() const { return block(0x0A0D0D0A, u32(0x1A2B3C4D) + u16(1) + u16(0) + std::string(8, '\xFF')); }
  std::string interface(unsigned link_type, const std::string& options = {}) const {
    return block(1, u16(link_type) + u16(0) + u32(0) + options + (options.empty() ? "" : option(0, "")));
  }
  std::string packet(std::uint32_t number, std::uint64_t time, std::string bytes,
                     const std::string& options = {}) const {
    const auto size = static_cast<std::uint32_t>(bytes.size());
    while (bytes.size() % 4 != 0) bytes += '\0';
    return block(6, u32(number) + u32(static_cast<std::uint32_t>(time >> 32)) + u32(static_cast<std::uint32_t>(time)) +
                        u32(size) + u32(size) + bytes + options);
  }

 private:
  bool big_;
};

// The identifier is big-endian in either.
std::string can_bytes(std::uint32_t id, unsigned length, unsigned flags, const std::string& data) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(id >> shift);
  bytes += static_cast<char>(length);
  bytes += static_cast<char>(flags);
  return bytes + std::string(2, '\0') + data;
}

TEST(Pcapng, BothByteOrders) {
  for (const bool big : {false, true}) {
    const Blocks b(big);
    const auto file =
        b.section() + b.interface(227, b.option(2, "vcan0")) +
        b.packet(0, 1436509052249713, can_bytes(0x7E5, 2, 0, "\x51\x07"), b.option(1, "a comment")) +
        b.packet(0, 1436509052250001, can_bytes(0x9F900135, 0, 0, "")) +
        b.packet(0, 1436509052250400, can_bytes(0x40000701, 1, 0, ""), b.option(2, b.u32(2)) + b.option(0, ""));
    for (const std::size_t piece : {1U, 7U, 4096U}) {
      const auto kept = read(Format::pcapng, file, piece);
      EXPECT_TRUE(kept.findings.empty()) << kept.text();
      EXPECT_EQ(kept.trace.buses, std::vector<std::string>{"vcan0"});
      const auto& e = kept.trace.entries;
      ASSERT_EQ(e.size(), 3U);
      EXPECT_EQ(e[0].at, 1436509052249713us) << "microseconds without if_tsresol";
      EXPECT_EQ(e[0].frame, can::Frame::base(0x7E5, {0x51, 7}));
      EXPECT_EQ(e[1].frame, can::Frame::ext(0x1F900135, {}));
      EXPECT_EQ(e[2].frame, can::Frame::request(0x701, 1));
      EXPECT_EQ(e[2].direction, Direction::sent);
    }
  }
}

TEST(Pcapng, ResolutionsOffsetsAndInterfaces) {
  const Blocks b;
  const auto file =
      b.section() + b.interface(227, b.option(2, "can0") + b.option(9, "\x09")) + b.interface(1, b.option(2, "eth0")) +
      b.interface(227, b.option(9, "\x8A") + b.option(14, b.u32(100) + b.u32(0))) +
      b.interface(227, b.option(2, "can3") + b.option(9, "\x0C")) + b.packet(0, 5'000'000'001, can_bytes(1, 0, 0, "")) +
      b.packet(1, 1, std::string(60, 'x')) + b.packet(2, 1536, can_bytes(2, 0, 0, "")) +
      b.packet(3, 2'000'000'001'999, can_bytes(3, 0, 0, "")) + b.block(0x0BAD, std::string(4, 'x')) +
      b.block(3, b.u32(8) + can_bytes(4, 0, 0, "")) +
      b.block(2, b.u16(0) + b.u16(0) + b.u32(0) + b.u32(7) + b.u32(8) + b.u32(8) + can_bytes(5, 0, 0, ""));
  const auto kept = read(Format::pcapng, file);
  EXPECT_EQ(kept.errors(), 0U) << kept.text();
  EXPECT_EQ(kept.count(Finding::Severity::note), 1U) << "the interface that is no CAN: " << kept.text();
  EXPECT_EQ(kept.trace.buses, (std::vector<std::string>{"can0", "can2", "can3"}));
  const auto& e = kept.trace.entries;
  ASSERT_EQ(e.size(), 5U);
  EXPECT_EQ(e[0].at, 5s + 1ns);
  EXPECT_EQ(e[1].at, 101s + 500ms) << "2^-10 s, 100 s further";
  EXPECT_EQ(e[2].at, 2s + 1ns);
  EXPECT_EQ(e[3].frame.id, 4U) << "a simple packet";
  EXPECT_EQ(e[4].at, 7ns) << "an obsolete packet";
}

TEST(Pcapng, FdAndErrorFrames) {
  const Blocks b;
  const auto file = b.section() + b.interface(227) + b.packet(0, 1, can_bytes(0x123, 12, 7, std::string(12, '\x5A'))) +
                    b.packet(0, 1, can_bytes(0x123, 2, 0, std::string(64, '\x5A'))) +
                    b.packet(0, 2, can_bytes(0x20000004, 8, 0, std::string("\0\x08\0\0\0\0\0\0", 8)));
  const auto kept = read(Format::pcapng, file);
  EXPECT_TRUE(kept.findings.empty()) << kept.text();
  const auto& e = kept.trace.entries;
  ASSERT_EQ(e.size(), 3U);
  EXPECT_TRUE(e[0].frame.fd && e[0].frame.brs && e[0].frame.esi);
  EXPECT_TRUE(e[1].frame.fd) << "72 bytes are canfd_frame's";
  EXPECT_EQ(e[1].frame.size, 2);
  EXPECT_TRUE(e[2].error);
  EXPECT_EQ(e[2].frame.id, 4U);
  EXPECT_EQ(e[2].frame.data[1], 8);
}

TEST(Pcapng, ASecondSectionHasItsOwnOrderAndInterfaces) {
  const Blocks little;
  const Blocks big(true);
  const auto file = little.section() + little.interface(227, little.option(2, "a")) +
                    little.packet(0, 1, can_bytes(1, 0, 0, "")) + big.section() +
                    big.interface(227, big.option(2, "b")) + big.packet(0, 2, can_bytes(2, 0, 0, "")) +
                    big.packet(1, 2, can_bytes(2, 0, 0, ""));
  const auto kept = read(Format::pcapng, file);
  EXPECT_EQ(kept.trace.buses, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(kept.trace.entries.size(), 2U);
  ASSERT_EQ(kept.errors(), 1U) << "interface 1 is not described: " << kept.text();
  EXPECT_EQ(kept.findings[0].key, "byte " + std::to_string(file.size() - 40));
}

TEST(Pcapng, AfterABrokenBlockTheNextOneIsFound) {
  const Blocks b;
  const auto good = b.packet(0, 1, can_bytes(1, 8, 0, "12345678"));
  auto bad = good;
  bad[4] = 0x33;  // a length that cannot be
  const auto head = b.section() + b.interface(227);
  for (const std::size_t piece : {3U, 4096U}) {
    const auto kept = read(Format::pcapng, head + good + bad + good + good, piece);
    EXPECT_EQ(kept.trace.entries.size(), 3U);
    ASSERT_EQ(kept.errors(), 1U) << kept.text();
    EXPECT_EQ(kept.findings[0].key, "byte " + std::to_string(head.size() + good.size()));
  }
  auto tail = good;
  tail[tail.size() - 4] = 0x11;  // another length at its end
  const auto kept = read(Format::pcapng, head + tail + good);
  EXPECT_GE(kept.trace.entries.size(), 1U);
  EXPECT_EQ(kept.errors(), 1U) << kept.text();
}

TEST(Pcapng, CutShortAnywhere) {
  const Blocks b;
  const auto packet = b.packet(0, 1, can_bytes(1, 8, 0, "12345678"));
  const auto head = b.section() + b.interface(227);
  const auto file = head + packet + packet;
  for (std::size_t size = 1; size < file.size(); ++size) {
    const auto kept = read(Format::pcapng, std::string_view(file).substr(0, size));
    const std::size_t whole = size < head.size() ? 0 : (size - head.size()) / packet.size();
    EXPECT_EQ(kept.trace.entries.size(), whole) << size;
    const bool between = size == b.section().size() || size == head.size() || size == head.size() + packet.size();
    EXPECT_EQ(kept.errors(), between ? 0U : 1U) << size << ": " << kept.text();
  }
}

TEST(Pcapng, WhatIsNoneIsSaidOnce) {
  EXPECT_EQ(read(Format::pcapng, std::string(100'000, 'x')).errors(), 1U);
  EXPECT_EQ(read(Format::pcapng, "").errors(), 0U);
  const Blocks b;
  const auto wrong = [&](const std::string& bytes, const char* words) {
    const auto kept = read(Format::pcapng, b.section() + b.interface(227) + bytes);
    EXPECT_EQ(kept.errors(), 1U) << words << ": " << kept.text();
    EXPECT_NE(kept.text().find(words), std::string::npos) << kept.text();
    EXPECT_TRUE(kept.trace.entries.empty()) << words;
  };
  wrong(b.packet(0, 1, "1234567"), "at least 8 bytes");
  wrong(b.packet(0, 1, can_bytes(1, 8, 0, "1234")), "only 4 of 8");
  wrong(b.packet(0, 1, can_bytes(0x800, 0, 0, "")), "without the flag");
  wrong(b.packet(0, 1, can_bytes(1, 9, 4, "123456789")), "cannot have 9");
  wrong(b.packet(0, 1, can_bytes(0x40000001, 0, 4, "")), "never remote");
  wrong(b.packet(0, ~std::uint64_t{0}, can_bytes(1, 0, 0, "")), "does not fit");
  wrong(b.block(6, b.u32(0) + b.u32(0) + b.u32(0) + b.u32(99) + b.u32(99)), "longer than its block");
  wrong(b.block(6, b.u32(0)), "too short");
}

TEST(Pcapng, WritesBlocksThatTheSpecificationDraws) {
  Trace trace;
  trace.buses = {"can0"};
  trace.entries.push_back({5'000'000'001ns, 0, can::Frame::base(0x7E5, {0x51}), Direction::received});
  const auto written = test::write(Format::pcapng, trace);
  const Blocks b;
  const auto expected =
      b.block(0x0A0D0D0A, b.u32(0x1A2B3C4D) + b.u16(1) + b.u16(0) + std::string(8, '\xFF') + b.option(4, "berth") +
                              b.option(0, "")) +
      b.interface(227, b.option(2, "can0") + b.option(9, "\x09")) +
      b.packet(0, 5'000'000'001, can_bytes(0x7E5, 1, 0, "\x51"), b.option(2, b.u32(1)) + b.option(0, ""));
  EXPECT_EQ(written.bytes, expected);
  EXPECT_TRUE(written.lost.empty());
}

}  // namespace
}  // namespace berth::trace
