// What shells and man(1) get from the table of the verbs: `berth completion`, what the scripts ask for at TAB, `berth
// man`.
#include <gtest/gtest.h>
#include <string>
#include <vector>

#include <algorithm>
#include <filesystem>
#include <set>
#include <sstream>

#include "../paths.hpp"
#include "../shell.hpp"
#include "berth/command/verbs.hpp"
#include "environment.hpp"
#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// The candidates for the last of these words, without what they mean.
std::set<std::string> offered(Words words) {
  words.insert(words.begin(), "__complete");
  const Outcome outcome = berth(words);
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  std::set<std::string> found;
  for (const auto& line : lines_of(outcome.out)) found.insert(line.substr(0, line.find('\t')));
  return found;
}

using Set = std::set<std::string>;

// ---- what is offered ----

TEST(Complete, VerbsAndTheirVerbs) {
  EXPECT_EQ(offered({"stat"}), Set{"status"});
  EXPECT_EQ(offered({"backup", ""}), (Set{"compare", "restore", "save"}));
  EXPECT_EQ(offered({"lss", "identify"}), (Set{"identify", "identify-unconfigured"}));
  EXPECT_EQ(offered({"help", "sdo", "re"}), (Set{"read", "release"}));
  EXPECT_TRUE(offered({""}).contains("help"));
  EXPECT_FALSE(offered({""}).contains("__complete"));
  EXPECT_EQ(offered({"no-such-verb", "x"}), Set{});
}

// Each option that the help page shows, and each line says what it is for.
TEST(Complete, OptionsAreThoseOfTheHelp) {
  const Outcome page = berth({"up", "--help"});
  const auto found = offered({"up", "--"});
  std::size_t shown = 0;
  for (const auto& line : lines_of(page.out)) {
    const auto at = line.find("--");
    if (!line.starts_with("  -") || at == std::string::npos) continue;
    const std::string name = line.substr(at, line.find_first_of(" ,", at) - at);
    EXPECT_TRUE(found.contains(name)) << line;
    ++shown;
  }
  EXPECT_GT(shown, 20U);
  for (const auto& line : lines_of(berth({"__complete", "up", "--"}).out)) {
    EXPECT_LT(line.find('\t') + 4, line.size()) << line;
  }
}

TEST(Complete, AnOptionIsOfferedOnce) {
  EXPECT_FALSE(offered({"up", "--json", "--js"}).contains("--json"));
  EXPECT_TRUE(offered({"up", "--port", "can0", "--po"}).contains("--port")) << "there may be one for each bus";
  EXPECT_EQ(offered({"up", "--", "--js"}), Set{":tables"}) << "after -- there are no options";
}

TEST(Complete, Choices) {
  EXPECT_EQ(offered({"up", "--until", ""}), (Set{"operational", "replaced"}));
  EXPECT_EQ(offered({"up", "--until=o"}), Set{"--until=operational"});
  EXPECT_EQ(offered({"completion", "z"}), Set{"zsh"});
  EXPECT_EQ(offered({"status", "--color", "a"}), (Set{"always", "auto"}));
}

// The choices of the table are words of the help, and the verb takes each.
TEST(Complete, ChoicesOfTheTable) {
  int all = 0;
  for (const auto& verb : command::verbs()) {
    for (const auto& parameter : verb.parameters) {
      std::istringstream choices{std::string(parameter.choices)};
      for (std::string choice; choices >> choice; ++all) {
        EXPECT_NE(parameter.help.find(choice), std::string_view::npos) << verb.name << ": " << choice;
      }
    }
  }
  EXPECT_GE(all, 7);
  EXPECT_EQ(offered({"nmt", "re"}), (Set{":tables", "reset-comm", "reset-node"}));
  EXPECT_EQ(offered({"lss", "global", ""}), (Set{":tables", "configuration", "waiting"}));
}

TEST(Complete, Files) {
  EXPECT_EQ(offered({"up", "ma"}), Set{":tables"});
  EXPECT_EQ(offered({"up", "-m", ""}), Set{":tables"});
  EXPECT_EQ(offered({"up", "--record", ""}), Set{":files"});
  EXPECT_EQ(offered({"man", "--all", ""}), Set{":folders"});
  EXPECT_EQ(berth({"__complete", "up", "--record=x"}).out, ":files\t--record=\n");
  EXPECT_EQ(offered({"scan", "x"}), Set{":tables"}) << "a machine file may stand among other words";
}

class CompleteHere : public ::testing::Test {
 protected:
  Folder folder;
  std::string machine = folder.write("machine.toml", small_machine);
};

TEST_F(CompleteHere, SlotsAndBusesOfTheMachine) {
  EXPECT_EQ(offered({"status", "-m", machine, ""}), (Set{"left", "right", "drive"}));
  EXPECT_EQ(offered({"status", machine, "dr"}), Set{"drive"});
  EXPECT_EQ(offered({"sdo", "read", "--machine=" + machine, "le"}), Set{"left"});
  EXPECT_EQ(offered({"status", "-m", machine, "--bus", ""}), Set{"line"});
  EXPECT_EQ(offered({"status", "-m", folder.file("none.toml"), "--bus", ""}), Set{}) << "and no error";
}

// ---- real shells ----

