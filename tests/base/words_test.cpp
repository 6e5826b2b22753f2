#include <gtest/gtest.h>

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

}  // namespace
}  // namespace berth
