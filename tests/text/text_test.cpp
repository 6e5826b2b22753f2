#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/text/file.hpp"
#include "berth/text/printable.hpp"
#include "berth/text/toml.hpp"
#include "tests/pch.hpp"

namespace berth::text {
namespace {

using namespace std::chrono_literals;

TEST(Duration, ReadsEveryUnitExactly) {
  EXPECT_EQ(parse_duration("4 ms"), Duration(4ms));
  EXPECT_EQ(parse_duration("4ms"), Duration(4ms));
  EXPECT_EQ(parse_duration("150 us"), Duration(150us));
  EXPECT_EQ(parse_duration("2.5 s"), Duration(2500ms));
  EXPECT_EQ(parse_duration("0.1 s"), Duration(100ms));
  EXPECT_EQ(parse_duration("1.5 min"), Duration(90s));
  EXPECT_EQ(parse_duration("0.25 h"), Duration(15min));
  EXPECT_EQ(parse_duration("7 ns"), Duration(7ns));
  EXPECT_EQ(parse_duration("1.0000 ns"), Duration(1ns));
  EXPECT_EQ(parse_duration("0.000000001 s"), Duration(1ns));
  EXPECT_EQ(parse_duration("0"), Duration(0));
}

TEST(Duration, RefusesWhatIsNotOne) {
  for (const char* bad : {"", "4", "ms", "4 sec", "-4 ms", "+4 ms", "4e3 ms", "4  ms", " 4 ms", "4 ms ", "4.ms", ".5 s",
                          "0.1 ns", "0.0000000001 s", "4 MS", "99999999999999999999 s", "1000000 h", "1.2.3 s"}) {
    EXPECT_FALSE(parse_duration(bad)) << bad;
  }
}

RC_GTEST_PROP(Duration, WrittenIsReadBack, ()) {
  const auto count = *rc::gen::inRange<std::int64_t>(0, 3'000'000'000'000'000'000);
  const auto scale = *rc::gen::element<std::int64_t>(1, 1'000, 1'000'000, 1'000'000'000, 60'000'000'000);
  const Duration duration(count / scale * scale);
  RC_ASSERT(parse_duration(write_duration(duration)) == std::optional(duration));
}

TEST(Ranges, AscendingOnly) {
  EXPECT_EQ(parse_ranges("1..3", 1, 127), (std::vector<unsigned>{1, 2, 3}));
  EXPECT_EQ(parse_ranges("1..2, 7,9..9", 1, 127), (std::vector<unsigned>{1, 2, 7, 9}));
  for (const char* bad :
       {"", "0..3", "1..128", "3..1", "1,1", "5,4", "1..", "..3", "a", "1..2..3", "1,", "-1", "99999999999999999999"}) {
    EXPECT_FALSE(parse_ranges(bad, 1, 127)) << bad;
  }
}

TEST(Printable, WhatMovesATerminalIsShownInstead) {
  EXPECT_EQ(printable("plain\n\ttext"), "plain\n\ttext");
  EXPECT_EQ(printable("Gr\xC3\xB6\xC3\x9F"
                      "e \xE2\x82\xAC \xF0\x9F\x9A\xA2"),
            "Gr\xC3\xB6\xC3\x9F"
            "e \xE2\x82\xAC \xF0\x9F\x9A\xA2");
  EXPECT_EQ(printable("\x1B[2J\x1B]0;x\x07"), "\\u001b[2J\\u001b]0;x\\u0007");
  EXPECT_EQ(printable("a\rb\x08\x7F"), "a\\u000db\\u0008\\u007f");
  EXPECT_EQ(printable(std::string_view("\0", 1)), "\\u0000");
  EXPECT_EQ(printable("\x9B"
                      "31m"),
            "\\x9b31m")
      << "C1 as a byte";
  EXPECT_EQ(printable("\xC2\x9B"
                      "31m"),
            "\\u009b31m")
      << "C1 as UTF-8";
  EXPECT_EQ(printable("\xE2\x80\xAE"
                      "exe\xE2\x81\xA9"),
            "\\u202eexe\\u2069")
      << "the direction of writing";
  EXPECT_EQ(printable("\xC0\x9B\xE0\x82\x9B\xED\xA0\x80"), "\\xc0\\x9b\\xe0\\x82\\x9b\\xed\\xa0\\x80")
      << "overlong, a surrogate";
  EXPECT_EQ(printable("\xE2\x82"), "\\xe2\\x82") << "cut short";
}

TEST(OneLine, ALineFeedBeginsNoLine) {
  EXPECT_EQ(one_line("a\n9  forged\n"), "a\\u000a9  forged\\u000a");
  EXPECT_EQ(one_line("\x1B[2J\n\xFF\ttab"), "\\u001b[2J\\u000a\\xff\ttab");
  EXPECT_EQ(one_line("plain"), "plain");
  EXPECT_EQ(one_line(""), "");
}

TEST(Closest, NearWordsOnly) {
  const std::array<std::string_view, 3> words{"bitrate", "port", "master_id"};
  EXPECT_EQ(closest("bitrat", words), "bitrate");
  EXPECT_EQ(closest("Bitrate", words), "bitrate");
  EXPECT_EQ(closest("masterid", words), "master_id");
  EXPECT_EQ(closest("prot", words), "port");
  EXPECT_EQ(closest("colour", words), "");
  EXPECT_EQ(closest("xy", words), "");
}

std::optional<Value> read(std::string_view text, Findings& findings) { return parse_toml(text, "t.toml", findings); }

// Nor is the memory: a file with very many values is refused where they are too many.
TEST(Toml, AFileOfVeryManyValuesIsRefused) {
  Findings findings;
  std::string lines;
  for (int i = 0; i < 80'001; ++i) lines += "#\n";
  EXPECT_FALSE(read(lines, findings));
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].line, 80'001);
  findings.clear();
  std::string row = "a = [";
  for (int i = 0; i < 80'001; ++i) row += "1,";
  EXPECT_FALSE(read(row + "]", findings));
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].column, 5 + 2 * 80'001);
}

// The stack is not theirs: a key of many parts is a table in a table in a table.
TEST(Toml, AKeyOfVeryManyPartsIsRefused) {
  std::string deep = "a";
  for (int i = 0; i < 200'000; ++i) deep += ".a";
  for (const std::string& text : {deep + " = 1\n", "[" + deep + "]\n", "x = { " + deep + " = 1 }\n"}) {
    Findings findings;
    EXPECT_FALSE(read("ok = 1\n" + text, findings));
    ASSERT_EQ(findings.size(), 1U);
    EXPECT_EQ(findings[0].line, 2);
  }
  Findings findings;
  EXPECT_TRUE(read("# " + std::string(1000, '.') + "\nx = [" + std::string(999, ' ') + "1.5, 2.5]\n", findings));
}

TEST(File, NoEndIsRefused) {
  Findings findings;
  EXPECT_FALSE(read_file("/dev/zero", findings));
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].message, "is larger than 64 MiB");
}

TEST(Toml, PlacesAndOrderOfTheFile) {
  Findings findings;
  const auto root = read("z = 1\na = \"x\"\n\n[bus.b]\nk = { q = 1 }\n[bus.a]\n[[slot]]\nid = 2\n", findings);
  ASSERT_TRUE(root);
  ASSERT_EQ(root->members.size(), 4U);
  EXPECT_EQ(root->members[0].key, "z");
  EXPECT_EQ(root->members[1].key, "a");
  EXPECT_EQ(root->find("a")->begin, (Place{2, 5}));
  EXPECT_EQ(root->find("a")->end, (Place{2, 8}));
  const Value* bus = root->find("bus");
  ASSERT_NE(bus, nullptr);
  EXPECT_EQ(bus->members[0].key, "b");
  EXPECT_TRUE(bus->find("b")->find("k")->in_line);
  EXPECT_FALSE(bus->find("b")->in_line);
  EXPECT_EQ(root->find("slot")->items[0].begin, (Place{7, 1}));
}

TEST(Toml, SyntaxErrorHasAPlace) {
  Findings findings;
  EXPECT_FALSE(read("a = 1\nb = = 2\n", findings));
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].line, 2);
  EXPECT_GT(findings[0].column, 1);
  EXPECT_EQ(findings[0].file, "t.toml");
}

