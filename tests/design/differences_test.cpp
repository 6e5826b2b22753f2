// What a user changed in a machine file, in the words of the file.
#include "berth/design/differences.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

using namespace berth;

namespace {

const char* const file_before = R"([machine]
name = "press"

[bus.backbone]
port = "socketcan:can0"
bitrate = "125k"

[[slot]]
name = "left"
node-id = 2
spares = [1, 2]
replacement = "ask"

[[slot]]
name = "right"
node-id = 3
)";

text::Value parsed(const std::string& text) {
  Findings findings;
  auto value = text::parse_toml(text, "press.toml", findings);
  EXPECT_TRUE(value && findings.empty()) << text;
  return value ? *value : text::Value{};
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const auto at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), by);
}

std::vector<std::string> words(const std::string& before, const std::string& now) {
  std::vector<std::string> all;
  for (const auto& each : design::differences(parsed(before), parsed(now))) {
    all.push_back(std::to_string(each.place.line) + ": " + to_string(each));
  }
  return all;
}

using Words = std::vector<std::string>;

}  // namespace

TEST(Differences, AValueIsNamedByItsTableAndKey) {
  EXPECT_EQ(words(file_before, replaced(file_before, "[1, 2]", "[1, 2, 7]")), (Words{"11: slot left: spares"}));
  EXPECT_EQ(words(file_before, replaced(file_before, "125k", "250k")), (Words{"6: bus.backbone: bitrate"}));
}

TEST(Differences, CommentsOrderAndWaysOfWritingAreNone) {
  const std::string other = R"(# the press
[[slot]]
name = "right"
node-id = 0x3
[[slot]]
node-id = 2
replacement = 'ask'
spares = [
  1, 2 ]
name = "left"
[bus]
backbone = { bitrate = "125k", port = "socketcan:can0" }
[machine]
name = "press"
)";
  EXPECT_EQ(words(file_before, other), Words{});
}

TEST(Differences, WhatCameAndWhatWentIsSaid) {
  const std::string more = std::string(file_before) + "[[slot]]\nname = \"top\"\nnode-id = 4\n[mqtt]\nbroker = \"x\"\n";
  EXPECT_EQ(words(file_before, more), (Words{"17: slot top is new", "20: mqtt is new"}));
  EXPECT_EQ(words(more, file_before), (Words{"8: slot top is gone", "1: mqtt is gone"}));
  EXPECT_EQ(words(file_before, replaced(file_before, "replacement = \"ask\"\n", "")),
            (Words{"8: slot left: replacement is gone"}));
  EXPECT_EQ(words(replaced(file_before, "replacement = \"ask\"\n", ""), file_before),
            (Words{"12: slot left: replacement is new"}));
}

// A slot with another name is another slot.
TEST(Differences, ASlotThatIsRenamedCameAndWent) {
  EXPECT_EQ(words(file_before, replaced(file_before, "\"right\"", "\"middle\"")),
            (Words{"14: slot middle is new", "8: slot right is gone"}));
}

TEST(Differences, TablesWithoutANameAreMatchedByTheirOrder) {
  const std::string link = "[[link]]\nfrom = \"a\"\n[[link]]\nfrom = \"b\"\n";
  EXPECT_EQ(words(link, replaced(link, "\"b\"", "\"c\"")), (Words{"4: link [1]: from"}));
  EXPECT_EQ(words(link, "[[link]]\nfrom = \"a\"\n"), (Words{"1: link [1] is gone"}));
}
