// `berth study` from the outside (docs/campaigns.md).
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>
#include <algorithm>
#include <array>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "../paths.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using Json = nlohmann::json;

std::vector<std::string> lines_in(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}
std::multiset<std::string> set_of(const std::string& text) {
  const auto lines = lines_in(text);
  return {lines.begin(), lines.end()};
}

// The processes that a process has made and that are there.
std::vector<pid_t> children(pid_t of) {
  std::ifstream in("/proc/" + std::to_string(of) + "/task/" + std::to_string(of) + "/children");
  std::vector<pid_t> all;
  for (pid_t child = 0; in >> child;) all.push_back(child);
  return all;
}

// In a shell, with what goes before the program.
Outcome in_shell(const std::string& before, const std::string& words) {
  const Folder folder;
  const std::string line =
      before + " '" + binary() + "' " + words + " >" + folder.file("out") + " 2>" + folder.file("err");
  const int status = std::system(("bash -c \"" + line + "\"").c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, contents(folder.file("out")), contents(folder.file("err"))};
}

TEST(StudyCommand, PrintsALineForEachSeed) {
  const auto run = berth({"study", "--seeds", "2..4", "--jobs", "1"});
  ASSERT_EQ(run.status, 0) << run.err;
  const auto lines = lines_in(run.out);
  ASSERT_EQ(lines.size(), 3U);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const auto json = Json::parse(lines[i]);
    EXPECT_EQ(json.at("kind"), "faults");
    EXPECT_EQ(json.at("seed"), i + 2);
    EXPECT_EQ(json.at("outcome"), "good");
    EXPECT_GT(json.at("frames").get<unsigned>(), 100U);
    EXPECT_GT(json.at("bus_time_s").get<double>(), 1.0);
    EXPECT_TRUE(json.contains("lost"));
    EXPECT_EQ(json.at("hash").get<std::string>().size(), 16U);
    EXPECT_FALSE(json.contains("replay"));
  }
}

TEST(StudyCommand, EveryKindGivesTheSameLinesWithOneJobAndWithTwo) {
  for (const auto* kind : {"faults", "matrix", "compare"}) {
    const auto one = berth({"study", kind, "--seeds", "1..6", "--jobs", "1"});
    const auto two = berth({"study", kind, "--seeds", "1..6", "--jobs", "2"});
    EXPECT_EQ(one.status, 0) << one.err << one.out;
    EXPECT_EQ(two.status, 0);
    EXPECT_EQ(set_of(one.out).size(), 6U) << kind;
    EXPECT_EQ(set_of(one.out), set_of(two.out)) << kind;
  }
}

TEST(StudyCommand, ATreeIsGoodAndGoodTwice) {
  const auto run = berth({"study", "trees", "--variant", "plain", "--seeds", "3", "--twice"});
  ASSERT_EQ(run.status, 0) << run.err << run.out;
  const auto json = Json::parse(run.out);
  EXPECT_EQ(json.at("options"), "--variant plain --twice");
  EXPECT_EQ(json.at("outcome"), "good");
  EXPECT_GT(json.at("operational_s").get<double>(), 0.1);
}

TEST(StudyCommand, AFileGetsOnlyWhatItLacks) {
  const Folder folder;
  const std::string file = folder.file("a.jsonl");
  const auto first = berth({"study", "--seeds", "2..3", "--out", file});
  ASSERT_EQ(first.status, 0) << first.err;
  EXPECT_EQ(first.out, "2 of 2 seeds in " + file + ": 2 good\n");
  const std::string before = contents(file);
  const auto more = berth({"study", "--seeds", "2..5", "--out", file, "--json"});
  ASSERT_EQ(more.status, 0) << more.err;
  EXPECT_EQ(Json::parse(more.out).at("good"), 4);
  EXPECT_TRUE(contents(file).starts_with(before)) << "the lines that were there stay as they are";
  EXPECT_EQ(lines_in(contents(file)).size(), 4U);
  const std::string after = contents(file);
  EXPECT_EQ(berth({"study", "--seeds", "2..5", "--out", file}).status, 0);
  EXPECT_EQ(contents(file), after);
  // Other options are other work.
  EXPECT_EQ(berth({"study", "--seeds", "2", "--variant", "twins", "--out", file}).status, 0);
  EXPECT_EQ(lines_in(contents(file)).size(), 5U);
}