TEST(Toml, OffsetsWithUnicodeAndByteOrderMark) {
  const std::string text = "\xEF\xBB\xBF\xC3\xA4 = \"\xE2\x82\xAC\"\nb = 7 # x\n";
  Findings findings;
  // A bare key may not hold ä: quote it.
  const std::string quoted_key = "\xEF\xBB\xBF\"\xC3\xA4\" = \"\xE2\x82\xAC\"\nb = 7 # x\n";
  const auto root = read(quoted_key, findings);
  ASSERT_TRUE(root) << to_string(findings.at(0));
  const auto begin = offset_of(quoted_key, root->members[0].value.begin);
  const auto end = offset_of(quoted_key, root->members[0].value.end);
  EXPECT_EQ(quoted_key.substr(begin, end - begin), "\"\xE2\x82\xAC\"");
  const Value* b = root->find("b");
  EXPECT_EQ(quoted_key.substr(offset_of(quoted_key, b->begin), 1), "7");
  EXPECT_EQ(offset_of(text, {99, 1}), text.size());
}

TEST(Table, NamesUnknownKeysAndWrongTypes) {
  Findings findings;
  const auto root = read("nmae = \"x\"\nid = \"5\"\nbig = 4_294_967_296\nwhen = 4\n", findings);
  const std::string file = "t.toml";
  Table table(*root, "slot[1]", file, findings);
  EXPECT_FALSE(table.string("name"));
  EXPECT_FALSE(table.u32("id"));
  EXPECT_FALSE(table.u32("big"));
  EXPECT_FALSE(table.duration("when", 0s, 1s));
  EXPECT_FALSE(table.require("name", "give it one"));
  table.finish();
  ASSERT_EQ(findings.size(), 5U);
  EXPECT_EQ(to_string(findings[0]), "t.toml:2:6: error: slot[1].id: this is a string; it must be an integer");
  EXPECT_EQ(to_string(findings[1]), "t.toml:3:7: error: slot[1].big: 4294967296 is out of range; use 0 to 0xFFFFFFFF");
  EXPECT_EQ(findings[2].line, 4);
  EXPECT_EQ(findings[3].message, "this key is missing");
  EXPECT_EQ(to_string(findings[4]), "t.toml:1:1: error: slot[1].nmae: unknown key; did you mean \"name\"?");
}

RC_GTEST_PROP(Quoted, IsReadBackByTheParser, ()) {
  std::string text;
  for (const int c : *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 128))) text += static_cast<char>(c);
  Findings findings;
  const auto root = read("k = " + berth::text::quoted(text) + "\n", findings);
  RC_ASSERT(root.has_value());
  RC_ASSERT(root->find("k")->string == text);
}

}  // namespace
}  // namespace berth::text
