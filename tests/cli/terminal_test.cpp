// `berth up` on terminals of every kind and size, with the screen compared.
#include "terminal.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <algorithm>
#include <array>
#include <sstream>
#include <string>

#include <nlohmann/json.hpp>

#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

class OnScreen : public ::testing::Test {
 protected:
  void write_machine(const std::string& text) { machine = folder.write("machine.toml", text); }
  void start(const OnTerminal& terminal) {
    size = terminal;
    up = std::make_unique<Background>(Words{"up", machine, "--sim", plant, "--control", folder.file("s")}, terminal);
  }
  [[nodiscard]] Terminal screen() const {
    Terminal shown(size.columns, size.rows);
    shown.feed(up->said());
    return shown;
  }
  /// Waits until this holds for the screen: a drawing can arrive in parts, so what is compared is waited for whole.
  template <typename Holds>
  [[nodiscard]] bool becomes(Holds holds) {
    return up->says([&](const std::string&) { return holds(screen()); });
  }
  /// Waits until the screen shows it.
  [[nodiscard]] bool shows(const std::string& text) {
    return becomes([&](const Terminal& now) { return now.text().find(text) != std::string::npos; });
  }

  Folder folder;
  std::string machine = folder.write("machine.toml", small_machine);
  std::string plant = folder.write("plant.toml", small_plant);
  OnTerminal size;
  std::unique_ptr<Background> up;
};

std::string that_asks() {
  std::string text = small_machine;
  const std::string ascending = "\"ascending\"";
  for (auto at = text.find(ascending); at != std::string::npos; at = text.find(ascending)) {
    text.replace(at, ascending.size(), "\"ask\"");
  }
  return text;
}

TEST_F(OnScreen, S5_22_TheTableStandsBelowWhatHappened) {
  start({80, 24});
  const auto last_row_is_drawn = [](const Terminal& now) {
    return now.row(22).starts_with("  9  drive  operational  ");
  };
  ASSERT_TRUE(becomes(last_row_is_drawn)) << screen().text();
  const Terminal now = screen();
  EXPECT_TRUE(now.row(17).starts_with("cli test  ")) << now.text();
  EXPECT_EQ(now.row(18), "line: 3 slots, 3 operational");
  EXPECT_EQ(now.row(19), " id  slot   state        NMT       since  type               serial");
  EXPECT_TRUE(now.row(20).starts_with("  2  left   operational  ")) << now.text();
  EXPECT_TRUE(now.row(20).ends_with("s  00000001-00000001  00000020")) << now.text();
  EXPECT_TRUE(now.row(21).starts_with("  3  right  operational  ")) << now.text();
  EXPECT_EQ(now.row(23), "") << "the cursor's";
}

// Whatever goes to standard error meanwhile: the table was drawn over it, and was drawn twice behind it.
TEST_F(OnScreen, WhatAScriptPrintsStandsAboveTheTable) {
  static_cast<void>(folder.write("talk.lua",
                                 "local n = 0\n"
                                 "local function talk()\n"
                                 "  n = n + 1\n"
                                 "  print('press', n)\n"
                                 "  device.after(300, talk)\n"
                                 "end\n"
                                 "device.on_state(function() if n == 0 then talk() end end)\n"));
  std::string with = small_plant;
  with.insert(with.find("serial = 0x21"), "script = \"talk.lua\"\n");
  plant = folder.write("plant.toml", with);
  start({.columns = 80, .rows = 24, .errors = true});
  ASSERT_TRUE(shows("3 operational")) << screen().text();
  ASSERT_TRUE(shows("press 7")) << screen().text();
  const Terminal now = screen();
  std::string all;
  for (const auto& row : now.scrolled_out()) all += row + "\n";
  all += now.text();
  for (const char* const said : {"press 1\n", "press 3\n", "press 6\n"})
    EXPECT_NE(all.find(said), std::string::npos) << said << all;
  EXPECT_EQ(now.text().find(" id  slot"), now.text().rfind(" id  slot")) << "one table: " << now.text();
}

