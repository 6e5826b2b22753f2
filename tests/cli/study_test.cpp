// `berth trace`, `berth reproduce`, `berth compare` from the outside.
#include <gtest/gtest.h>
#include <algorithm>
#include <string>

#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "process.hpp"

namespace berth::test {
namespace {

using Json = nlohmann::json;

TEST(TraceCommand, WordsTableAndNumbers) {
  const Folder folder;
  const auto log = folder.write("t.log",
                                "(0000000001.000000) can0 7E5#5100000000800000\n"
                                "(0000000001.001000) can0 1F900135#\n"
                                "(0000000001.002000) can0 7E4#4F00000000000000\n");
  const auto words = berth({"trace", log});
  EXPECT_EQ(words.status, 0);
  EXPECT_NE(words.out.find("LSS Fastscan: Checking for new nodes"), std::string::npos) << words.out;
  const auto table = berth({"trace", log, "--table"});
  EXPECT_NE(table.out.find("2\t0x1F900135\tLSS Fastscan: Bits 16 - 31 are 0x0135\t\n"), std::string::npos) << table.out;
  const auto stats = berth({"trace", log, "--stats", "--bitrate", "125000", "--json"});
  ASSERT_EQ(stats.status, 0) << stats.err;
  const auto json = Json::parse(stats.out);
  EXPECT_EQ(json.at("frames"), 3);
  EXPECT_DOUBLE_EQ(json.at("span_s").get<double>(), 0.002);
  EXPECT_EQ(json.at("buses").at(0).at("bus"), "can0");
  EXPECT_EQ(json.at("buses").at(0).at("ids").size(), 3U);
  EXPECT_GT(json.at("load").get<double>(), 0.5);
}

TEST(TraceCommand, ABadLineIsNamedAndTheRestIsShown) {
  const Folder folder;
  const auto log = folder.write("t.log", "(0000000001.000000) can0 705#00\n(1,5) can0 1#\n");
  const auto shown = berth({"trace", log});
  EXPECT_EQ(shown.status, 2);
  EXPECT_NE(shown.out.find("Boot up of node 5"), std::string::npos) << shown.out;
  EXPECT_NE(shown.err.find("t.log:2:"), std::string::npos) << shown.err;
  EXPECT_EQ(berth({"trace", folder.file("none.log")}).status, 2);
  EXPECT_EQ(berth({"trace"}).status, 2);
}

// The issue: each simulated row names a recorded trace that `berth trace --stats` confirms.
TEST(ReproduceCommand, EveryRowIsConfirmedByItsTrace) {
  const Folder folder;
  const auto run = berth({"reproduce", "--record", folder.file("traces"), "--json"});
  ASSERT_EQ(run.status, 0) << run.err;
  const auto rows = Json::parse(run.out).at("rows");
  const std::pair<int, double> published[]{{1, 0.190}, {1, 0.0301}, {1, 11.2},     {1, 16.09}, {1, 1.15},
                                           {2, 1.28},  {2, 0.44},   {2, 0.000015}, {2, 0.282}, {2, 0.562},
                                           {4, 1.25},  {4, 2.78},   {4, 0.21},     {4, 0.1}};
  for (const auto& [paper, value] : published) {
    EXPECT_TRUE(std::ranges::any_of(rows,
                                    [&](const Json& r) {
                                      return r.at("paper") == paper && r.at("published_s").is_number() &&
                                             std::abs(r.at("published_s").get<double>() - value) < 1e-9;
                                    }))
        << paper << " prints " << value;
  }
  unsigned confirmed = 0;
  for (const auto& row : rows) {
    for (const char* key : {"paper", "what", "published_s", "formula_s", "simulated_s", "berth_s", "note"})
      EXPECT_TRUE(row.contains(key)) << key;
    if (row.at("simulated_s").is_null()) continue;
    const auto log = folder.file("traces/" + row.at("trace").get<std::string>());
    const auto stats = berth({"trace", log, "--stats", "--json"});
    ASSERT_EQ(stats.status, 0) << stats.err;
    EXPECT_NEAR(Json::parse(stats.out).at("span_s").get<double>(), row.at("simulated_s").get<double>(), 1.5e-6)
        << row.at("what");
    ++confirmed;
  }
  EXPECT_EQ(confirmed, 12U);
}

TEST(ReproduceCommand, ListsThePapersTraces) {
  const auto table = berth({"reproduce", "--trace", "paper4-table2"});
  EXPECT_EQ(table.status, 0);
  EXPECT_NE(table.out.find("26\t0x7E4\tIdentify Servant\t4F 00 00 00 00 00 00 00\n"), std::string::npos) << table.out;
  const auto wrong = berth({"reproduce", "--trace", "paper9"});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_NE(wrong.err.find("paper2-table4"), std::string::npos) << wrong.err;
  EXPECT_EQ(berth({"reproduce", "--latency", "soon"}).status, 2);
  EXPECT_EQ(berth({"reproduce", "--bitrate", "7"}).status, 2);
}

TEST(CompareCommand, RowsCsvAndPlot) {
  const Folder folder;
  const auto csv = folder.file("c.csv");
  const auto svg = folder.file("c.svg");
  const auto run = berth({"compare", "--methods", "fastscan,planner-fastscan", "--devices", "1,3", "--bitrates", "125",
                          "--serials", "consecutive,random", "--seeds", "2", "--csv", csv, "--plot", svg, "--json"});
  ASSERT_EQ(run.status, 0) << run.err;
  const auto rows = Json::parse(run.out).at("rows");
  ASSERT_EQ(rows.size(), 8U);
  for (const auto& row : rows) {
    EXPECT_EQ(row.at("found"), row.at("devices"));
    EXPECT_EQ(row.at("bound"), row.at("devices"));
    EXPECT_EQ(row.at("bitrate"), 125'000);
    EXPECT_GE(row.at("worst_s").get<double>(), row.at("bus_time_s").get<double>());
    EXPECT_GT(row.at("bits").get<unsigned>(), row.at("frames").get<unsigned>());
    EXPECT_TRUE(row.at("serials") == "consecutive" || row.at("serials") == "random");
  }
  std::istringstream lines(contents(csv));
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "method,devices,bitrate,serials,bus_time_s,worst_s,frames,bits,found,bound");
  unsigned count = 0;
  while (std::getline(lines, line)) ++count;
  EXPECT_EQ(count, 8U);
  EXPECT_TRUE(contents(svg).starts_with("<svg "));
}

TEST(CompareCommand, WrongWordsAreNamed) {
  for (const Words& words : {Words{"--methods", "telepathy"}, Words{"--devices", "0"}, Words{"--devices", "127"},
                             Words{"--bitrates", "5"}, Words{"--serials", "odd"}, Words{"--devices", "1,,5"}}) {
    Words all{"compare"};
    all.insert(all.end(), words.begin(), words.end());
    const auto run = berth(all);
    EXPECT_EQ(run.status, 2) << words[0] << " " << words[1];
    EXPECT_NE(run.err.find(words[0]), std::string::npos) << run.err;
  }
}

}  // namespace
}  // namespace berth::test
