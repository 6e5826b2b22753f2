// The commands in README.md and in the pages of docs/ that show no screen: each is typed, and prints what
// page_commands.toml says. Pages whose blocks are of the language `console` are followed by tutorials_test.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <memory>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "../mqtt/broker.hpp"
#include "../pages.hpp"
#include "../paths.hpp"
#include "berth/text/toml.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

namespace fs = std::filesystem;

const std::string table_file = "tests/cli/page_commands.toml";

struct Typed {
  std::size_t line = 0;  ///< of the page
  std::string command;   ///< without its comment and its "&"
};

/// A line of a block as a shell takes it, or nothing: it is no command of Berth's.
std::string command_of(std::string line) {
  static const std::regex begins(R"(^ *(\$ )?((build/release/)?berth |\./run |build/release/examples/))");
  static const std::regex comment(R"((  +| )#( .*)?$)");
  if (!std::regex_search(line, begins)) return {};
  line = std::regex_replace(line, comment, "", std::regex_constants::format_first_only);
  line.erase(0, line.find_first_not_of(" $"));
  line.erase(line.find_last_not_of(" &") + 1);
  return line;
}

/// Those in blocks that are indented, and in fenced ones that are not `console`.
std::vector<Typed> commands_of(const std::string& page) {
  std::vector<Typed> all;
  std::istringstream in(page);
  std::string fence;
  std::string whole;
  std::size_t number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    const bool mark = line.find("```") == line.find_first_not_of(' ') && line.find("```") != std::string::npos;
    if (mark) {
      fence = fence.empty() ? line : "";
      continue;
    }
    const bool in_block = fence.empty() ? line.starts_with("    ") : fence.find("console") == std::string::npos;
    if (!in_block) continue;
    whole += whole.empty() ? line : line.substr(line.find_first_not_of(' '));
    if (whole.ends_with("\\")) {
      whole.pop_back();
      continue;
    }
    if (const auto command = command_of(whole); !command.empty()) all.push_back({number, command});
    whole.clear();
  }
  return all;
}

std::vector<std::string> pages() {
  std::vector<std::string> all{"README.md"};
  for (const auto& entry : fs::recursive_directory_iterator(source_dir() + "/docs")) {
    if (entry.path().extension() == ".md") all.push_back(fs::relative(entry.path(), source_dir()).string());
  }
  std::ranges::sort(all);
  return all;
}

/// One command of the table.
struct Row {
  std::string shown;  ///< in the page; empty: the test's own
  std::string typed;
  std::string says;
  int status = 0;
  bool stays = false;
  int ends = 0;
  std::string file, holds;
  bool is_typed = true;
};

struct Page {
  std::string name;
  std::string make;
  std::vector<std::pair<std::string, std::string>> instead;
  bool broker = false;
  std::vector<Row> rows;
};

void replace_all(std::string& in, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = in.find(from, at)) != std::string::npos; at += to.size())
    in.replace(at, from.size(), to);
}

Row row_of(text::Table from) {
  Row row;
  row.shown = from.string("do").value_or("");
  row.typed = from.string("as").value_or(row.shown);
  row.says = from.string("says").value_or("");
  row.status = static_cast<int>(from.integer("status", {0, 255}).value_or(0));
  row.stays = from.boolean("stays").value_or(false);
  row.ends = static_cast<int>(from.integer("ends", {0, 9}).value_or(0));
  row.file = from.string("file").value_or("");
  row.holds = from.string("holds").value_or("");
  row.is_typed = !from.string("not_typed");
  from.finish();
  return row;
}

Page page_of(text::Table from) {
  Page page;
  page.name = from.string("page").value_or("");
  page.make = from.string("make").value_or("");
  page.broker = from.boolean("broker").value_or(false);
  if (const auto* const pairs = from.get("instead")) {
    for (const auto& pair : pairs->items) page.instead.emplace_back(pair.items.at(0).string, pair.items.at(1).string);
  }
  for (const auto& item : from.strings_or_tables("commands")) page.rows.push_back(row_of(item.table.value()));
  from.finish();
  return page;
}

std::vector<Page> table() {
  Findings findings;
  const auto root = text::parse_toml(contents(source_dir() + "/" + table_file), table_file, findings);
  std::vector<Page> all;
  if (root) {
    text::Table top(*root, "", table_file, findings);
    for (const auto& page : top.tables("page")) all.push_back(page_of(page));
    top.finish();
  }
  for (const auto& finding : findings) ADD_FAILURE() << to_string(finding);
  return all;
}