class RealShell : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    if (!has("python3")) GTEST_SKIP() << "needs shells: python3 is not installed";
    if (!has(GetParam())) GTEST_SKIP() << "needs shells: " << GetParam() << " is not installed";
    script = folder.write("script", berth({"completion", GetParam()}).out);
    const std::string program = folder.write("berth", "#!/bin/sh\n[ \"$1\" != __complete ] || exec " + binary() +
                                                          " \"$@\"\n"
                                                          "printf '%s\\n' \"$@\" >'" +
                                                          folder.file("new") + "' && mv '" + folder.file("new") +
                                                          "' '" + folder.file("words") + "'\n");
    std::filesystem::permissions(program, std::filesystem::perms::owner_all);
    std::string machine = small_machine;
    machine.replace(machine.find("\"drive\""), 7, "\"main drive\"");
    (void)folder.write("machine.toml", machine);
    (void)folder.write("other.txt", "");
  }
  /// The words that the program gets after this was typed.
  [[nodiscard]] Words typed(const std::string& text) {
    std::filesystem::remove(folder.file("words"));
    const Ran ran = shell("python3 '" + source_dir() + "/tests/cli/complete_in.py' " + GetParam() + " '" + script +
                          "' '" + folder.file("") + "' '" + text + "'");
    EXPECT_EQ(ran.status, 0) << text;
    return lines_of(ran.out);
  }
  Folder folder;
  std::string script;
};

TEST_P(RealShell, CompletesVerbsAndOptions) {
  EXPECT_EQ(typed("berth stat\t"), Words{"status"});
  EXPECT_EQ(typed("berth sdo dum\t --js\t"), (Words{"sdo", "dump", "--json"}));
}

TEST_P(RealShell, CompletesChoicesInTheSameWord) {
  EXPECT_EQ(typed("berth up --until=op\t"), Words({"up", "--until=operational"}));
}

TEST_P(RealShell, CompletesMachineFilesOnly) {
  EXPECT_EQ(typed("berth up ma\t"), (Words{"up", "machine.toml"}));
  EXPECT_EQ(typed("berth up oth\t"), (Words{"up", "oth"}));
  EXPECT_EQ(typed("berth up --record oth\t"), (Words{"up", "--record", "other.txt"}));
}

TEST_P(RealShell, CompletesASlotWithABlankInItsName) {
  EXPECT_EQ(typed("berth status mai\t"), (Words{"status", "main drive"}));
}

INSTANTIATE_TEST_SUITE_P(Shells, RealShell, ::testing::Values("bash", "zsh", "fish"),
                         [](const auto& one) { return std::string(one.param); });

// ---- manual pages ----

/// The verbs, as `berth man --all` names their pages.
class Man : public ::testing::Test {
 protected:
  void SetUp() override {
    const Outcome outcome = berth({"man", "--all", folder.file("man1")});
    ASSERT_EQ(outcome.status, 0) << outcome.err;
    for (const auto& entry : std::filesystem::directory_iterator(folder.file("man1"))) pages.push_back(entry.path());
    std::ranges::sort(pages);
  }
  Folder folder;
  std::vector<std::filesystem::path> pages;
};

TEST_F(Man, EveryCommandHasAPage) {
  EXPECT_GT(pages.size(), 80U);
  Set names;
  for (const auto& page : pages) names.insert(page.filename().string());
  EXPECT_TRUE(names.contains("berth.1"));
  EXPECT_TRUE(names.contains("berth-sdo-read.1"));
  for (const auto& verb : offered({""})) {
    const bool is_verb = verb != "help" && !verb.starts_with("-");
    EXPECT_TRUE(!is_verb || names.contains("berth-" + verb + ".1")) << verb;
  }
  EXPECT_EQ(contents(folder.file("man1/berth-sdo-read.1")), berth({"man", "sdo", "read"}).out);
}

// troff and mandoc find nothing to complain about, and nothing is lost: what the help says is on the page.
TEST_F(Man, PagesAreFreeOfWarnings) {
  if (!has("groff")) GTEST_SKIP() << "needs shells: groff is not installed";
  for (const auto& page : pages) {
    const Ran ran = shell("groff -man -Kutf8 -Tutf8 -ww -z '" + page.string() + "' 2>&1");
    EXPECT_EQ(ran.status, 0) << page;
    EXPECT_EQ(ran.out, "") << page;
  }
}

TEST_F(Man, ThePageSaysWhatTheHelpSays) {
  if (!has("groff")) GTEST_SKIP() << "needs shells: groff is not installed";
  const Ran ran = shell("groff -man -Kutf8 -Tascii -P-cbou '" + folder.file("man1/berth-sdo-read.1") + "'");
  std::string page;
  std::istringstream words(ran.out);
  for (std::string word; words >> word;) page += word + " ";
  for (const char* const part :
       {"berth-sdo-read - ", "NAME", "SYNOPSIS berth sdo read", "--watch TIME", "repeat at this interval",
        "EXIT STATUS", "berth sdo read 5 1018h:04", "SEE ALSO berth-sdo(1), berth(1)"}) {
    EXPECT_NE(page.find(part), std::string::npos) << part << " in " << page;
  }
}

TEST_F(Man, ThePageOfNoCommandIsRefused) {
  const Outcome outcome = berth({"man", "sdo", "rad"});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_NE(outcome.err.find("berth sdo has no command \"rad\""), std::string::npos) << outcome.err;
}

// A page of a package has the date of its sources, and so the same bytes when it is made again.
TEST(ManPage, ItsDateIsThatOfTheSources) {
  const EnvironmentVariable epoch("SOURCE_DATE_EPOCH", "1700000000");
  const auto version = lines_of(berth({"version"}).out).front();
  EXPECT_EQ(lines_of(berth({"man", "up"}).out).front(),
            R"(.TH "BERTH\-UP" 1 "2023-11-14" ")" + version + R"(" "Berth")");
}

}  // namespace
}  // namespace berth::test
