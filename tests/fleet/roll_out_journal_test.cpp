// A roll-out goes on where it ended, whatever ended it.
#include "berth/fleet/roll_out_journal.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "tests/mqtt/folder.hpp"

namespace berth::fleet {
namespace {

using mqtt::test::Folder;
using sparkplug::EdgeNodeId;

const RollOutJournal::What the_dcf{"configure", "drive", 0x1234};

std::string read(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}
void write(const std::string& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

}  // namespace

TEST(FleetRollOutJournal, WhatWasDoneIsNotDoneAgain) {
  const Folder folder;
  const auto path = folder.file("j");
  {
    auto journal = RollOutJournal::open(path, the_dcf);
    ASSERT_TRUE(journal) << journal.error();
    EXPECT_TRUE(journal->done().empty());
    EXPECT_EQ(journal->add({"hall", "a"}, true, ""), "");
    EXPECT_EQ(journal->add({"hall", "b"}, false, "it is \"offline\"\n"), "");
  }
  const auto again = RollOutJournal::open(path, the_dcf);
  ASSERT_TRUE(again) << again.error();
  EXPECT_EQ(again->done(), (std::vector<EdgeNodeId>{{"hall", "a"}})) << "what failed is tried again";
}

// Each length to which a crash can cut it off is a journal, and knows the lines before.
TEST(FleetRollOutJournal, AnUnfinishedLineDoesNotCount) {
  const Folder folder;
  const auto path = folder.file("j");
  auto journal = RollOutJournal::open(path, the_dcf);
  ASSERT_TRUE(journal);
  ASSERT_EQ(journal->add({"hall", "a"}, true, ""), "");
  const auto one = read(path).size();
  ASSERT_EQ(journal->add({"hall", "b"}, true, ""), "");
  const std::string whole = read(path);
  for (std::size_t length = 0; length <= whole.size(); ++length) {
    write(path, whole.substr(0, length));
    auto cut = RollOutJournal::open(path, the_dcf);
    ASSERT_TRUE(cut) << length << ": " << cut.error();
    // A line without its line feed is whole, too.
    EXPECT_EQ(cut->done().size(), length >= whole.size() - 1 ? 2U : length >= one - 1 ? 1U : 0U) << length;
    ASSERT_EQ(cut->add({"hall", "c"}, true, ""), "");
    const auto after = RollOutJournal::open(path, the_dcf);
    ASSERT_TRUE(after) << length;
    EXPECT_EQ(after->done().back(), (EdgeNodeId{"hall", "c"})) << length;
  }
}

TEST(FleetRollOutJournal, AnothersIsRefused) {
  const Folder folder;
  const auto path = folder.file("j");
  ASSERT_TRUE(RollOutJournal::open(path, the_dcf));
  for (const RollOutJournal::What& other : {RollOutJournal::What{"configure", "drive", 1},
                                            {"configure", "pump", 0x1234},
                                            {"program download", "drive", 0x1234}}) {
    const auto opened = RollOutJournal::open(path, other);
    ASSERT_FALSE(opened);
    EXPECT_NE(opened.error().find("another roll-out"), std::string::npos) << opened.error();
  }
  const std::string before = "not mine\n";
  write(path, before);
  EXPECT_FALSE(RollOutJournal::open(path, the_dcf));
  EXPECT_EQ(read(path), before);
  EXPECT_FALSE(RollOutJournal::open(folder.file("none/j"), the_dcf));
}

}  // namespace berth::fleet