// Nothing is drawn then, and what was said must not be lost with the table.
TEST_F(OnScreen, ARunThatCannotBeginSaysWhy) {
  size = {.columns = 80, .rows = 24, .errors = true};
  for (const Words& words : {Words{"--control", "/nonexistent/x.sock"}, Words{"--studio=127.0.0.1:99999"}}) {
    Words all{"up", machine, "--sim", plant};
    all.insert(all.end(), words.begin(), words.end());
    Background failing(all, size);
    const Outcome ended = failing.end();
    EXPECT_NE(ended.status, 0) << words.front();
    EXPECT_NE(ended.out.find("berth: "), std::string::npos) << words.front() << ended.out;
  }
}

// "…as nod|e-ID 4": a terminal breaks anywhere, Berth at a space.
TEST_F(OnScreen, ALineThatIsTooWideIsBrokenAtASpace) {
  start({50, 30});
  ASSERT_TRUE(shows("3 operational")) << screen().text();
  const Terminal now = screen();
  std::vector<std::string> rows = now.scrolled_out();
  for (std::size_t i = 0; i < 30; ++i) rows.push_back(now.row(i));
  const auto bound = std::ranges::find_if(rows, [](const auto& row) { return row.find("left: bound to") != row.npos; });
  ASSERT_NE(bound, rows.end()) << now.text();
  EXPECT_EQ(bound[1].substr(0, 5), "    0") << "the address is not parted: " << bound[0] << "|" << bound[1];
  EXPECT_NE(bound[1].find("as node-ID"), std::string::npos) << bound[1];
}

TEST_F(OnScreen, AWorldThatStandsIsToldInTheHeading) {
  start({80, 24});
  ASSERT_TRUE(shows("3 operational"));
  ASSERT_EQ(berth({"world", "pause", "--control", folder.file("s")}).status, 0);
  EXPECT_TRUE(shows("paused: `berth world run`")) << screen().text();
  ASSERT_EQ(berth({"world", "run", "--control", folder.file("s")}).status, 0);
  EXPECT_TRUE(becomes([](const Terminal& now) { return now.text().find("paused") == std::string::npos; }))
      << screen().text();
}

TEST_F(OnScreen, AQuestionMarkHelpsAndQEnds) {
  start({80, 24});
  ASSERT_TRUE(shows("3 operational"));
  up->type("?");
  EXPECT_TRUE(shows("q or Ctrl-C ends the run")) << screen().text();
  up->type("q");
  EXPECT_EQ(up->end().status, 0);
}

// The events have pushed it out of the terminal long before.
TEST_F(OnScreen, AQuestionMarkTellsTheAddressOfStudioAgain) {
  size = {80, 24};
  up = std::make_unique<Background>(
      Words{"up", machine, "--sim", plant, "--control", folder.file("s"), "--studio=127.0.0.1:0"}, size);
  ASSERT_TRUE(shows("3 operational"));
  const auto addresses = [](const std::string& said) {
    std::size_t count = 0;
    for (auto at = said.find("Berth Studio at http"); at != std::string::npos;
         at = said.find("Berth Studio at http", at + 1))
      ++count;
    return count;
  };
  const std::size_t before = addresses(up->said());
  up->type("?");
  EXPECT_TRUE(up->says([&](const std::string& said) { return addresses(said) > before; })) << screen().text();
}

// A narrow terminal has its lines broken at spaces.
std::string in_one_line(const std::string& said) {
  std::istringstream words(said);
  std::string line;
  for (std::string word; words >> word;) line += (line.empty() ? "" : " ") + word;
  return line;
}

TEST_F(OnScreen, EverySizeHasATableThatFits) {
  for (const auto& [columns, rows] : {std::pair<unsigned short, unsigned short>{1, 1}, {50, 8}, {200, 50}, {20, 2}}) {
    start({columns, rows});
    const auto all = [](const std::string& said) {
      const std::string line = in_one_line(said);
      return std::ranges::all_of(std::array{"left: operational", "right: operational", "drive: operational"},
                                 [&](const char* event) { return line.find(event) != std::string::npos; });
    };
    ASSERT_TRUE(up->says(all)) << columns << "x" << rows;
    up->signal(SIGINT);
    EXPECT_EQ(up->end().status, 0);
    EXPECT_NO_THROW(screen());
    if (columns < 50) continue;
    const auto text = screen().text();
    EXPECT_NE(text.find("2  left"), std::string::npos) << "the whole table stays when it ends\n" << text;
    EXPECT_NE(text.find("9  drive"), std::string::npos) << text;
  }
}