TEST(StudyCommand, IsKilledInTheMiddleAndGoesOn) {
  const Folder folder;
  const std::string file = folder.file("a.jsonl");
  const Words words{"study", "--seeds", "1..24", "--jobs", "2", "--out", file};
  {
    const Background run(words);
    ASSERT_TRUE(eventually([&] { return lines_in(contents(file)).size() >= 3; }));
    const auto workers = children(run.pid());
    EXPECT_EQ(workers.size(), 2U);
    run.signal(SIGKILL);
    for (const pid_t worker : workers) EXPECT_TRUE(eventually([&] { return ::kill(worker, 0) != 0; }));
  }
  std::string kept = contents(file);
  const auto had = lines_in(kept).size();
  EXPECT_LT(had, 24U) << "it was over before it was killed";
  // As if the power had failed in the middle of a line.
  std::ofstream(file, std::ios::app) << lines_in(kept).front().substr(0, 40);
  const auto again = berth(words);
  ASSERT_EQ(again.status, 0) << again.err;
  EXPECT_NE(again.err.find("its torn last line was taken off"), std::string::npos) << again.err;
  EXPECT_TRUE(contents(file).starts_with(kept));
  EXPECT_EQ(set_of(contents(file)), set_of(berth({"study", "--seeds", "1..24"}).out));
}

TEST(StudyCommand, CtrlCLosesOnlyTheSeedsUnderWay) {
  const Folder folder;
  const std::string file = folder.file("a.jsonl");
  Background run({"study", "--seeds", "1..100000", "--jobs", "2", "--out", file});
  ASSERT_TRUE(eventually([&] { return lines_in(contents(file)).size() >= 3; }));
  run.signal(SIGINT);
  const auto ended = run.end();
  EXPECT_EQ(ended.status, 3);
  const auto lines = lines_in(contents(file));
  EXPECT_NE(ended.out.find(std::to_string(lines.size()) + " of 100000 seeds"), std::string::npos) << ended.out;
  EXPECT_NE(ended.err.find("the same command does the rest"), std::string::npos) << ended.err;
  EXPECT_TRUE(contents(file).ends_with("}\n"));
  for (const auto& line : lines) EXPECT_TRUE(Json::accept(line));
}

