// Notes about objects: what is built in, what a file beside a description says, and what both make of a value.
#include "berth/command/notes.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <tuple>

#include "../pch.hpp"
#include "berth/command/values.hpp"

namespace berth::command {
namespace {

class Folder {
 public:
  Folder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "berth-notes-XXXXXX").string();
    path_ = ::mkdtemp(pattern.data());
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] std::string file(const std::string& name) const { return (path_ / name).string(); }
  [[nodiscard]] std::string write(const std::string& name, const std::string& content) const {
    std::ofstream(path_ / name, std::ios::binary) << content;
    return file(name);
  }

 private:
  std::filesystem::path path_;
};

constexpr auto u16 = od::DataType::unsigned16;

KnownObject object(od::DataType type, ObjectRef ref = {}) {
  KnownObject made;
  made.ref = ref;
  made.type = type;
  return made;
}

std::string said(const Note& note, std::uint16_t value) {
  const std::array<std::uint8_t, 2> bytes{static_cast<std::uint8_t>(value), static_cast<std::uint8_t>(value >> 8U)};
  return note_text(note, object(u16), bytes);
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
  EXPECT_EQ(note_text(note, object(u16), one), "");
  EXPECT_EQ(note_text(note, KnownObject{}, one), "");
  EXPECT_EQ(note_text(note, object(u16), {}), "");
  EXPECT_EQ(notes_file("eds/drive.eds"), "eds/drive.notes");
  EXPECT_EQ(notes_file(""), "");
}

// 1017h has its time already; what a file counts in ms is told.
TEST(Notes, ATimeIsToldOnce) {
  const std::array<std::uint8_t, 2> bytes{0xF4, 1};
  const Note time{.text = "", .unit = "ms"};
  EXPECT_EQ(note_text(time, object(u16, {0x1017, 0}), bytes), "");
  EXPECT_EQ(note_text(time, object(u16, {0x2001, 0}), bytes), " = 500 ms");
}

// A description with a unit and names of values, as an XDD has them: they count before what is built in, and the file
// beside it before both, each field by itself.
TEST(Notes, TheFileThenTheDescriptionThenWhatIsBuiltIn) {
  const Folder folder;
  od::DescriptionBuilder builder;
  builder.variable(0x1000, {.name = "Device type", .initial = od::Literal::number(0x0002'0192)});
  builder.variable(0x6060, {.name = "Modes of operation", .type = od::DataType::integer8});
  builder.variable(0x2001, {.name = "Temperature", .type = od::DataType::integer16});
  builder.meaning({0x2001, 0}, {.unit = "°C", .number = 1, .exponent = -1, .values = {{0x7FFF, "broken"}}});
  builder.meaning({0x6060, 0}, {.values = {{1, "homing of the maker"}}});
  const auto description = builder.build();
  const NoteBook bare(description, "");
  EXPECT_EQ(bare.of({0x6060, 0}).text, standard_note(402, {0x6060, 0}).text);
  EXPECT_FALSE(bare.of({0x6060, 0}).text.empty());
  EXPECT_EQ(bare.of({0x6060, 0}).values, (std::map<std::int64_t, std::string>{{1, "homing of the maker"}}));
  EXPECT_EQ(bare.of({0x2001, 0}).unit, "°C");
  EXPECT_NEAR(bare.of({0x2001, 0}).scale, 0.1, 1e-12);
  EXPECT_TRUE(bare.own({0x2001, 0}).empty());
  EXPECT_EQ(bare.file(), "");

  const std::string eds = folder.file("drive.eds");
  (void)folder.write("drive.notes", "[\"2001h\"]\nunit = \"K\"\n");
  const NoteBook book(description, eds);
  EXPECT_EQ(book.file(), folder.file("drive.notes"));
  EXPECT_EQ(book.of({0x2001, 0}).unit, "K");
  EXPECT_EQ(book.of({0x2001, 0}).scale, 1);
  EXPECT_EQ(book.of({0x2001, 0}).values.at(0x7FFF), "broken") << "the file says nothing of values";
  const KnownObject temperature = known_object(description.get(), {0x2001, 0});
  const std::array<std::uint8_t, 2> bytes{235, 0};
  EXPECT_EQ(value_text(temperature, bytes) + note_text(bare.of({0x2001, 0}), temperature, bytes), "235 = 23.5 °C");
  const KnownObject shown = book.shown(temperature);
  EXPECT_EQ(value_text(shown, bytes) + note_text(book.of({0x2001, 0}), shown, bytes), "235 = 235 K");
}

TEST(Notes, AsADescriptionHasThem) {
  const Note note{.text = "", .unit = "°C", .scale = 0.1, .values = {{-1, "none"}, {3, "three"}, {300, "much"}}};
  EXPECT_EQ(meaning_of(note, u16),
            (od::Meaning{.unit = "°C", .number = 1, .exponent = -1, .values = {{3, "three"}, {300, "much"}}}));
  const od::Meaning meaning = meaning_of(note, od::DataType::integer8);
  ASSERT_EQ(meaning.values.size(), 2U) << "300 is no INTEGER8";
  EXPECT_EQ(meaning.values.back(), (od::NamedValue{0xFFFF'FFFF'FFFF'FFFF, "none"}));
  for (const auto& [scale, number, exponent] :
       {std::tuple(100.0, 1, 2), std::tuple(0.025, 25, -3), std::tuple(1.0, 1, 0), std::tuple(1e-7, 1, -7),
        std::tuple(360.0 / 4096, 87890625, -9)}) {
    const od::Meaning made = meaning_of({.text = "", .unit = "x", .scale = scale}, u16);
    EXPECT_EQ(made.number, number) << scale;
    EXPECT_EQ(made.exponent, exponent) << scale;
  }
}

TEST(Notes, ATraceIsToldWhatValuesMean) {
  const NoteWords words{NoteBook(nullptr, "")};
  EXPECT_TRUE(words.knows({0x1001, 0}));
  EXPECT_FALSE(words.knows({0x2000, 0}));
  const std::array<std::uint8_t, 1> bytes{0x11};
  EXPECT_EQ(words.words({0x1001, 0}, od::DataType::unsigned8, bytes), "generic error, communication");
  EXPECT_EQ(words.words({0x1001, 0}, u16, bytes), "") << "not as long as its type";
}

}  // namespace
}  // namespace berth::command