// A second of an idle machine writes its time and no table.
TEST_F(OnScreen, ARedrawWritesWhatChanged) {
  start({100, 40});
  ASSERT_TRUE(shows("  9  drive  operational  ")) << "the last of the table's lines";
  const auto headlines = [](const std::string& text) {
    std::size_t count = 0;
    for (auto at = text.find("on the bus"); at != std::string::npos; at = text.find("on the bus", at + 1)) ++count;
    return count;
  };
  const std::size_t before = up->said().size();
  ASSERT_TRUE(up->says([&](const std::string& said) { return headlines(said.substr(before)) >= 3; }));
  const std::string later = up->said().substr(before);
  EXPECT_EQ(later.find("serial"), std::string::npos) << later;
  EXPECT_LT(later.size() / headlines(later), 120U) << later;
}

TEST_F(OnScreen, WhatIsTypedIsNeverErased) {
  write_machine(that_asks());
  start({100, 40});
  ASSERT_TRUE(shows("type a slot (left, right)")) << screen().text();
  up->type("lefx\x7f");
  ASSERT_TRUE(shows("> lef_")) << screen().text();
  const std::size_t so_far = up->said().size();
  ASSERT_TRUE(up->says([&](const std::string& said) {
    return said.find("on the bus", so_far) != std::string::npos && said.size() > so_far + 40;
  }));
  EXPECT_TRUE(shows("> lef_")) << screen().text();
  up->type("t 2\n");
  EXPECT_TRUE(shows("3 slots, 3 operational")) << screen().text();
  EXPECT_EQ(screen().text().find("> lef"), std::string::npos) << screen().text();
}

TEST_F(OnScreen, AnAnswerNamesItsSlotByNodeIdToo) {
  write_machine(that_asks());
  start({100, 40});
  ASSERT_TRUE(shows("type a slot (left, right)")) << screen().text();
  up->type("9 2\n");  // a slot, and not one of those
  EXPECT_TRUE(shows("\"9\" is not one of the slots (left, right)")) << screen().text();
  up->type("2 2\n");
  EXPECT_TRUE(shows("3 slots, 3 operational")) << screen().text();
}

TEST_F(OnScreen, KeysMoveATableThatDoesNotFit) {
  start({60, 8});
  ASSERT_TRUE(shows("3 operational")) << screen().text();
  ASSERT_TRUE(shows("lines 1 to 2 of 4")) << screen().text();
  up->type("\x1b[F");
  EXPECT_TRUE(shows("9  drive")) << screen().text();
  up->type("\x1b[5~");
  EXPECT_TRUE(shows("2  left")) << screen().text();
  up->type("\x1b[1;5Z\x1b");  // unknown keys do nothing
  up->type("\x1b[H");
  EXPECT_TRUE(shows(" id  slot")) << screen().text();
}

TEST_F(OnScreen, ADumbTerminalGetsPlainLines) {
  for (const char* type : {"dumb", ""}) {
    start({80, 24, type});
    ASSERT_TRUE(up->says("drive: operational")) << up->said();
    up->signal(SIGINT);
    EXPECT_EQ(up->end().status, 0);
    EXPECT_EQ(up->said().find('\x1b'), std::string::npos) << up->said();
    EXPECT_NE(up->said().find("  9  drive  operational"), std::string::npos) << "the table at the end";
  }
}

TEST_F(OnScreen, ColoursUnlessTheyAreNotWanted) {
  write_machine(that_asks());
  for (const bool wanted : {true, false}) {
    start({80, 24, "xterm", wanted});
    ASSERT_TRUE(shows("type a slot (left, right)")) << screen().text();
    EXPECT_EQ(up->said().find("\x1b[33m") != std::string::npos, wanted);
  }
}

TEST_F(OnScreen, ATerminalThatIsResizedIsDrawnAnew) {
  start({100, 40});
  ASSERT_TRUE(shows("3 slots, 3 operational"));
  up->resize(50, 8);
  const std::size_t so_far = up->said().size();
  const auto whole_line = [&](const std::string& said) {
    return said.find('\n', said.find("lines 1 to", so_far)) != std::string::npos;
  };
  ASSERT_TRUE(up->says(whole_line));
  const auto line = up->said().substr(up->said().find("lines 1 to", so_far));
  EXPECT_LE(line.find('\n'), 50U) << line;
}

}  // namespace
}  // namespace berth::test