/// Types the commands of one page, in a folder of their own.
class Reader {
 public:
  explicit Reader(const Page& page) : page_(page), port_(std::to_string(mqtt::test::free_port())) {
    fs::copy(source_dir() + "/examples", shell_.file("examples"), fs::copy_options::recursive);
    fs::create_directories(shell_.file("build/release"));
    fs::create_symlink(binary(), shell_.file("build/release/berth"));
    fs::create_symlink(fs::path(binary()).parent_path() / "examples", shell_.file("build/release/examples"));
    if (page.broker) broker_ = std::make_unique<mqtt::test::Broker>();
  }

  void read() {
    if (!page_.make.empty()) {
      const auto ran = shell_.type(page_.make);
      ASSERT_EQ(ran.status, 0) << page_.name << ": make\n" << ran.screen;
    }
    for (const auto& row : page_.rows) {
      if (row.is_typed) one(row);
    }
  }

 private:
  [[nodiscard]] std::string typed(const Row& row) const {
    std::string command = row.typed;
    for (const auto& [from, to] : page_.instead) replace_all(command, from, to);
    replace_all(command, "PORT", port_);
    if (broker_) replace_all(command, "BROKER", "mqtt://127.0.0.1:" + std::to_string(broker_->port()));
    return command;
  }

  void one(const Row& row) {
    const auto command = typed(row);
    const auto where = page_.name + ": " + command + "\n";
    if (row.stays) {
      shell_.start(command);
      EXPECT_TRUE(eventually([&] { return shell_.screen().find(row.says) != std::string::npos; }))
          << where << "does not say: " << row.says << "\n"
          << shell_.screen();
    } else {
      const auto ran = shell_.type(command);
      EXPECT_EQ(ran.status, row.status) << where << ran.screen;
      EXPECT_NE(ran.screen.find(row.says), std::string::npos) << where << "does not say: " << row.says << "\n"
                                                              << ran.screen;
    }
    for (int i = 0; i < row.ends; ++i) {
      const auto ended = shell_.end();
      EXPECT_NE(ended.status, -1) << where << "is not ended by Ctrl-C\n" << ended.screen;
    }
    if (row.file.empty()) return;
    const auto path = shell_.file(row.file);
    ASSERT_TRUE(exists(path)) << where << "writes no " << row.file;
    EXPECT_NE(contents(path).find(row.holds), std::string::npos) << where << row.file << ":\n" << contents(path);
  }

  const Page& page_;
  std::string port_;
  std::unique_ptr<mqtt::test::Broker> broker_;
  PageShell shell_;
};

// The commands of a page, in the order of the table.
class PageCommands : public ::testing::TestWithParam<std::string> {};

TEST_P(PageCommands, EachDoesWhatTheTableSays) {
  const auto all = table();
  const auto page = std::ranges::find(all, GetParam(), &Page::name);
  ASSERT_NE(page, all.end());
  if (page->broker) NEEDS_BROKER();
  Reader(*page).read();
}

std::vector<std::string> page_names() {
  std::vector<std::string> names;
  for (const auto& page : table()) names.push_back(page.name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Every, PageCommands, ::testing::ValuesIn(page_names()), [](const auto& page) {
  std::string name = page.param;
  std::erase_if(name, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; });
  return name;
});

TEST(PageTable, HasEachCommandOfEveryPage) {
  std::map<std::string, std::multiset<std::string>> rows;
  for (const auto& page : table()) {
    for (const auto& row : page.rows) {
      if (!row.shown.empty()) rows[page.name].insert(row.shown);
    }
  }
  for (const auto& page : pages()) {
    for (const auto& [line, command] : commands_of(contents(source_dir() + "/" + page))) {
      auto& left = rows[page];
      const auto found = left.find(command);
      EXPECT_NE(found, left.end()) << page << ":" << line << ": no row of " << table_file << " types: " << command;
      if (found != left.end()) left.erase(found);
    }
    for (const auto& command : rows[page]) ADD_FAILURE() << table_file << ": no longer in " << page << ": " << command;
    rows.erase(page);
  }
  for (const auto& [page, ignored] : rows) ADD_FAILURE() << table_file << ": there is no page " << page;
}

TEST(PageTable, CommandsOfAPage) {
  const auto all = commands_of(
      "    berth a  # one\n`berth b`\n\n```\n$ berth c \\\n    d\nberth: error\n```\n```console\n$ berth e\n```\n"
      "    ./run f &\n    other g\n    build/release/berth h x#y\n");
  std::vector<std::string> commands;
  for (const auto& one : all) commands.push_back(one.command);
  EXPECT_EQ(commands, (std::vector<std::string>{"berth a", "berth c d", "./run f", "build/release/berth h x#y"}));
}

}  // namespace
}  // namespace berth::test
