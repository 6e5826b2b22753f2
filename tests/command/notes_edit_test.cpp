// A file of notes that a person wrote, changed by `note write`: what else stands in it stays, byte for byte.
#include "berth/command/notes_edit.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "../pch.hpp"
#include "berth/text/file.hpp"

namespace berth::command::notes_edit_tests {
namespace {

const Note bearing{.text = "Bearing", .unit = "°C", .scale = 0.1, .values = {{0, "off"}, {32767, "sensor broken"}}};

// With a comment at each place where there may be one.
constexpr const char* file = R"(# Notes of the left drive
["6041h"]   # CiA 402
text = "State"   # as in the manual
# Between two keys
bits = { 3 = "fault", 0x0E = "brake \"open\"" }

["2001h:02"]
unit  = "K"
)";

std::string good(const Checked<std::string>& made) { return made ? *made : "REFUSED: " + made.error(); }

TEST(NotesEdit, ANewNoteStandsAtTheEnd) {
  EXPECT_EQ(good(with_note("", "x.notes", {0x2001, 2}, bearing)),
            "[\"2001h:02\"]\ntext = \"Bearing\"\nunit = \"°C\"\nscale = 0.1\n"
            "values = { 0 = \"off\", 32767 = \"sensor broken\" }\n");
  const std::string more = good(with_note(file, "x.notes", {0x1017, 0}, {.text = "Say \"when\"", .unit = ""}));
  EXPECT_EQ(more, std::string(file) + "\n[\"1017h:00\"]\ntext = \"Say \\\"when\\\"\"\n");
  EXPECT_EQ(good(with_note("# nothing yet", "x.notes", {0x1017, 0}, {.text = "x", .unit = ""})),
            "# nothing yet\n\n[\"1017h:00\"]\ntext = \"x\"\n");
}

TEST(NotesEdit, OnlyTheKeysThatChangeAreTouched) {
  Note state = read_notes(file, "x.notes").notes.at({0x6041, 0});
  state.text = "Statusword";
  state.unit = "1";
  std::string expected = file;
  expected.replace(expected.find("\"State\""), 7, "\"Statusword\"");
  const std::string brake = "\"brake \\\"open\\\"\" }\n";
  expected.insert(expected.find(brake) + brake.size(), "unit = \"1\"\n");
  EXPECT_EQ(good(with_note(file, "x.notes", {0x6041, 0}, state)), expected);
  // A key that goes takes its line, and what was said of it there.
  state.text.clear();
  state.unit.clear();
  std::string without = file;
  const std::string line = "text = \"State\"   # as in the manual\n";
  without.erase(without.find(line), line.size());
  EXPECT_EQ(good(with_note(file, "x.notes", {0x6041, 0}, state)), without);
  // The same again changes nothing.
  EXPECT_EQ(good(with_note(file, "x.notes", {0x6041, 0}, read_notes(file, "x.notes").notes.at({0x6041, 0}))), file);
}

TEST(NotesEdit, ANoteGoesAndTheOthersStay) {
  EXPECT_EQ(good(with_note(file, "x.notes", {0x6041, 0}, {})),
            "# Notes of the left drive\n\n[\"2001h:02\"]\nunit  = \"K\"\n");
  const auto none = with_note(file, "x.notes", {0x1017, 0}, {});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error(), "x.notes has no note of 1017h:00");
}

TEST(NotesEdit, LineEndsAndWaysOfWritingStay) {
  EXPECT_EQ(good(with_note("[\"1017h\"]\r\ntext = \"x\"\r\n", "x.notes", {0x1017, 0}, {.text = "y", .unit = "ms"})),
            "[\"1017h\"]\r\ntext = \"y\"\r\nunit = \"ms\"\r\n");
  EXPECT_EQ(good(with_note("\"1017h\" = { text = \"x\" } # here\n", "x.notes", {0x1017, 0}, {.text = "y", .unit = ""})),
            "\"1017h\" = { text = \"y\" } # here\n");
  // Names in a table with a header of its own.
  EXPECT_EQ(good(with_note("[\"1017h\"]\nunit = \"ms\"\n[\"1017h\".values]\n0 = \"off\"\n1 = \"on\"\n[\"1018h\"]\n"
                           "text = \"z\"\n",
                           "x.notes", {0x1017, 0}, {.text = "", .unit = "ms", .values = {{0, "none"}}})),
            "[\"1017h\"]\nunit = \"ms\"\nvalues = { 0 = \"none\" }\n[\"1018h\"]\ntext = \"z\"\n");
}

