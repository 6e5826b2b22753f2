// Lines of a campaign: written, read, joined, summed up.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <fstream>
#include <limits>
#include <string>

#include "berth/campaign/line.hpp"
#include "berth/campaign/results.hpp"
#include "berth/campaign/seeds.hpp"
#include "berth/campaign/summary.hpp"
#include "tests/campaign/folder.hpp"

namespace berth::campaign {
namespace {

Line line_of(std::uint64_t seed, Verdict verdict = Verdict::good, double operational = 2.5) {
  Line line;
  line.key = {.kind = Kind::faults, .options = "--variant twins", .version = "0.1.0", .seed = seed};
  line.verdict = verdict;
  line.figures = {operational, 41.25, 1234, 7};
  line.hash = 0x0123456789ABCDEF;
  if (verdict != Verdict::good) line.reason = "slot s3 is absent: \"why\"\nand more";
  return line;
}

TEST(CampaignLine, IsOneObjectWithTheKeysOfThePage) {
  EXPECT_EQ(to_json(line_of(17)),
            R"({"kind":"faults","seed":17,"version":"0.1.0","options":"--variant twins","outcome":"good",)"
            R"("operational_s":2.5,"bus_time_s":41.25,"frames":1234,"lost":7,"hash":"0123456789abcdef"})");
  Line plain;
  plain.key = {.kind = Kind::compare, .options = {}, .version = "1", .seed = 0};
  plain.verdict = Verdict::too_long;
  EXPECT_EQ(to_json(plain), R"({"kind":"compare","seed":0,"version":"1","outcome":"too long"})");
}

RC_GTEST_PROP(CampaignLine, IsReadAsItWasWritten, ()) {
  Line line;
  line.key.kind = static_cast<Kind>(*rc::gen::inRange(0, static_cast<int>(kinds)));
  line.key.seed = *rc::gen::arbitrary<std::uint64_t>();
  line.key.version = "0.1.0";
  line.verdict = static_cast<Verdict>(*rc::gen::inRange(0, static_cast<int>(verdicts)));
  const auto text = rc::gen::container<std::string>(rc::gen::inRange<char>(1, 127));
  line.reason = *text;
  line.cell = *text;
  line.hash = *rc::gen::arbitrary<std::uint64_t>();
  line.figures.lost = *rc::gen::arbitrary<std::uint64_t>();
  line.figures.bus_time_s = *rc::gen::inRange(0, 1'000'000) / 7.0;
  const std::string written = to_json(line);
  RC_ASSERT(written.find('\n') == std::string::npos);
  RC_ASSERT(written.starts_with(line_begin));
  RC_ASSERT(written.find(line_begin, 1) == std::string::npos);
  const auto read = parse_line(written);
  RC_ASSERT(read.has_value());
  RC_ASSERT(*read == line);
}

TEST(CampaignLine, WhatIsNoLineIsRefused) {
  const std::string good = to_json(line_of(1));
  EXPECT_TRUE(parse_line(good));
  for (std::size_t size = 0; size < good.size(); ++size) EXPECT_FALSE(parse_line(good.substr(0, size))) << size;
  for (const char* bad :
       {"[]", "17", R"({"kind":"faults"})", R"({"kind":"faults","seed":-1,"version":"1","outcome":"good"})",
        R"({"kind":"faults","seed":1.5,"version":"1","outcome":"good"})",
        R"({"kind":"fault","seed":1,"version":"1","outcome":"good"})",
        R"({"kind":"faults","seed":1,"version":"","outcome":"good"})",
        R"({"kind":"faults","seed":1,"version":"1","outcome":"well"})",
        R"({"kind":"faults","seed":1,"version":"1","outcome":"good","frames":"7"})",
        R"({"kind":"faults","seed":1,"version":"1","outcome":"good","bus_time_s":-1})",
        R"({"kind":"faults","seed":1,"version":"1","outcome":"good","bus_time_s":1e999})",
        R"({"kind":"faults","seed":1,"version":"1","outcome":"good","hash":"12"})",
        R"({"kind":"faults","seed":1,"version":"1","outcome":"good","hash":"-123456789abcdef"})"}) {
    EXPECT_FALSE(parse_line(bad)) << bad;
  }
  EXPECT_TRUE(parse_line(R"({"kind":"faults","seed":1,"version":"1","outcome":"good","new":[1]})"));
  EXPECT_FALSE(parse_line(good + std::string(longest_line, ' ')));
}

TEST(CampaignLine, AReasonOfAnyLengthAndAnyBytesMakesALineThatIsRead) {
  Line line = line_of(1, Verdict::failed);
  line.reason = std::string(1'000'000, '\x01');
  EXPECT_TRUE(parse_line(to_json(line)));
  line.reason = "caf\xE9 \xFF";
  EXPECT_TRUE(parse_line(to_json(line)));
}

TEST(CampaignSeeds, AreARangeOrOne) {
  const auto seeds = parse_seeds("3..12");
  ASSERT_TRUE(seeds);
  EXPECT_EQ(seeds->count(), 10U);
  EXPECT_TRUE(seeds->has(3) && seeds->has(12) && !seeds->has(2) && !seeds->has(13));
  EXPECT_EQ(parse_seeds("7")->count(), 1U);
  EXPECT_EQ(parse_seeds("18446744073709551615")->first, std::numeric_limits<std::uint64_t>::max());
  for (const char* bad :
       {"", "..", "1..", "..2", "2..1", "1-2", "-1", "1...2", "1..2..3", "18446744073709551616", " 1"})
    EXPECT_FALSE(parse_seeds(bad)) << bad;
}

TEST(CampaignResults, ASeedCountsOnceAndAContradictionIsTold) {
  Results results;
  results.add(line_of(1), "a");
  results.add(line_of(1), "b");
  EXPECT_EQ(results.doubles(), 1U);
  EXPECT_TRUE(results.contradictions().empty());
  results.add(line_of(1, Verdict::failed), "c");
  Line other_version = line_of(1, Verdict::failed);
  other_version.key.version = "0.2.0";
  results.add(other_version, "c");
  ASSERT_EQ(results.contradictions().size(), 1U);
  EXPECT_EQ(results.contradictions()[0].first_from, "a");
  EXPECT_EQ(results.contradictions()[0].other_from, "c");
  EXPECT_EQ(results.contradictions()[0].other.verdict, Verdict::failed);
  EXPECT_EQ(results.lines().size(), 2U);
  EXPECT_EQ(results.lines().begin()->second.verdict, Verdict::good) << "the first one stays";
}

TEST(CampaignResults, AnotherFigureIsAContradictionToo) {
  Results results;
  results.add(line_of(1, Verdict::good, 2.5), "a");
  results.add(line_of(1, Verdict::good, 2.6), "b");
  EXPECT_EQ(results.contradictions().size(), 1U);
}

// How long a seed may take, and how much memory there is, is the computer's: it contradicts nothing.
TEST(CampaignResults, WhatIsNoResultGivesWayToOne) {
  for (const auto verdict : {Verdict::too_long, Verdict::killed}) {
    for (const bool first : {true, false}) {
      Results results;
      results.add(first ? line_of(1, verdict) : line_of(1), "a");
      results.add(first ? line_of(1) : line_of(1, verdict), "b");
      EXPECT_TRUE(results.contradictions().empty());
      EXPECT_EQ(results.lines().begin()->second.verdict, Verdict::good);
    }
  }
  Results crashed;
  crashed.add(line_of(1, Verdict::crashed), "a");
  crashed.add(line_of(1), "b");
  EXPECT_EQ(crashed.contradictions().size(), 1U);
}

TEST(CampaignResults, ATornLastLineIsPassedOver) {
  const test::Folder folder;
  const std::string one = to_json(line_of(1)) + "\n", two = to_json(line_of(2)) + "\n";
  for (std::size_t size = 1; size + 1 < two.size(); ++size) {
    Results results;
    const auto file = results.read(folder.write("torn", one + two.substr(0, size)));
    ASSERT_TRUE(file);
    EXPECT_EQ(file->lines, 1U);
    EXPECT_EQ(file->torn_at, one.size());
    EXPECT_TRUE(file->torn());
    EXPECT_EQ(file->bad_lines, 0U);
  }
  Results results;
  const auto file = results.read(folder.write("whole", one + two.substr(0, two.size() - 1)));
  ASSERT_TRUE(file);
  EXPECT_EQ(file->lines, 2U);
  EXPECT_FALSE(file->torn());
  EXPECT_TRUE(file->lacks_line_feed);
}

// `cat a b`, where a ends with a torn line.
TEST(CampaignResults, FilesThatCatJoinedLoseOnlyWhatWasTorn) {
  const test::Folder folder;
  const std::string two = to_json(line_of(2)), three = to_json(line_of(3));
  for (std::size_t size = 1; size < two.size(); ++size) {
    Results results;
    const auto file =
        results.read(folder.write("cat", to_json(line_of(1)) + "\r\n\n" + two.substr(0, size) + three + "\n"));
    ASSERT_TRUE(file);
    EXPECT_EQ(results.lines().size(), 2U) << size;
    EXPECT_EQ(results.lines().rbegin()->first.seed, 3U);
    EXPECT_EQ(file->bad_lines + file->pieces, 1U) << size;
  }
}

TEST(CampaignResults, OtherLinesAreNamed) {
  const test::Folder folder;
  Results results;
  const auto file = results.read(folder.write("mixed", to_json(line_of(1)) + "\nhello\n\nworld\n"));
  ASSERT_TRUE(file);
  EXPECT_EQ(file->bad_lines, 2U);
  EXPECT_EQ(file->first_bad, 2U);
  EXPECT_EQ(results.lines().size(), 1U);
  const auto endless = results.read(folder.write("endless", std::string(5'000'000, 'x') + "\n" + to_json(line_of(9))));
  ASSERT_TRUE(endless);
  EXPECT_EQ(endless->lines, 1U);
  EXPECT_FALSE(results.read(folder.file("none")));
}

TEST(CampaignResults, AFileOfSomethingElseIsForeign) {
  const test::Folder folder;
  const std::string line = to_json(line_of(1));
  const auto is_foreign = [&](const std::string& text) {
    Results results;
    const auto file = results.read(folder.write("f", text));
    return file && file->foreign();
  };
  for (const char* other : {"a thesis\n", "a thesis", "{\"kind\":1}\n", "{\"seed\":1}",
                            "\x7F"
                            "ELF"})
    EXPECT_TRUE(is_foreign(other)) << other;
  // Nothing yet, or a job that was killed in its first line.
  for (std::size_t size = 0; size <= line.size(); ++size) EXPECT_FALSE(is_foreign(line.substr(0, size))) << size;
  EXPECT_FALSE(is_foreign("\n"));
  EXPECT_FALSE(is_foreign("hello\n" + line + "\n")) << "it has a line";
}

TEST(CampaignSummary, NamesTheSeedsWithoutALine) {
  Results results;
  for (const std::uint64_t seed : {7, 3, 4, 12, 5}) results.add(line_of(seed), "a");
  Line tree = line_of(9);
  tree.key.kind = Kind::trees;
  results.add(tree, "a");
  const auto ranges = summarize(results).ranges;
  ASSERT_EQ(ranges.size(), 2U);
  EXPECT_EQ(ranges[0].kind, Kind::faults);
  EXPECT_EQ(ranges[0].count, 5U);
  EXPECT_EQ(ranges[0].seeds.first, 3U);
  EXPECT_EQ(ranges[0].seeds.last, 12U);
  ASSERT_EQ(ranges[0].missing.size(), 2U);
  EXPECT_EQ(ranges[0].missing[0].first, 6U);
  EXPECT_EQ(ranges[0].missing[0].last, 6U);
  EXPECT_EQ(ranges[0].missing[1].first, 8U);
  EXPECT_EQ(ranges[0].missing[1].last, 11U);
  EXPECT_EQ(ranges[1].seeds.count(), 1U);
  EXPECT_TRUE(ranges[1].missing.empty());
}

TEST(CampaignSummary, GivesValuesThatCame) {
  std::vector<double> values;
  for (int i = 100; i > 0; --i) values.push_back(i);
  EXPECT_EQ(spread_of(values), (Spread{100, 50, 95, 100}));
  EXPECT_EQ(spread_of({3, 1, 2}), (Spread{3, 2, 3, 3}));
  EXPECT_EQ(spread_of({7}), (Spread{1, 7, 7, 7}));
  EXPECT_EQ(spread_of({}), Spread{});
}

TEST(CampaignSummary, CountsEachKindByItselfAndNamesWhatIsNotGood) {
  Results results;
  results.add(line_of(1), "a");
  results.add(line_of(5, Verdict::crashed, 4), "a");
  Line tree = line_of(2);
  tree.key.kind = Kind::trees;
  tree.figures = {};
  results.add(tree, "a");
  const auto summary = summarize(results);
  ASSERT_EQ(summary.failures.size(), 1U);
  EXPECT_EQ(summary.failures[0].key.seed, 5U);
  ASSERT_EQ(summary.groups.size(), 2U);
  const Group& faults = summary.groups[0];
  EXPECT_EQ(faults.seeds(), 2U);
  EXPECT_EQ(faults.of(Verdict::good), 1U);
  EXPECT_EQ(faults.of(Verdict::crashed), 1U);
  EXPECT_EQ(faults.first, 1U);
  EXPECT_EQ(faults.last, 5U);
  EXPECT_EQ(faults.operational_s, (Spread{2, 2.5, 4, 4}));
  EXPECT_EQ(summary.groups[1].operational_s.count, 0U);
}

}  // namespace
}  // namespace berth::campaign
