// `berth analyze` as a person uses it.
#include <gtest/gtest.h>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using nlohmann::json;

TEST(Analyze, ATableByPriorityAndWhatWasAssumed) {
  const Outcome run = berth({"analyze", example("by-eds.toml"), "--event", "10 ms"});
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_NE(run.out.find("field: 250000 bit/s, 19 messages, "), std::string::npos) << run.out;
  EXPECT_LT(run.out.find("081h  sensor 1"), run.out.find("181h  sensor 1")) << run.out;
  EXPECT_NE(run.err.find("5 TPDOs at a change without an inhibit time: one every 10 ms is assumed (--event): sensor 1/"
                         "TPDO 1"),
            std::string::npos)
      << run.err;
  EXPECT_NE(run.err.find("it is not known in which order 5 devices send their frames"), std::string::npos) << run.err;
}

// The inhibit time of these TPDOs is 0: an input that changes all the time takes the whole bus.
TEST(Analyze, WithoutALeastIntervalThereIsNoBound) {
  const Outcome run = berth({"analyze", example("by-eds.toml"), "--json"});
  EXPECT_EQ(run.status, 1) << run.out;
  const json said = json::parse(run.out);
  for (const auto& m : said.at("buses").at(0).at("messages")) {
    const bool tpdo = m.at("message").get<std::string>().starts_with("TPDO");
    EXPECT_EQ(m.at("period_ms").is_null(), tpdo) << m;
    EXPECT_TRUE(m.at("worst_ms").is_null() || !(tpdo || m.at("message") == "heartbeat")) << m;
  }
  const Folder folder;
  const std::string file = folder.write("kept.toml", R"(
[machine]
name = "kept"
[bus.field]
port = "sim"
bitrate = 250_000
[[slot]]
bus = "field"
id = 1
name = "sensor"
eds = "eds/sensor.eds"
inhibit = "20 ms"
queue = "in-order"
[[slot]]
bus = "field"
id = 20
name = "io"
eds = "eds/io.eds"
inhibit = "20 ms"
queue = "priority"
)");
  std::filesystem::copy(example("eds"), std::filesystem::path(file).parent_path() / "eds");
  const Outcome kept = berth({"analyze", file});
  EXPECT_EQ(kept.status, 0) << kept.out << kept.err;
  EXPECT_EQ(kept.err.find("it is not known in which order"), std::string::npos) << kept.err;
  EXPECT_NE(kept.err.find("TPDOs without an inhibit time are as far apart as the machine file says: sensor/TPDO 1"),
            std::string::npos)
      << kept.err;
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
  EXPECT_EQ(messages.at(0).at("id"), "0x000");
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
  EXPECT_LE(worst({"--fifo", "all"}), plain) << "what is not known is the worse of both already";
  EXPECT_GT(worst({"--usual"}), plain);
}

TEST(Analyze, APlotHasARowForEachMessage) {
  const Folder folder;
  const std::string file = folder.file("bounds.svg");
  const Outcome run = berth({"analyze", example("by-eds.toml"), "--event", "10 ms", "--json", "--plot", file});
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