// What a person wrote and nobody can read stays for the person.
TEST(NotesEdit, WhatCannotBeChangedIsRefused) {
  const auto refused = [](std::string_view text, const Note& note) {
    const auto made = with_note(text, "x.notes", {0x1017, 0}, note);
    return made ? "GOOD: " + *made : made.error();
  };
  EXPECT_NE(refused("[\"1017h\"\n", {.text = "x", .unit = ""}).find("x.notes:1"), std::string::npos);
  // The object's table is split by another's.
  const std::string split = "[\"1017h\"]\ntext = \"a\"\n[\"1018h\"]\ntext = \"b\"\n[\"1017h\".bits]\n0 = \"c\"\n";
  EXPECT_NE(refused(split, {}).find("edit the file by hand"), std::string::npos) << refused(split, {});
  EXPECT_NE(refused("", {.text = std::string(longest_notes, 'x'), .unit = ""}).find("edit the file by hand"),
            std::string::npos);
  EXPECT_NE(refused("", {.text = "\xFF", .unit = ""}).find("edit the file by hand"), std::string::npos) << "no UTF-8";
}

class Place : public ::testing::Test {
 protected:
  Place() {
    std::string pattern = (std::filesystem::temp_directory_path() / "berth-notes-edit-XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
    file_ = (folder_ / "drive.notes").string();
  }
  ~Place() override { std::filesystem::remove_all(folder_); }
  void put(const std::string& text) const { std::ofstream(file_, std::ios::binary) << text; }
  [[nodiscard]] std::string held(const std::filesystem::path& path) const {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  [[nodiscard]] std::ptrdiff_t files() const {
    return std::distance(std::filesystem::directory_iterator(folder_), std::filesystem::directory_iterator());
  }
  std::filesystem::path folder_;
  std::string file_;
};

TEST_F(Place, IsTakenWhole) {
  ASSERT_TRUE(write_note(file_, {0x1017, 0}, {.text = "x", .unit = ""}));
  EXPECT_EQ(held(file_), "[\"1017h:00\"]\ntext = \"x\"\n");
  std::filesystem::permissions(file_, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  ASSERT_TRUE(write_note(file_, {0x1017, 0}, {.text = "y", .unit = ""}));
  EXPECT_EQ(held(file_), "[\"1017h:00\"]\ntext = \"y\"\n");
  struct stat status {};
  ASSERT_EQ(::stat(file_.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U) << "as a person made it";
  EXPECT_EQ(files(), 1) << "no part is left";
  put("not [ toml");
  EXPECT_FALSE(write_note(file_, {0x1017, 0}, {.text = "z", .unit = ""}));
  EXPECT_EQ(held(file_), "not [ toml");
  EXPECT_EQ(files(), 1);
  EXPECT_FALSE(write_note((folder_ / "none" / "drive.notes").string(), {0x1017, 0}, {.text = "z", .unit = ""}));
}

// A link is replaced, and what it leads to is left alone; a file that Berth reads as something else, too.
TEST_F(Place, OfAnotherFileIsLeftAlone) {
  const auto other = folder_ / "other";
  std::ofstream(other) << "[\"1018h\"]\ntext = \"theirs\"\n";
  std::filesystem::create_symlink(other, file_);
  ASSERT_TRUE(write_note(file_, {0x1017, 0}, {.text = "x", .unit = ""}));
  EXPECT_EQ(held(other), "[\"1018h\"]\ntext = \"theirs\"\n");
  EXPECT_FALSE(std::filesystem::is_symlink(file_));
  const auto machine = (folder_ / "machine.notes").string();
  std::ofstream(machine) << "text = 1\n";
  Findings none;
  ASSERT_TRUE(text::read_file(machine, none));
  EXPECT_FALSE(write_note(machine, {0x1017, 0}, {.text = "x", .unit = ""}));
  EXPECT_EQ(held(machine), "text = 1\n");
}

}  // namespace
}  // namespace berth::command::notes_edit_tests
