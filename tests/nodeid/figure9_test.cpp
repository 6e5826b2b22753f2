// S1.49: paper 1, Figure 9 (the screenshot is lost), as the text of §IV tells it: one master, five slaves, RAND from
// blank. The frame lists below are written by hand from that text (digits of s4 and s5 from S1.38), never generated.
#include <gtest/gtest.h>
#include <algorithm>
#include <string>
#include <vector>

#include "tests/harness/rand_world.hpp"

namespace berth::nodeid::test {
namespace {

using enum Identification;

// The order in which the slaves stand in every column: s1 s2 s3 s4 s5.
constexpr LssAddress five[] = {{0x0100'0001, 0x0000'0001, 0, 0x0A},
                               {0x0000'0001, 0x0000'0001, 0, 0x05},
                               {0x0000'0001, 0x0000'0005, 0, 0x08},
                               {0x0000'0001, 0x0000'0001, 0, 0x06},
                               {0x0000'0001, 0x0000'0001, 0, 0x07}};

struct Row {
  std::string request;
  std::vector<std::string> answers;     // distinct ones, in order of identifier
  std::array<Identification, 5> after;  // states of s1 to s5
};

const std::vector<Row> figure{
    // "The master issues a IURS (phase 0), and all slave nodes response a IUS frame."
    {"1F940000#80000000", {"1F500000#", "1F500400#"}, {selected, selected, selected, selected, selected}},
    // Phase 1, "80 01 00 00": s1 switches to unknown, the others answer with chunk(1) = 0001.
    {"1F940000#80010000", {"1F500004#"}, {unknown, selected, selected, selected, selected}},
    // Phases 2 and 3: s2 to s5 are equal up to chunk(2) = 0000; chunk(3) is 0001, and 0005 for s3.
    {"1F940000#80020001", {"1F500000#"}, {unknown, selected, selected, selected, selected}},
    {"1F940000#80030000", {"1F500004#", "1F500014#"}, {unknown, selected, selected, selected, selected}},
    // Phase 4, printed (08 04 00 01), meant 80 04 00 01: s3 drops out.
    {"1F940000#80040001", {"1F500000#"}, {unknown, selected, unknown, selected, selected}},
    // Phases 5, 6 and 7: s2, s4 and s5 cannot be told apart; in phase 7 they answer with chunk(7) = 5, 6, 7.
    {"1F940000#80050000", {"1F500000#"}, {unknown, selected, unknown, selected, selected}},
    {"1F940000#80060000", {"1F500000#"}, {unknown, selected, unknown, selected, selected}},
    {"1F940000#80070000", {"1F500014#", "1F500018#", "1F50001C#"}, {unknown, selected, unknown, selected, selected}},
    // DIRS "80 08 00 05": s2 is identified, s4 and s5 switch to unknown.
    {"1F940000#80080005", {"1F900014#"}, {unknown, identified, unknown, unknown, unknown}},
    // "The slave nodes s1, s3, s4 and s5 will participate in the next slave node discovery process": s4 ...
    {"1F940000#80000000", {"1F500000#", "1F500400#"}, {selected, identified, selected, selected, selected}},
    {"1F940000#80010000", {"1F500004#"}, {unknown, identified, selected, selected, selected}},
    {"1F940000#80020001", {"1F500000#"}, {unknown, identified, selected, selected, selected}},
    {"1F940000#80030000", {"1F500004#", "1F500014#"}, {unknown, identified, selected, selected, selected}},
    {"1F940000#80040001", {"1F500000#"}, {unknown, identified, unknown, selected, selected}},
    {"1F940000#80050000", {"1F500000#"}, {unknown, identified, unknown, selected, selected}},
    {"1F940000#80060000", {"1F500000#"}, {unknown, identified, unknown, selected, selected}},
    {"1F940000#80070000", {"1F500018#", "1F50001C#"}, {unknown, identified, unknown, selected, selected}},
    {"1F940000#80080006", {"1F900018#"}, {unknown, identified, unknown, identified, unknown}},
    // ... s5 ...
    {"1F940000#80000000", {"1F500000#", "1F500400#"}, {selected, identified, selected, identified, selected}},
    {"1F940000#80010000", {"1F500004#"}, {unknown, identified, selected, identified, selected}},
    {"1F940000#80020001", {"1F500000#"}, {unknown, identified, selected, identified, selected}},
    {"1F940000#80030000", {"1F500004#", "1F500014#"}, {unknown, identified, selected, identified, selected}},
    {"1F940000#80040001", {"1F500000#"}, {unknown, identified, unknown, identified, selected}},
    {"1F940000#80050000", {"1F500000#"}, {unknown, identified, unknown, identified, selected}},
    {"1F940000#80060000", {"1F500000#"}, {unknown, identified, unknown, identified, selected}},
    {"1F940000#80070000", {"1F50001C#"}, {unknown, identified, unknown, identified, selected}},
    {"1F940000#80080007", {"1F90001C#"}, {unknown, identified, unknown, identified, identified}},
    // ... s3 ...
    {"1F940000#80000000", {"1F500000#", "1F500400#"}, {selected, identified, selected, identified, identified}},
    {"1F940000#80010000", {"1F500004#"}, {unknown, identified, selected, identified, identified}},
    {"1F940000#80020001", {"1F500000#"}, {unknown, identified, selected, identified, identified}},
    {"1F940000#80030000", {"1F500014#"}, {unknown, identified, selected, identified, identified}},
    {"1F940000#80040005", {"1F500000#"}, {unknown, identified, selected, identified, identified}},
    {"1F940000#80050000", {"1F500000#"}, {unknown, identified, selected, identified, identified}},
    {"1F940000#80060000", {"1F500000#"}, {unknown, identified, selected, identified, identified}},
    {"1F940000#80070000", {"1F500020#"}, {unknown, identified, selected, identified, identified}},
    {"1F940000#80080008", {"1F900020#"}, {unknown, identified, identified, identified, identified}},
    // ... and s1.
    {"1F940000#80000000", {"1F500400#"}, {selected, identified, identified, identified, identified}},
    {"1F940000#80010100", {"1F500004#"}, {selected, identified, identified, identified, identified}},
    {"1F940000#80020001", {"1F500000#"}, {selected, identified, identified, identified, identified}},
    {"1F940000#80030000", {"1F500004#"}, {selected, identified, identified, identified, identified}},
    {"1F940000#80040001", {"1F500000#"}, {selected, identified, identified, identified, identified}},
    {"1F940000#80050000", {"1F500000#"}, {selected, identified, identified, identified, identified}},
    {"1F940000#80060000", {"1F500000#"}, {selected, identified, identified, identified, identified}},
    {"1F940000#80070000", {"1F500028#"}, {selected, identified, identified, identified, identified}},
    {"1F940000#8008000A", {"1F900028#"}, {identified, identified, identified, identified, identified}},
    // Nobody is left.
    {"1F940000#80000000", {}, {identified, identified, identified, identified, identified}},
};

/// Plays the discovery and compares it row by row. `latency` of slave i.
void play(const std::function<rt::Duration(unsigned)>& latency, bool literal) {
  World w(50'000);
  for (unsigned i = 0; i < 5; ++i) {
    w.nodes.push_back(std::make_unique<Node>(w.world, w.bus, RandSlaveOptions{.address = five[i], .literal = literal},
                                             [latency, i] { return latency(i); }));
    w.nodes.back()->in_lss_configuration = literal;  // the paper's `04 01` to all
  }
  w.options.window = DiscoveryOptions::Window::fixed;  // the paper's 40 ms
  w.options.t_proc = milliseconds(1);
  Record record(w.bus);
  Watch watch;
  std::vector<Row> seen;
  watch.on_phase = [&] {
    Row row{.request = record.text.front(), .answers = {record.text.begin() + 1, record.text.end()}, .after = {}};
    std::ranges::sort(row.answers);
    row.answers.erase(std::unique(row.answers.begin(), row.answers.end()), row.answers.end());
    for (unsigned i = 0; i < 5; ++i) row.after[i] = w.nodes[i]->slave.state();
    record.text.clear();
    seen.push_back(row);
  };
  const auto report = w.discover(&watch);
  ASSERT_TRUE(report);
  ASSERT_EQ(seen.size(), figure.size());
  for (std::size_t i = 0; i < figure.size(); ++i) {
    EXPECT_EQ(seen[i].request, figure[i].request) << "row " << i;
    EXPECT_EQ(seen[i].answers, figure[i].answers) << "row " << i;
    EXPECT_EQ(seen[i].after, figure[i].after) << "row " << i;
  }
  EXPECT_EQ(addresses(*report), (std::vector{five[1], five[3], five[4], five[2], five[0]}));
}

TEST(Figure9, S1_49_FiveSlavesAnsweringTogether) {
  play([](unsigned) { return milliseconds(4); }, false);
}
TEST(Figure9, S1_49_FiveSlavesAnsweringOneAfterTheOther) {
  play([](unsigned i) { return milliseconds(1 + 3 * i); }, false);
}
TEST(Figure9, S1_49_LiteralSlavesInConfiguration) {
  play([](unsigned) { return milliseconds(4); }, true);
}

}  // namespace
}  // namespace berth::nodeid::test
