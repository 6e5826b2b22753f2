#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/counted.hpp"
#include "berth/base/shell_word.hpp"
#include "berth/base/words.hpp"

namespace berth {
namespace {

TEST(Words, LettersOfEitherCaseAreOneAndNothingElseIs) {
  EXPECT_TRUE(same_word("", ""));
  EXPECT_TRUE(same_word("Left-2", "lEFT-2"));
  EXPECT_FALSE(same_word("left", "lef"));
  EXPECT_FALSE(same_word("a[", "a{"));  // as far apart as letters of either case
  EXPECT_FALSE(same_word("\xC3\x84", "\xC3\xA4")) << "no letter of ASCII";
}

TEST(Words, AListEndsBeforeItIsTooLong) {
  EXPECT_EQ(some_of({}), "");
  EXPECT_EQ(some_of({"a", "b", "c", "d"}, 4), "a, b, c, d");
  EXPECT_EQ(some_of({"a", "b", "c", "d", "e"}, 4), "a, b, c and 2 more");
}

// The definition itself, without any bound: insertions, deletions, substitutions and swaps of neighbours.
std::size_t slow_distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      const bool same = lower(a[i - 1]) == lower(b[j - 1]);
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (same ? 0 : 1)});
      const bool swap = i > 1 && j > 1 && lower(a[i - 1]) == lower(b[j - 2]) && lower(a[i - 2]) == lower(b[j - 1]);
      if (swap) d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[a.size()][b.size()];
}

std::string_view slow_closest(std::string_view word, const std::vector<std::string_view>& candidates) {
  std::string_view best;
  std::size_t nearest = word.size() <= 4 ? 2 : 3;
  for (const auto each : candidates) {
    const auto d = slow_distance(word, each);
    if (d >= nearest || d >= each.size()) continue;
    best = each;
    nearest = d;
  }
  return best;
}

TEST(Closest, OneOrTwoSlipsAreMeant) {
  const std::vector<std::string_view> verbs{"scan", "status", "start", "stop"};
  EXPECT_EQ(closest("skan", verbs), "scan");
  EXPECT_EQ(closest("SATTUS", verbs), "status");
  EXPECT_EQ(closest("statu", verbs), "status");
  EXPECT_EQ(closest("sto", verbs), "stop");
  EXPECT_EQ(closest("nothing like it", verbs), "");
  EXPECT_EQ(closest("", verbs), "");
  EXPECT_EQ(closest(std::string(65, 's'), {{std::string_view("s")}}), "");
  const std::string longest(64, 's');
  const std::string longer = longest + "ab";
  EXPECT_EQ(closest(longest, {{std::string_view(longer)}}), longer);
}

TEST(Counted, OneIsSingular) {
  EXPECT_EQ(counted(1, "device"), "1 device");
  EXPECT_EQ(counted(0, "device"), "0 devices");
  EXPECT_EQ(counted(21, "device"), "21 devices");
  EXPECT_EQ(counted(1, "bus", "buses"), "1 bus");
  EXPECT_EQ(counted(2, "bus", "buses"), "2 buses");
}

// Words of few letters are often near each other.
RC_GTEST_PROP(Closest, IsTheNearestByTheDefinition, ()) {
  const auto letters = rc::gen::container<std::string>(rc::gen::element('a', 'b', 'B', 'c'));
  const auto word = *letters;
  const auto texts = *rc::gen::container<std::vector<std::string>>(letters);
  std::vector<std::string_view> candidates(texts.begin(), texts.end());
  // Slips of the word itself.
  auto swapped = word;
  if (word.size() > 3) std::swap(swapped[1], swapped[2]);
  candidates.emplace_back(swapped);
  RC_PRE(word.size() <= 64U);
  RC_ASSERT(closest(word, candidates) == slow_closest(word, candidates));
}

// What a message tells a person to type is one word of a shell.
TEST(Words, ANameBehindACommandIsOneWord) {
  EXPECT_EQ(shell_word("left"), "left");
  EXPECT_EQ(shell_word("boom/left-2.a"), "boom/left-2.a");
  EXPECT_EQ(shell_word("Berth I-O module"), "\"Berth I-O module\"");
  EXPECT_EQ(shell_word("a;b"), "\"a;b\"");
  EXPECT_EQ(shell_word(""), "\"\"");
}

}  // namespace
}  // namespace berth
