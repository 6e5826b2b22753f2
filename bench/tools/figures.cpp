#include "bench/tools/figures.hpp"

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <climits>
#include <cmath>
#include <cstdio>
#include <string_view>

namespace berth::bench {
namespace {

std::string own_path() {
  std::array<char, PATH_MAX> path{};
  const auto size = ::readlink("/proc/self/exe", path.data(), path.size() - 1);
  return size > 0 ? std::string(path.data(), static_cast<std::size_t>(size)) : std::string();
}

/// The number in callgrind's last line: "==123== Collected : 4567".
std::optional<std::uint64_t> collected(std::string_view output) {
  constexpr std::string_view mark = "Collected :";
  const auto at = output.find(mark);
  if (at == std::string_view::npos) return std::nullopt;
  auto rest = output.substr(at + mark.size());
  rest.remove_prefix(std::min(rest.find_first_not_of(' '), rest.size()));
  std::uint64_t value = 0;
  const auto read = std::from_chars(rest.data(), rest.data() + rest.size(), value);
  if (read.ec != std::errc{}) return std::nullopt;
  return value;
}

}  // namespace

double Rounds::median() const {
  auto sorted = values_;
  std::ranges::sort(sorted);
  const auto half = sorted.size() / 2;
  return sorted.size() % 2 != 0 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

std::string Rounds::text() const {
  const auto [least, most] = std::ranges::minmax(values_);
  return fmt::format("{} ({} to {})", grouped(median()), grouped(least), grouped(most));
}

Figure at_least(std::string name, const Rounds& rounds, double aim, const char* unit) {
  return {std::move(name), rounds.text() + " " + unit, ">= " + grouped(aim), rounds.median() >= aim};
}

Figure at_least(std::string name, double measured, double aim, const char* unit) {
  return {std::move(name), grouped(measured) + " " + unit, ">= " + grouped(aim), measured >= aim};
}

Figure at_most(std::string name, double measured, double aim, const char* unit) {
  return {std::move(name), grouped(measured) + " " + unit, "<= " + grouped(aim), measured <= aim};
}

void print_columns(const std::string& title, const std::vector<std::string>& heads,
                   const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (std::size_t c = 0; c < heads.size(); ++c) {
    widths.push_back(heads[c].size());
    for (const auto& row : rows) widths[c] = std::max(widths[c], row[c].size());
  }
  const auto line = [&](const std::vector<std::string>& cells) {
    std::string text;
    for (std::size_t c = 0; c < cells.size(); ++c) text += fmt::format("{:<{}}  ", cells[c], widths[c]);
    text.erase(text.find_last_not_of(' ') + 1);
    fmt::print("{}\n", text);
  };
  fmt::print("\n{}\n", title);
  line(heads);
  std::vector<std::string> rule;
  for (const auto width : widths) rule.emplace_back(width, '-');
  line(rule);
  for (const auto& row : rows) line(row);
  std::fflush(stdout);
}

void print_figures(const std::string& title, std::span<const Figure> figures) {
  std::vector<std::vector<std::string>> rows;
  for (const auto& f : figures) {
    const char* met = !f.met ? "-" : *f.met ? "yes" : "NO";
    rows.push_back({f.name, f.measured, f.aim.empty() ? "-" : f.aim, met});
  }
  print_columns(title, {"figure", "measured", "aim", "met?"}, rows);
}

std::string grouped(double number) {
  if (number < 100) return fmt::format("{:.{}f}", number, number < 10 ? 3 : 1);
  auto digits = fmt::format("{:.0f}", number);
  for (auto at = static_cast<std::ptrdiff_t>(digits.size()) - 3; at > 0; at -= 3) {
    digits.insert(static_cast<std::size_t>(at), ",");
  }
  return digits;
}

std::string time_text(std::chrono::nanoseconds time) {
  const double seconds = std::chrono::duration<double>(time).count();
  return seconds < 1 ? fmt::format("{:.1f} ms", seconds * 1000) : fmt::format("{:.2f} s", seconds);
}

std::optional<std::uint64_t> instructions(const std::vector<std::string>& arguments) {
  std::vector<std::string> command{own_path()};
  command.insert(command.end(), arguments.begin(), arguments.end());
  return instructions_of(command);
}

std::optional<std::uint64_t> instructions_of(const std::vector<std::string>& command) {
  std::string line = "valgrind --tool=callgrind --callgrind-out-file=/dev/null";
  for (const auto& word : command) line += " '" + word + "'";
  line += " 2>&1 >/dev/null";  // valgrind tells on standard error
  std::FILE* pipe = ::popen(line.c_str(), "r");
  if (pipe == nullptr) return std::nullopt;
  std::string output;
  std::array<char, 4096> piece{};
  while (const auto size = std::fread(piece.data(), 1, piece.size(), pipe)) output.append(piece.data(), size);
  const int status = ::pclose(pipe);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) return std::nullopt;
  return collected(output);
}

namespace {

std::optional<double> each(const Counted& counted) {
  const auto none = instructions({counted.option, "0"});
  const auto all = instructions({counted.option, std::to_string(counted.items)});
  if (!none || !all) return std::nullopt;
  return static_cast<double>(*all - *none) / counted.items;
}

}  // namespace

Figure count(const Counted& counted) {
  const auto measured = each(counted);
  return measured ? at_most(counted.name, *measured, counted.aim, "") : Figure{counted.name, no_valgrind, {}, {}};
}

bool holds(const Counted& counted) {
  const auto measured = each(counted);
  fmt::print("{}: {}, at most {}\n", counted.name, measured ? grouped(*measured) : no_valgrind,
             grouped(counted.ceiling));
  return measured && *measured <= counted.ceiling;
}

}  // namespace berth::bench
