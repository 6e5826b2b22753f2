// `berth analyze` as a person uses it.
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <string>

#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using nlohmann::json;

TEST(Analyze, ATableByPriorityAndWhatWasAssumed) {
  const Outcome run = berth({"analyze", example("by-eds.toml")});
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.out.find("field: 250000 bit/s, 19 messages, "), std::string::npos) << run.out;
  EXPECT_LT(run.out.find("081h  sensor 1"), run.out.find("181h  sensor 1")) << run.out;
  EXPECT_NE(run.err.find("5 TPDOs have neither inhibit time nor event timer"), std::string::npos) << run.err;
}

TEST(Analyze, AMessageThatIsTooLateIsExitOne) {
  const Outcome run = berth({"analyze", example("by-eds.toml"), "--event", "0.9 ms", "--json"});
  EXPECT_EQ(run.status, 1) << run.out;
  const json said = json::parse(run.out);
  EXPECT_FALSE(said.at("good"));
  const auto& messages = said.at("buses").at(0).at("messages");
  bool missed = false;
  for (const auto& m : messages) missed = missed || m.at("worst_ms").is_null() || m.at("kept") == false;
  EXPECT_TRUE(missed) << run.out;
  EXPECT_EQ(messages.at(0).at("id"), "000h");
}

// `berth link` has laid these PDOs, and says the same of a link across gateways, in the same words.
TEST(Analyze, LinksAcrossGatewaysAreThoseOfBerthLink) {
  const auto of = [](const std::string& verb) {
    const Outcome run = berth({verb, example("signals/machine.toml"), "--json"});
    EXPECT_EQ(run.status, 0) << run.out << run.err;
    return json::parse(run.out).at("crossings");
  };
  const json laid = of("link");
  const json analysed = of("analyze");
  ASSERT_EQ(laid.size(), 3U);
  ASSERT_EQ(analysed.size(), laid.size());
  for (std::size_t i = 0; i < laid.size(); ++i) {
    for (const char* const key : {"from", "source", "to", "target", "gateways", "worst_ms", "deadline_ms", "kept"})
      EXPECT_EQ(analysed[i].at(key), laid[i].at(key)) << key;
    EXPECT_TRUE(analysed[i].at("kept"));
  }
  EXPECT_EQ(laid[0].at("gateways"), (json{"reel gateway", "left gateway"}));
  const Outcome shown = berth({"analyze", example("signals/machine.toml")});
  EXPECT_NE(shown.out.find("through reel gateway, left gateway:"), std::string::npos) << shown.out;
  // A disturbed bus makes it later, and it says so.
  const Outcome late = berth({"analyze", example("signals/machine.toml"), "--errors", "1 ms", "--burst", "30"});
  EXPECT_EQ(late.status, 1) << late.out;
}

TEST(Analyze, ErrorsFifosAndTheUsualFormulaMakeItLater) {
  const auto worst = [](const Words& more) {
    Words words{"analyze", example("by-eds.toml"), "--event", "50 ms", "--json"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome run = berth(words);
    EXPECT_EQ(run.status, 0) << run.err;
    double sum = 0;
    const json said = json::parse(run.out);
    for (const auto& m : said.at("buses").at(0).at("messages")) sum += m.at("worst_ms").get<double>();
    return sum;
  };
  const double plain = worst({});
  EXPECT_GT(worst({"--errors", "100 ms"}), plain);
  EXPECT_GT(worst({"--errors", "100 ms", "--burst", "3"}), worst({"--errors", "100 ms"}));
  EXPECT_GT(worst({"--fifo", "all"}), plain);
  EXPECT_GT(worst({"--usual"}), plain);
}

TEST(Analyze, APlotHasARowForEachMessage) {
  const Folder folder;
  const std::string file = folder.file("bounds.svg");
  const Outcome run = berth({"analyze", example("by-eds.toml"), "--json", "--plot", file});
  EXPECT_EQ(run.status, 0) << run.err;
  const std::string svg = contents(file);
  std::size_t bars = 0;
  for (auto at = svg.find("<rect x="); at != std::string::npos; at = svg.find("<rect x=", at + 1)) ++bars;
  EXPECT_EQ(bars, json::parse(run.out).at("buses").at(0).at("messages").size());
  EXPECT_NE(svg.find("181h sensor 1, TPDO 1"), std::string::npos) << svg;
  EXPECT_EQ(berth({"analyze", example("by-eds.toml"), "--plot", folder.file("no/such/folder.svg")}).status, 3);
}

TEST(Analyze, WrongUse) {
  EXPECT_EQ(berth({"analyze", example("by-eds.toml"), "--bus", "no"}).status, 2);
  EXPECT_EQ(berth({"analyze", example("by-eds.toml"), "--fifo", "no"}).status, 2);
  EXPECT_EQ(berth({"analyze", example("by-eds.toml"), "--event", "0"}).status, 2);
  EXPECT_EQ(berth({"analyze", "/no/such.toml"}).status, 2);
}

}  // namespace
}  // namespace berth::test
