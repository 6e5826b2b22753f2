// Notes about objects: what is built in, what a file beside a description says, and what both make of a value.
#include "berth/command/notes.hpp"

#include <gtest/gtest.h>

#include <array>
#include <nlohmann/json.hpp>
#include <string>

#include "../pch.hpp"

namespace berth::command {
namespace {

constexpr auto u16 = od::DataType::unsigned16;

std::string said(const Note& note, std::uint16_t value) {
  const std::array<std::uint8_t, 2> bytes{static_cast<std::uint8_t>(value), static_cast<std::uint8_t>(value >> 8U)};
  return note_text(note, u16, bytes);
}

// CiA 402: 0237h is the statusword of a drive in operation enabled, 0218h of one with a fault.
TEST(Notes, AStatuswordInWords) {
  const Note note = standard_note(402, {0x6041, 0});
  EXPECT_EQ(said(note, 0x0237),
            " = ready to switch on, switched on, operation enabled, voltage enabled, no quick stop, remote");
  EXPECT_EQ(said(note, 0x0218), " = fault, voltage enabled, remote");
  EXPECT_TRUE(standard_note(401, {0x6041, 0}).empty()) << "another profile has another object there";
  EXPECT_TRUE(standard_note(0, {0x6041, 0}).empty());
}

TEST(Notes, ObjectsOfEachDevice) {
  EXPECT_EQ(standard_note(0, {0x1017, 0}).unit, "ms");
  EXPECT_EQ(standard_note(0, {0x1015, 0}).scale, 100);
  EXPECT_EQ(standard_note(0, {0x1A03, 0}).text.substr(0, 6), "Number");
  EXPECT_EQ(standard_note(0, {0x1A03, 7}).text.substr(0, 8), "A mapped");
  EXPECT_EQ(standard_note(402, {0x6060, 0}).values.at(8), "cyclic synchronous position");
  EXPECT_EQ(standard_note(401, {0x6000, 2}).text, "Digital inputs, 8 a byte");
  EXPECT_TRUE(standard_note(402, {0x2000, 0}).empty());
}

TEST(Notes, OfAFile) {
  const auto read = read_notes(R"(
["2001h:02"]
text   = "Temperature of the bearing"
unit   = "°C"
scale  = 0.1
values = { 0x7FFF = "sensor broken", 0 = "off" }
["6041h"]
bits = { 14 = "brake open" }
)",
                               "drive.notes");
  ASSERT_TRUE(read.findings.empty()) << to_string(read.findings.front());
  ASSERT_EQ(read.notes.size(), 2U);
  const Note& bearing = read.notes.at({0x2001, 2});
  EXPECT_EQ(said(bearing, 235), " = 23.5 °C");
  EXPECT_EQ(said(bearing, 0x7FFF), " = 3276.7 °C = sensor broken");
  EXPECT_EQ(read.notes.at({0x6041, 0}).bits.at(14), "brake open");
  nlohmann::ordered_json json;
  const std::array<std::uint8_t, 2> bytes{235, 0};
  put_note(json, bearing, u16, bytes);
  EXPECT_EQ(json.at("note").at("text"), "Temperature of the bearing");
  EXPECT_EQ(json.at("quantity"), "23.5 °C");
}

// Each mistake is named with its line, and the other notes count.
TEST(Notes, MistakesAreNamedWithTheirPlace) {
  const auto read = read_notes(R"(["1017h"]
scale = 0
["heartbeat"]
text = "no object"
["1018h:04"]
text = "Serial number"
txt = "what?"
["6041h"]
bits = { 64 = "none", x = "y" }
)",
                               "drive.notes");
  ASSERT_EQ(read.findings.size(), 5U);
  for (const auto& finding : read.findings) EXPECT_EQ(finding.file, "drive.notes") << to_string(finding);
  EXPECT_EQ(read.notes.at({0x1018, 4}).text, "Serial number");
  EXPECT_EQ(read_notes("[\"1017h", "x.notes").findings.size(), 1U);
}

TEST(Notes, SayNothingOfWhatDoesNotFit) {
  const Note note = standard_note(402, {0x6041, 0});
  const std::array<std::uint8_t, 1> one{0xFF};
  EXPECT_EQ(note_text(note, u16, one), "");
  EXPECT_EQ(note_text(note, od::DataType::none, one), "");
  EXPECT_EQ(note_text(note, u16, {}), "");
  EXPECT_EQ(notes_file("eds/drive.eds"), "eds/drive.notes");
  EXPECT_EQ(notes_file(""), "");
}

}  // namespace
}  // namespace berth::command
