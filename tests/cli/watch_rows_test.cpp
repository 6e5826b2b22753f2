// The table of watched values by itself: whatever the terminal, each row fits, and the value is the last to go.
#include "apps/berth/watch_rows.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "apps/berth/trace_brief.hpp"
#include "berth/text/columns.hpp"

namespace berth::cli {
namespace {

using namespace std::chrono_literals;

std::deque<std::optional<double>> past(const std::vector<double>& values) { return {values.begin(), values.end()}; }

WatchRow row(const std::string& slot, const std::string& object, const std::string& value,
             const std::string& trouble = "") {
  WatchRow r{.slot = slot, .object = object, .value = value, .trouble = trouble};
  if (!value.empty()) r.read_at = rt::Time(8s);
  return r;
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(Sparkline, GoesFromTheLowestToTheHighest) {
  EXPECT_EQ(sparkline(past({0, 1, 2, 3, 4, 5, 6, 7}), 20, true), "▁▂▃▄▅▆▇█");
  EXPECT_EQ(sparkline(past({-70, 0, -40, -20}), 20, true), "▁█▄▆");
  EXPECT_EQ(sparkline(past({0, 1, 2, 3, 4, 5, 6, 7}), 20, false), ".:-=+*#@");
  EXPECT_EQ(sparkline(past({5, 5, 5}), 20, true), "▁▁▁") << "what stands still is flat";
  EXPECT_EQ(sparkline({}, 20, true), "");
}

TEST(Sparkline, TheNewestAreAtTheRightAndAGapIsAGap) {
  EXPECT_EQ(sparkline(past({100, 0, 1, 0}), 3, false), ".@.") << "what is older counts no more";
  std::deque<std::optional<double>> broken = past({0, 7});
  broken.insert(broken.begin() + 1, std::nullopt);
  EXPECT_EQ(sparkline(broken, 3, false), ". @");
}

TEST(WatchRows, ARowHasValueAgeAndPlot) {
  WatchRow r = row("unloader", "total", "1240 kg");
  r.past = past({0, 7});
  const auto lines = watch_lines({r}, 80, rt::Time(9500ms), true);
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[0].text, "slot      object     value     age  last values");
  EXPECT_EQ(lines[1].text, "unloader  total    1240 kg   1.5 s  ▁█");
  EXPECT_FALSE(lines[1].urgent);
}

// Slots of twenty letters: what is given up, in which order.
TEST(WatchRows, ColumnsAreGivenUpInTheStatedOrder) {
  WatchRow r = row("conveyor belt number", "Motor temperature", "123456.5 °C");
  r.past = past(std::vector<double>(40, 1));
  const auto at = [&](std::size_t width) { return watch_lines({r}, width, rt::Time(9s), false); };
  EXPECT_TRUE(has(at(80)[1].text, "conveyor belt number  Motor temperature  123456.5 °C   1.0 s  ....."));
  EXPECT_TRUE(has(at(72)[0].text, "last val"));
  EXPECT_FALSE(has(at(66)[1].text, "..")) << "less than 8 columns are no plot";
  EXPECT_TRUE(has(at(66)[1].text, "1.0 s"));
  EXPECT_FALSE(has(at(56)[1].text, "1.0 s")) << "then the age";
  EXPECT_TRUE(has(at(56)[1].text, "Motor temperature"));
  EXPECT_TRUE(has(at(48)[1].text, "conveyor belt number  Motor temper~  ")) << "then the object's name";
  EXPECT_EQ(at(31)[1].text, "conveyo~  Motor t~  123456.5 °C") << "last the slot's; the value stays whole";
}

TEST(WatchRows, EachLineFitsAndTroubleIsTold) {
  const std::vector<WatchRow> rows{row("left", "1001h:00", "0"), row("a very long name of a slot", "x", "12", "absent"),
                                   row("right", "7777h:00", "", "06020000h object does not exist")};
  for (std::size_t width = 1; width <= 150; ++width) {
    for (const auto& line : watch_lines(rows, width, rt::Time(9s), true)) {
      EXPECT_LE(text::columns(line.text), width) << line.text;
    }
  }
  const auto lines = watch_lines(rows, 80, rt::Time(9s), true);
  EXPECT_TRUE(has(lines[2].text, "12") && has(lines[2].text, "absent")) << "the last value stays: " << lines[2].text;
  EXPECT_TRUE(lines[2].urgent);
  EXPECT_TRUE(has(lines[3].text, "06020000h object does not exist")) << lines[3].text;
  EXPECT_TRUE(has(watch_lines(rows, 40, rt::Time(9s), true)[3].text, "0602")) << "in the value's place";
}

TEST(WatchRows, AnEscapeSequenceInAValueIsNone) {
  const auto lines = watch_lines({row("left", "name", "a\x1b[31mb\n")}, 80, rt::Time(9s), true);
  EXPECT_EQ(lines[1].text.find('\x1b'), std::string::npos);
  EXPECT_EQ(lines[1].text.find('\n'), std::string::npos);
}

// ---- a live trace ----

TEST(BriefTrace, BytesAreGivenUpBeforeWords) {
  const std::string words = "SDO read node 5 1018h:01 Identity object.Vendor-ID = 31 (0x0000001F)";
  const auto line = [&](std::size_t width) {
    return brief_line(12'345'678'901ns, "can0", "585#431810011F000000", words, {.width = width});
  };
  EXPECT_EQ(line(120), "   12.3457 585  " + words + "                    431810011F000000");
  EXPECT_EQ(line(120).size(), 120U);
  EXPECT_EQ(line(84), "   12.3457 585  " + words) << "no room for the bytes";
  EXPECT_EQ(line(30), "   12.3457 585  SDO read node~");
  EXPECT_EQ(brief_line(1s, "can0", "705#05", "heartbeat", {.width = 40, .bus = true}),
            "    1.0000 can0 705  heartbeat        05");
}

TEST(BriefTrace, NoLineIsWiderThanTheTerminal) {
  for (std::size_t width = 0; width < 100; ++width) {
    const auto line = brief_line(1s, "field", "705#05", "Überwachung: heartbeat of node 5\nforged", {.width = width});
    EXPECT_LE(text::columns(line), width);
    EXPECT_EQ(line.find('\n'), std::string::npos);
  }
}

}  // namespace
}  // namespace berth::cli
