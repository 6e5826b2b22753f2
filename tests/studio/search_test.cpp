// The filter over the ring, beside one that makes every frame's whole row and looks into it.
#include "berth/studio/search.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "../pch.hpp"
#include "berth/base/random.hpp"
#include "berth/can/bus_error.hpp"

namespace berth::studio {
namespace {

using Json = nlohmann::json;

// Of few identifiers, commands and bytes, so that much is said often; RAND and Fastscan among them.
can::Frame drawn(Random& random) {
  static constexpr std::array<std::uint32_t, 20> ids{0x000, 0x080, 0x085, 0x100, 0x185, 0x2FF, 0x405,
                                                     0x580, 0x585, 0x605, 0x602, 0x680, 0x6D3, 0x6D0,
                                                     0x705, 0x77F, 0x7A0, 0x7E4, 0x7E5, 0x071};
  std::array<std::uint8_t, 8> bytes{};
  for (auto& byte : bytes)
    byte = static_cast<std::uint8_t>(random.below(3) == 0 ? random.below(256) : random.below(2) * 0x40);
  if (random.below(40) == 0) bytes = {0x51, 0, 0, 0, 0, 31, 0, 0};  // Fastscan
  can::Frame frame;
  frame.id = ids.at(random.below(ids.size()));
  frame.extended = random.below(20) == 0;
  if (frame.extended)
    frame.id =
        static_cast<std::uint32_t>(random.below(2) == 0 ? 0x1F940000U + random.below(16) : random.below(0x1FFFFFFF));
  frame.remote = random.below(30) == 0;
  frame.size = static_cast<std::uint8_t>(random.below(3) == 0 ? random.below(9) : 8);
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  return frame;
}

std::string lowered(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

/// The numbers of the frames whose whole row has each word.
std::vector<std::uint64_t> by_rows(const FrameRing& ring, const std::vector<std::string>& buses,
                                   const std::string& filter) {
  std::vector<std::uint64_t> numbers;
  FrameWords words(buses.size());
  for (auto n = ring.first(); n < ring.next(); ++n) {
    RingFrame frame;
    if (!ring.read(n, frame)) continue;
    std::string text;
    words.of(frame, text);
    std::string row = fmt::format("{} {:0{}X}#", buses[frame.bus], frame.frame.id, frame.frame.extended ? 8 : 3);
    for (const auto byte : frame.frame.bytes()) row += fmt::format("{:02X}", byte);
    row = lowered(row + " " + text);
    std::istringstream wanted(lowered(filter));
    bool all = true;
    for (std::string word; wanted >> word;) all = all && row.find(word) != std::string::npos;
    if (all) numbers.push_back(n);
  }
  return numbers;
}

}  // namespace

TEST(StudioSearch, FindsWhatAWholeRowHasAndNothingElse) {
  const std::vector<std::string> buses{"field", "Drives 605"};
  Random random(20261128);
  FrameRing ring(4096);
  for (int i = 0; i < 6000; ++i)
    ring.put(static_cast<std::uint8_t>(random.below(2)), drawn(random), rt::Time(rt::Duration(i * 1000)), false);
  for (const std::string filter : {"sdo 605#",     "605",           "SDO write",
                                   "heartbeat",    "abort",         "rpdo 2",
                                   "705#0",        "#40",           "field fastscan",
                                   "drives",       "rand",          "dis",
                                   "e4#51",        "read 0000h",    "node 5 585",
                                   "emcy generic", "4040",          "a",
                                   "time:",        "extended 1f94", "zzz",
                                   "o e 0 #",      "fastscan bit",  "lss",
                                   "remote",       "boot up",       "frame 680"}) {
    SCOPED_TRACE(filter);
    const auto wanted = by_rows(ring, buses, filter);
    Search search(ring, buses, {.kind = MessageKind::frames, .id = "1", .count = 100, .filter = filter});
    while (!search.step(1000)) {
    }
    const auto answer = Json::parse(search.answer());
    EXPECT_EQ(answer.at("matched"), wanted.size());
    std::vector<std::uint64_t> newest;
    for (const auto& row : answer.at("rows")) newest.push_back(row.at("n").get<std::uint64_t>());
    const auto begin = wanted.end() - static_cast<std::ptrdiff_t>(std::min<std::size_t>(wanted.size(), 100));
    EXPECT_EQ(newest, std::vector<std::uint64_t>(begin, wanted.end()));
  }
}

// The words of a row are the same with a filter and without one.
TEST(StudioSearch, ARowSaysTheSameHoweverItWasFound) {
  const std::vector<std::string> buses{"field"};
  Random random(7);
  FrameRing ring(256);
  for (int i = 0; i < 256; ++i) ring.put(0, drawn(random), rt::Time(rt::Duration(i * 1000)), false);
  const auto rows = [&](const std::string& filter) {
    Search search(ring, buses, {.kind = MessageKind::frames, .id = "1", .count = 256, .filter = filter});
    while (!search.step(1000)) {
    }
    return Json::parse(search.answer()).at("rows");
  };
  const auto all = rows("");
  ASSERT_EQ(all.size(), 256U);
  EXPECT_EQ(rows("field"), all);
}

// One of the classes looks like the identifier of an SDO: it is no frame.
TEST(StudioSearch, AnErrorIsFoundByItsWords) {
  const std::vector<std::string> buses{"field"};
  FrameRing ring(16);
  auto report = can::error_report(can::ErrorKind::other, can::ErrorPlace::acknowledge, true, true, 128, 0);
  ring.put(0, can::Frame::base(0x705, {5}), rt::Time(), true);
  ring.put_error(0, report, rt::Time(), "Berth sent 000#0100");
  const auto rows = [&](const std::string& filter) {
    Search search(ring, buses, {.kind = MessageKind::frames, .id = "1", .count = 16, .filter = filter});
    while (!search.step(1000)) {
    }
    return Json::parse(search.answer()).at("rows");
  };
  ASSERT_EQ(rows("").size(), 2U);
  EXPECT_EQ(rows("")[0].at("own"), true);
  const auto found = rows("error ack berth");
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].at("error"), true);
  EXPECT_EQ(found[0].at("text"), rows("")[1].at("text"));
  EXPECT_NE(found[0].at("text").get<std::string>().find("no acknowledge"), std::string::npos);
  EXPECT_NE(found[0].at("text").get<std::string>().find("; Berth sent 000#0100"), std::string::npos);
  EXPECT_TRUE(rows("error heartbeat").empty());
}

// Bytes that the words do not rest on change nothing.
TEST(StudioSearch, WhatWordsRestOnIsAllThatTheyRestOn) {
  Random random(3);
  unsigned tried = 0;
  for (int i = 0; i < 200'000; ++i) {
    can::Frame frame = drawn(random);
    if (i % 2 == 0) frame.id = static_cast<std::uint32_t>(random.below(0x800)), frame.extended = false;
    const auto bytes = decode::rests_on(frame);
    if (!bytes) continue;
    can::Frame other = frame;
    for (std::size_t at = *bytes; at < 8; ++at) other.data[at] = static_cast<std::uint8_t>(random.below(256));
    decode::Interpreter alone, behind;
    static_cast<void>(behind.words(drawn(random)));
    ASSERT_EQ(alone.words(frame), behind.words(other)) << can::to_string(frame) << " " << can::to_string(other);
    ++tried;
  }
  EXPECT_GT(tried, 100'000U);
}

}  // namespace berth::studio
