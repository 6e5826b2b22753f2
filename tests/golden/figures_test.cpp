// S1.49, S1.50: paper 1's Figures 9 and 10 (screenshots that are lost), as the text of §IV tells them, against the
// whole machine's bus: examples/five-slaves, from blank. The lists are written by hand from that text, with the digits
// of s4 and s5 from S1.38. Berth leaves the letter in one thing: not `04 01` to all, RAND is answered in waiting
// (S1.31); tests/nodeid plays the literal one.
#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include "tests/golden/example.hpp"

using namespace berth;
using namespace berth::golden;
using namespace std::chrono_literals;

namespace {

struct Texts final : can::Tap {
  void frame(const can::Frame& frame, rt::Time, int) noexcept override { lines.push_back(can::to_string(frame)); }
  std::vector<std::string> lines;
};

using Lines = std::vector<std::string>;

Lines whole_trace() {
  Example example("five-slaves");
  if (!example.ready()) return {};
  const Hearing<Texts> trace(example.bus());
  example.start();
  if (!example.run_until([&] { return example.session().operational(); }, 5min)) return {};
  return trace.ear.lines;
}

// One request and the distinct answers to it, in the order of their identifiers.
struct Row {
  std::string request;
  Lines answers;
  bool operator==(const Row&) const = default;
};
std::ostream& operator<<(std::ostream& out, const Row& row) {
  out << row.request << " ->";
  for (const auto& answer : row.answers) out << ' ' << answer;
  return out;
}

std::vector<Row> discovery(const Lines& trace) {
  std::vector<Row> rows;
  for (const auto& line : trace) {
    if (line.starts_with("1F940000#80")) rows.push_back({line, {}});
    const bool answer = line.starts_with("1F5") || line.starts_with("1F90");
    if (answer && !rows.empty()) rows.back().answers.push_back(line);
  }
  for (auto& row : rows) {
    std::ranges::sort(row.answers);
    row.answers.erase(std::unique(row.answers.begin(), row.answers.end()), row.answers.end());
  }
  // The discovery begins with the phase 0 that a phase 1 follows (the devices boot, and Berth looks whether anybody is
  // there), and ends with one that nobody answers.
  const auto begin =
      std::ranges::find_if(rows, [](const Row& row) { return row.request.starts_with("1F940000#8001"); });
  if (begin == rows.begin() || begin == rows.end()) return {};
  rows.erase(rows.begin(), begin - 1);
  const auto last = std::ranges::find_if(rows, [](const Row& row) { return row.answers.empty(); });
  if (last != rows.end()) rows.erase(last + 1, rows.end());
  return rows;
}

const std::vector<Row> figure9{
    // "The master issues a IURS (phase 0), and all slave nodes response": s1 has chunk(0) = 0100, the others 0000.
    {"1F940000#80000000", {"1F500000#", "1F500400#"}},
    // "80 01 00 00": s1 drops; s2 to s5 up to phase 3, where s3 shows product 0005.
    {"1F940000#80010000", {"1F500004#"}},
    {"1F940000#80020001", {"1F500000#"}},
    {"1F940000#80030000", {"1F500004#", "1F500014#"}},
    // "80 04 00 01": s3 drops. Phases 5 to 7: s2, s4 and s5 are equal, until chunk(7) = 5, 6, 7.
    {"1F940000#80040001", {"1F500000#"}},
    {"1F940000#80050000", {"1F500000#"}},
    {"1F940000#80060000", {"1F500000#"}},
    {"1F940000#80070000", {"1F500014#", "1F500018#", "1F50001C#"}},
    // DIRS "80 08 00 05": s2 alone.
    {"1F940000#80080005", {"1F900014#"}},
    // The others "will participate in the next": s4,
    {"1F940000#80000000", {"1F500000#", "1F500400#"}},
    {"1F940000#80010000", {"1F500004#"}},
    {"1F940000#80020001", {"1F500000#"}},
    {"1F940000#80030000", {"1F500004#", "1F500014#"}},
    {"1F940000#80040001", {"1F500000#"}},
    {"1F940000#80050000", {"1F500000#"}},
    {"1F940000#80060000", {"1F500000#"}},
    {"1F940000#80070000", {"1F500018#", "1F50001C#"}},
    {"1F940000#80080006", {"1F900018#"}},
    // s5,
    {"1F940000#80000000", {"1F500000#", "1F500400#"}},
    {"1F940000#80010000", {"1F500004#"}},
    {"1F940000#80020001", {"1F500000#"}},
    {"1F940000#80030000", {"1F500004#", "1F500014#"}},
    {"1F940000#80040001", {"1F500000#"}},
    {"1F940000#80050000", {"1F500000#"}},
    {"1F940000#80060000", {"1F500000#"}},
    {"1F940000#80070000", {"1F50001C#"}},
    {"1F940000#80080007", {"1F90001C#"}},
    // s3,
    {"1F940000#80000000", {"1F500000#", "1F500400#"}},
    {"1F940000#80010000", {"1F500004#"}},
    {"1F940000#80020001", {"1F500000#"}},
    {"1F940000#80030000", {"1F500014#"}},
    {"1F940000#80040005", {"1F500000#"}},
    {"1F940000#80050000", {"1F500000#"}},
    {"1F940000#80060000", {"1F500000#"}},
    {"1F940000#80070000", {"1F500020#"}},
    {"1F940000#80080008", {"1F900020#"}},
    // s1.
    {"1F940000#80000000", {"1F500400#"}},
    {"1F940000#80010100", {"1F500004#"}},
    {"1F940000#80020001", {"1F500000#"}},
    {"1F940000#80030000", {"1F500004#"}},
    {"1F940000#80040001", {"1F500000#"}},
    {"1F940000#80050000", {"1F500000#"}},
    {"1F940000#80060000", {"1F500000#"}},
    {"1F940000#80070000", {"1F500028#"}},
    {"1F940000#8008000A", {"1F900028#"}},
    // Nobody is left.
    {"1F940000#80000000", {}},
};

TEST(WholeMachine, S1_49_DiscoveryIsFigure9) {
  const auto rows = discovery(whole_trace());
  ASSERT_EQ(rows.size(), figure9.size());
  for (std::size_t i = 0; i < figure9.size(); ++i) EXPECT_EQ(rows[i], figure9[i]) << "row " << i;
}

// S1.31: first all devices are told that they are unknown; nobody is put into configuration.
TEST(WholeMachine, S1_31_UnknownBeforeTheFirstRequestAndNobodyInConfiguration) {
  const auto trace = whole_trace();
  const auto first = [&](std::string_view start) {
    return std::ranges::find_if(trace, [&](const auto& line) { return line.starts_with(start); });
  };
  ASSERT_NE(first("1F940000#8000"), trace.end());
  EXPECT_LT(first("7E5#0400"), first("1F940000#8100"));
  EXPECT_LT(first("1F940000#8100"), first("1F940000#8000"));
  EXPECT_EQ(first("7E5#0401"), trace.end());
}

// What Figure 10 shows of LSS; inquiries (5Ah to 5Eh, among them the proof that one device alone is selected) and store
// (17h), which the paper leaves out, are Berth's own. `04 00` once where it is said twice in a row.
Lines configuration(const Lines& trace) {
  Lines lines;
  for (const auto& line : trace) {
    const bool lss = line.starts_with("7E5#") || line.starts_with("7E4#");
    const std::string service = line.substr(4, 2);
    const bool own = (service >= "5A" && service <= "5E") || service == "17";
    const bool again = !lines.empty() && line == "7E5#0400000000000000" && lines.back() == line;
    if (lss && !own && !again) lines.push_back(line);
  }
  return lines;
}

const Lines figure10{
    // All to operation mode; the four selective requests of s1, its response; node-ID 1, confirmed.
    "7E5#0400000000000000",
    "7E5#4001000001000000",
    "7E5#4101000000000000",
    "7E5#4200000000000000",
    "7E5#430A000000000000",
    "7E4#4400000000000000",
    "7E5#1101000000000000",
    "7E4#1100000000000000",
    // s2
    "7E5#0400000000000000",
    "7E5#4001000000000000",
    "7E5#4101000000000000",
    "7E5#4200000000000000",
    "7E5#4305000000000000",
    "7E4#4400000000000000",
    "7E5#1102000000000000",
    "7E4#1100000000000000",
    // s3
    "7E5#0400000000000000",
    "7E5#4001000000000000",
    "7E5#4105000000000000",
    "7E5#4200000000000000",
    "7E5#4308000000000000",
    "7E4#4400000000000000",
    "7E5#1103000000000000",
    "7E4#1100000000000000",
    // s4
    "7E5#0400000000000000",
    "7E5#4001000000000000",
    "7E5#4101000000000000",
    "7E5#4200000000000000",
    "7E5#4306000000000000",
    "7E4#4400000000000000",
    "7E5#1104000000000000",
    "7E4#1100000000000000",
    // s5
    "7E5#0400000000000000",
    "7E5#4001000000000000",
    "7E5#4101000000000000",
    "7E5#4200000000000000",
    "7E5#4307000000000000",
    "7E4#4400000000000000",
    "7E5#1105000000000000",
    "7E4#1100000000000000",
    // back to operation, where each takes its node-ID
    "7E5#0400000000000000",
};

TEST(WholeMachine, S1_50_ConfigurationIsFigure10) { EXPECT_EQ(configuration(whole_trace()), figure10); }

}  // namespace
