// The tutorials, as somebody who types each of their commands: docs/tutorials and docs/index.md. The tutorial with a
// real adapter needs CAN interfaces: tests/vm/tutorial_test.cpp.
#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <string>

#include "../pages.hpp"
#include "../paths.hpp"

namespace berth::test {
namespace {

namespace fs = std::filesystem;

void follow(const std::string& page) {
  PageShell shell;
  follow(shell, "docs/" + page + ".md");
}

TEST(Tutorials, StartPage) { follow("index"); }
TEST(Tutorials, Simulator) { follow("tutorials/simulator"); }
TEST(Tutorials, Replacement) { follow("tutorials/replacement"); }
TEST(Tutorials, Device) { follow("tutorials/device"); }
TEST(Tutorials, Links) { follow("tutorials/links"); }
TEST(Tutorials, SecondNetwork) { follow("tutorials/second-network"); }
TEST(Tutorials, ItDoesNotWork) { follow("tutorials/it-does-not-work"); }

TEST(Tutorials, EachIsTried) {
  std::set<std::string> there;
  for (const auto& entry : fs::directory_iterator(source_dir() + "/docs/tutorials")) {
    if (entry.path().extension() == ".md") there.insert(entry.path().stem());
  }
  const std::set<std::string> tried{"README", "adapter",     "device",         "it-does-not-work",
                                    "links",  "replacement", "second-network", "simulator"};
  EXPECT_EQ(there, tried) << "a page without a test, or a test without a page";
}

TEST(PagesCompare, LinesLeftOut) {
  const std::string real = "a\nb\nc\nd\n";
  for (const auto* const shown :
       {"a\nb\nc\nd\n", "…\n", "a\n…\n", "…\nd\n", "a\n…\nd\n", "…\nb\nc\n…\n", "a\nb\n…\nd\n"}) {
    EXPECT_EQ(difference(shown, real), std::nullopt) << shown;
  }
  for (const auto* const shown : {"", "a\n", "a\nb\nc\n", "b\nc\nd\n", "a\n…\nc\n", "…\nx\n…\n", "…\nb\nd\n…\n",
                                  "a\nb\nc\nd\ne\n", "…\nd\n…\na\n", "a\nb\nc\nd\n…\nd\n"}) {
    EXPECT_NE(difference(shown, real), std::nullopt) << shown;
  }
}

TEST(PagesCompare, Times) {
  EXPECT_EQ(without_times("    0.902 s  field  5 found, 0.413 s, 12 % of 125000 bit/s"),
            " # s field 5 found, # s, # % of 125000 bit/s");
  EXPECT_NE(without_times("slot 3"), without_times("slot 4"));
}

TEST(PagesCompare, BlocksAndMarks) {
  const auto blocks = blocks_of(
      "text\n\n<!-- test: stays -->\n```console\n$ a\nb\n```\n\n<!-- test: ctrl-c -->\n\n```toml "
      "title=\"x\"\nc\n```\n");
  ASSERT_EQ(blocks.size(), 3U);
  EXPECT_EQ(blocks[0].mark + "|" + blocks[0].language + "|" + blocks[0].text, "stays|console|$ a\nb\n");
  EXPECT_EQ(blocks[0].line, 5U);
  EXPECT_EQ(blocks[1].mark + blocks[1].language, "ctrl-c");
  EXPECT_EQ(blocks[2].language + "|" + blocks[2].text, "toml|c\n");
}

}  // namespace
}  // namespace berth::test
