#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <string>
#include <vector>

#include "berth/text/columns.hpp"

#include "tests/pch.hpp"

namespace berth::text {
namespace {

TEST(Columns, WideOnesTakeTwoAndMarksNone) {
  EXPECT_EQ(columns(""), 0U);
  EXPECT_EQ(columns("left"), 4U);
  EXPECT_EQ(columns("Förderer"), 8U);
  EXPECT_EQ(columns("\xE5\xB7\xA6"), 2U) << "an ideograph";
  EXPECT_EQ(columns("\xF0\x9F\x94\xA7"), 2U) << "an emoji";
  EXPECT_EQ(columns("e\xCC\x81"), 1U) << "a combining accent";
  EXPECT_EQ(columns("\xFF\xFE"), 2U) << "no UTF-8: one a byte";
}

TEST(Columns, CutNeverSplitsACharacter) {
  EXPECT_EQ(cut("left", 2), "le");
  EXPECT_EQ(cut("\xE5\xB7\xA6\xE5\xB7\xA6", 3), "\xE5\xB7\xA6") << "the second would need a fourth column";
  EXPECT_EQ(cut("\xC3\xB6\xC3\xB6", 1), "\xC3\xB6");
  EXPECT_EQ(cut("left", 0), "");
}

TEST(Columns, PaddedByColumnsNotBytes) {
  EXPECT_EQ(padded("\xC3\xB6", 3), "\xC3\xB6  ");
  EXPECT_EQ(padded("left", 3), "left");
}

TEST(Columns, WrappedAtSpaces) {
  EXPECT_EQ(wrapped("switch the device on", 10), (std::vector<std::string>{"switch the", "device on"}));
  EXPECT_EQ(wrapped("abcdefgh", 3), (std::vector<std::string>{"abc", "def", "gh"}));
  EXPECT_EQ(wrapped("", 3), (std::vector<std::string>{""}));
  EXPECT_EQ(wrapped("\xE5\xB7\xA6", 1), (std::vector<std::string>{"\xE5\xB7\xA6"})) << "it has to go somewhere";
}

RC_GTEST_PROP(Columns, WrappedLosesNothingAndFits, ()) {
  const auto words = *rc::gen::container<std::vector<std::string>>(
      rc::gen::nonEmpty(rc::gen::container<std::string>(rc::gen::inRange<char>('a', 'z'))));
  const auto most = *rc::gen::inRange<std::size_t>(1, 40);
  std::string line;
  for (const auto& word : words) line += (line.empty() ? "" : " ") + word;
  std::string letters;
  for (const auto& part : wrapped(line, most)) {
    RC_ASSERT(columns(part) <= most);
    letters += part;
  }
  const auto without_spaces = [](std::string text) {
    std::erase(text, ' ');
    return text;
  };
  RC_ASSERT(without_spaces(letters) == without_spaces(line));
}

}  // namespace
}  // namespace berth::text
