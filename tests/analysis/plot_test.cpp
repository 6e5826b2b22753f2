// The picture of `berth analyze --plot`.
#include <gtest/gtest.h>

#include <string>

#include "berth/analysis/plot.hpp"

namespace berth::analysis {
namespace {

using namespace std::chrono_literals;

std::size_t count(const std::string& svg, const std::string& what) {
  std::size_t n = 0;
  for (auto at = svg.find(what); at != std::string::npos; at = svg.find(what, at + 1)) ++n;
  return n;
}

// The x of what stands behind `before`.
double number(const std::string& svg, const std::string& before) {
  const auto at = svg.find(before);
  return at == std::string::npos ? -1 : std::stod(svg.substr(at + before.size()));
}

Line line() {
  Line line{.bit_rate = 125'000};
  line.senders = {{"left <& drive>"}};
  line.messages = {{.name = "kept", .sender = 0, .key = 0x181, .period = 100ms, .deadline = 100ms},
                   {.name = "late", .sender = 0, .key = 0x281, .period = 100ms, .deadline = 1ms},
                   {.name = "free", .sender = 0, .key = 0x381, .period = 100ms}};
  return line;
}

TEST(AnalysisPlot, ABarForEachMessageAndAStrokeForEachDeadline) {
  const Line of = line();
  const Result result = analyze(of);
  const std::string svg = plot(std::vector<PlottedBus>{{"field", &of, &result}, {"second", &of, &result}});
  EXPECT_TRUE(svg.starts_with("<svg ")) << svg.substr(0, 80);
  EXPECT_TRUE(svg.ends_with("</svg>\n"));
  EXPECT_EQ(count(svg, "<rect x="), 6U);
  EXPECT_EQ(count(svg, "stroke-width=\"2\""), 4U);
  EXPECT_EQ(count(svg, "fill=\"#D55E00\""), 2U) << "one is late on each bus";
  EXPECT_EQ(count(svg, "left &lt;&amp; drive&gt;"), 6U);
  EXPECT_EQ(count(svg, "<text"), count(svg, "</text>"));
  EXPECT_EQ(count(svg, "nan"), 0U);
}

TEST(AnalysisPlot, TimesAreOnALogarithmicScale) {
  const Line of = line();
  Result result = analyze(of);
  result.responses.resize(1);
  result.responses.front().frame = 1ms;
  result.responses.front().arrival = 10ms;
  const std::string svg = plot(std::vector<PlottedBus>{{"field", &of, &result}});
  // Decades 1, 10 and 100 ms stand 280 apart.
  EXPECT_DOUBLE_EQ(number(svg, "<rect x=\""), 330);
  EXPECT_EQ(count(svg, "width=\"280.0\" height=\"8.0\" fill=\"#0072B2\""), 1U) << svg;
}

TEST(AnalysisPlot, OneWithoutABoundReachesTheEdge) {
  Line of = line();
  for (auto& m : of.messages) m.period = m.deadline = 1ms;
  const Result result = analyze(of);
  ASSERT_FALSE(result.responses.back().worst);
  const std::string svg = plot(std::vector<PlottedBus>{{"field", &of, &result}});
  EXPECT_GE(count(svg, "fill=\"#D55E00\""), 1U);
  EXPECT_EQ(count(svg, "nan") + count(svg, "inf"), 0U);
  EXPECT_TRUE(plot({}).ends_with("</svg>\n"));
}

}  // namespace
}  // namespace berth::analysis