TEST(StudyCommand, ASeedThatCrashesIsALine) {
  const Folder folder;
  const std::string file = folder.file("a.jsonl");
  Background run({"study", "trees", "--seeds", "1..3", "--jobs", "1", "--out", file});
  ASSERT_TRUE(eventually([&] { return children(run.pid()).size() == 1; }));
  ::kill(children(run.pid()).front(), SIGABRT);
  const auto ended = run.end();
  EXPECT_EQ(ended.status, 1);
  EXPECT_NE(ended.out.find("trees 1 crashed: signal 6"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("berth study --summary " + file), std::string::npos) << ended.out;
  const auto lines = lines_in(contents(file));
  ASSERT_EQ(lines.size(), 3U);
  const auto json = Json::parse(lines[0]);
  EXPECT_EQ(json.at("outcome"), "crashed");
  EXPECT_EQ(json.at("replay"), "berth study trees --seeds 1 --show");
  EXPECT_EQ(Json::parse(lines[1]).at("outcome"), "good");
  // It is a result, and stays.
  EXPECT_EQ(berth({"study", "trees", "--seeds", "1..3", "--out", file}).status, 1);
  EXPECT_EQ(lines_in(contents(file)).size(), 3U);
}

// As the system does when memory runs out: that is no word about the seed.
TEST(StudyCommand, ASeedThatWasKilledIsTriedAgainNextTime) {
  const Folder folder;
  const std::string file = folder.file("a.jsonl");
  Background run({"study", "trees", "--seeds", "1..2", "--jobs", "1", "--out", file});
  ASSERT_TRUE(eventually([&] { return children(run.pid()).size() == 1; }));
  ::kill(children(run.pid()).front(), SIGKILL);
  const auto ended = run.end();
  EXPECT_EQ(ended.status, 1);
  EXPECT_NE(ended.out.find("trees 1 killed: signal 9"), std::string::npos) << ended.out;
  EXPECT_EQ(Json::parse(lines_in(contents(file)).at(0)).at("outcome"), "killed");
  const auto again = berth({"study", "trees", "--seeds", "1..2", "--out", file, "--json"});
  EXPECT_EQ(again.status, 0) << again.out;
  EXPECT_EQ(Json::parse(again.out).at("good"), 2);
  EXPECT_EQ(lines_in(contents(file)).size(), 3U);
  EXPECT_EQ(berth({"study", "--summary", file}).status, 0);
}

TEST(StudyCommand, ASeedThatTakesTooLongIsTriedAgainNextTime) {
  const Folder folder;
  const std::string file = folder.file("a.jsonl");
  const auto cut = berth({"study", "trees", "--seeds", "1", "--limit", "1 ms", "--out", file});
  EXPECT_EQ(cut.status, 1);
  EXPECT_EQ(Json::parse(contents(file)).at("outcome"), "too long");
  EXPECT_EQ(berth({"study", "trees", "--seeds", "1", "--out", file}).status, 0);
  EXPECT_EQ(lines_in(contents(file)).size(), 2U);
  const auto summary = berth({"study", "--summary", file, "--json"});
  EXPECT_EQ(summary.status, 0) << "the result counts";
  EXPECT_EQ(Json::parse(summary.out).at("groups").at(0).at("seeds"), 1);
}

TEST(StudyCommand, JoinsFilesAndReportsContradictions) {
  const Folder folder;
  const std::string all = berth({"study", "--seeds", "1..4"}).out;
  const auto lines = lines_in(all);
  ASSERT_EQ(lines.size(), 4U);
  std::vector<std::string> sorted = lines;
  std::ranges::sort(sorted, {}, [](const std::string& line) { return Json::parse(line).at("seed").get<int>(); });
  const std::string text = sorted[0] + "\n" + sorted[1] + "\n" + sorted[2] + "\n" + sorted[3] + "\n";
  const auto a = folder.write("a", sorted[2] + "\n" + sorted[0] + "\n" + sorted[1].substr(0, 60));
  const auto b = folder.write("b", sorted[1] + "\n" + sorted[2] + "\n" + sorted[3] + "\n");
  const auto merged = berth({"study", "--merge", a, b, "--out", folder.file("all")});
  ASSERT_EQ(merged.status, 0) << merged.err;
  EXPECT_EQ(merged.out, "4 lines in " + folder.file("all") + "; 1 doubles, 0 contradictions\n");
  EXPECT_EQ(contents(folder.file("all")), text);
  EXPECT_EQ(berth({"study", "--merge", a, b}).out, text);
  // `cat a b` has a's torn line in the middle.
  EXPECT_EQ(berth({"study", "--merge", folder.write("cat", contents(a) + contents(b))}).out, text);

  std::string other = sorted[0];
  other.replace(other.find("\"good\""), 6, "\"failed\",\"reason\":\"slot s1\"");
  const auto c = folder.write("c", other + "\n");
  const auto wrong = berth({"study", "--merge", a, c});
  EXPECT_EQ(wrong.status, 1);
  EXPECT_EQ(lines_in(wrong.out)[0], sorted[0]);
  EXPECT_NE(wrong.err.find("faults 1 of version"), std::string::npos) << wrong.err;
  EXPECT_NE(wrong.err.find("says good"), std::string::npos) << wrong.err;
  EXPECT_NE(wrong.err.find("says failed (slot s1)"), std::string::npos) << wrong.err;
  EXPECT_EQ(berth({"study", "--merge", a, b, "--out", a, "--force"}).status, 2) << "a file that it reads";
}

TEST(StudyCommand, ADamagedLineAndSeedsThatAreMissingAreNamed) {
  const Folder folder;
  std::string text;
  for (const int seed : {1, 2, 5, 9}) {
    text += Json{{"kind", "faults"}, {"seed", seed}, {"version", "9"}, {"outcome", "good"}}.dump() + "\n";
    if (seed == 2) text += "damaged\n";
  }
  const auto file = folder.write("a", text);
  for (const auto* what : {"--merge", "--summary"}) {
    const auto run = berth({"study", what, file});
    EXPECT_EQ(run.status, 1) << what;
    EXPECT_NE(run.err.find(file + ":3: it is no JSON object; 1 such line passed over"), std::string::npos) << run.err;
  }
  const auto shown = berth({"study", "--summary", file});
  EXPECT_NE(shown.out.find("faults: 5 of the seeds 1..9 without a line: 3..4, 6..8\n"), std::string::npos) << shown.out;
  const auto json = Json::parse(berth({"study", "--summary", file, "--json"}).out);
  EXPECT_EQ(json.at("ranges").at(0).at("missing"), Json::parse(R"(["3..4","6..8"])"));
  EXPECT_EQ(json.at("passed_over").at(0).at("first"), 3);
}

TEST(StudyCommand, SumsUpFailuresFirst) {
  const Folder folder;
  std::string text;
  for (int seed = 1; seed <= 100; ++seed) {
    Json json{{"kind", "faults"}, {"seed", seed}, {"version", "9"}, {"outcome", "good"}, {"operational_s", seed}};
    if (seed == 40) {
      json["outcome"] = "failed";
      json["reason"] = "slot s3 is absent";
      json["replay"] = "berth study faults --seeds 40 --show";
    }
    text += json.dump() + "\n";
  }
  // Any writer of JSON may have made them, as far as "kind" comes first.
  const auto file = folder.write("a", text);
  const auto shown = berth({"study", "--summary", file});
  EXPECT_EQ(shown.status, 1);
  const auto lines = lines_in(shown.out);
  ASSERT_EQ(lines.size(), 4U) << shown.out;
  EXPECT_EQ(lines[0], "faults 40 failed: slot s3 is absent");
  EXPECT_EQ(lines[1], "  berth study faults --seeds 40 --show");
  std::istringstream row(lines[3]);
  std::string kind, version;
  double seeds = 0, good = 0, bad = 0, median = 0, p95 = 0, most = 0;
  row >> kind >> version >> seeds >> good >> bad >> median >> p95 >> most;
  EXPECT_EQ(kind + " " + version, "faults 9");
  EXPECT_EQ((std::array{seeds, good, bad, median, p95, most}), (std::array<double, 6>{100, 99, 1, 50, 95, 100}));
  const auto json = Json::parse(berth({"study", "--summary", file, "--json"}).out);
  EXPECT_EQ(json.at("failures").size(), 1U);
  EXPECT_EQ(json.at("groups").at(0).at("operational_s").at("p95"), 95);
}

// The limit of a file's size stands for a full disk: a part of a line is written, then nothing more.
TEST(StudyCommand, AFullDiskEndsItWithoutAHalfLine) {
  constexpr std::size_t room = 8 * 1024;
  const Folder folder;
  std::string before;
  for (int seed = 1; before.size() < room - 700; ++seed)
    before += Json{{"kind", "trees"}, {"outcome", "good"}, {"seed", seed}, {"version", "9"}}.dump() + "\n";
  const std::string file = folder.write("a.jsonl", before);
  const auto full = in_shell("ulimit -f 8;", "study --seeds 1..40 --jobs 1 --out " + file);
  EXPECT_EQ(full.status, 3);
  EXPECT_NE(full.err.find(file), std::string::npos) << full.err;
  EXPECT_NE(full.err.find("File too large"), std::string::npos) << full.err;
  const std::string kept = contents(file);
  EXPECT_TRUE(kept.starts_with(before) && kept.ends_with("}\n"));
  const auto had = lines_in(kept).size() - lines_in(before).size();
  EXPECT_GT(had, 0U);
  const auto rest = berth({"study", "--seeds", "1.." + std::to_string(had + 1), "--out", file});
  EXPECT_EQ(rest.status, 0) << rest.err;
  EXPECT_TRUE(contents(file).starts_with(kept));
  EXPECT_EQ(lines_in(contents(file)).size(), lines_in(kept).size() + 1);
}

TEST(StudyCommand, WhatCannotBeWrittenOrIsAnotherFileIsNamed) {
  const Folder folder;
  const auto none = berth({"study", "--seeds", "1", "--out", folder.file("none/a")});
  EXPECT_EQ(none.status, 3);
  EXPECT_NE(none.err.find("No such file or directory"), std::string::npos) << none.err;
  const auto thesis = folder.write("thesis", "a thesis\n");
  const auto other = berth({"study", "--seeds", "1", "--out", thesis});
  EXPECT_EQ(other.status, 2);
  EXPECT_NE(other.err.find(thesis + ":1: it is no line of a campaign"), std::string::npos) << other.err;
  EXPECT_EQ(contents(thesis), "a thesis\n");
  const int full = std::system(("'" + binary() + "' study --seeds 1..2 >/dev/full 2>/dev/null").c_str());
  EXPECT_EQ(WEXITSTATUS(full), 3);
}

TEST(StudyCommand, OneFileHasOneWriter) {
  const Folder folder;
  const std::string file = folder.file("a.jsonl");
  const Background run({"study", "--seeds", "1..100000", "--jobs", "1", "--out", file});
  ASSERT_TRUE(eventually([&] { return !contents(file).empty(); }));
  const auto second = berth({"study", "--seeds", "1", "--out", file});
  EXPECT_EQ(second.status, 2);
  EXPECT_NE(second.err.find("another process writes it"), std::string::npos) << second.err;
}

TEST(StudyCommand, WrongUseIsToldWithWhatToDo) {
  const std::pair<Words, std::string> rows[]{
      {{"study"}, "--seeds 1..1000"},
      {{"study", "--seeds", "9..1"}, "no range of seeds"},
      {{"study", "fault", "--seeds", "1"}, "fault"},
      {{"study", "matrix", "--seeds", "0..3"}, "begin at 1"},
      {{"study", "compare", "--variant", "twins", "--seeds", "1"}, "has none of that name"},
      {{"study", "--seeds", "1", "--show", "--out", "x"}, "use one of them"},
      {{"study", "--summary", "/none"}, "No such file"},
      {{"study", "--merge", "/etc/passwd"}, "/etc/passwd:1: it is no file of a campaign"},
  };
  for (const auto& [words, part] : rows) {
    const auto run = berth(words);
    EXPECT_EQ(run.status, 2) << run.out;
    EXPECT_NE(run.err.find(part), std::string::npos) << run.err;
  }
}

// The line's own command shows the world: LSS frames, events, and the line.
TEST(StudyCommand, ShowPrintsWhatHappens) {
  const auto run = berth({"study", "faults", "--seeds", "2", "--show"});
  ASSERT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.out.find("operational"), std::string::npos);
  const auto lines = lines_in(run.out);
  ASSERT_GT(lines.size(), 100U);
  EXPECT_EQ(lines.back() + "\n", berth({"study", "faults", "--seeds", "2"}).out);
}

}  // namespace
}  // namespace berth::test
