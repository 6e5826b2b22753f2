/// What the benches share: the table they print, a stop watch, and instructions counted by callgrind.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace berth::bench {

/// One figure. `met` empty: there is no aim, or it was not measured.
struct Figure {
  std::string name;
  std::string measured;
  std::string aim{};
  std::optional<bool> met{};
};

/// One measurement, made several times.
class Rounds {
 public:
  void add(double value) { values_.push_back(value); }
  [[nodiscard]] double median() const;
  /// "median (minimum to maximum)"
  [[nodiscard]] std::string text() const;

 private:
  std::vector<double> values_;
};

/// Of rounds the median counts; the text has the minimum and maximum, too.
[[nodiscard]] Figure at_least(std::string name, const Rounds& rounds, double aim, const char* unit);
[[nodiscard]] Figure at_least(std::string name, double measured, double aim, const char* unit);
[[nodiscard]] Figure at_most(std::string name, double measured, double aim, const char* unit);

/// `rows` in columns under `heads`, two spaces between them.
void print_columns(const std::string& title, const std::vector<std::string>& heads,
                   const std::vector<std::vector<std::string>>& rows);
/// The columns figure, measured, aim, met?.
void print_figures(const std::string& title, std::span<const Figure> figures);

/// "1,234,567"
[[nodiscard]] std::string grouped(double number);
/// "190.0 ms", "11.14 s"
[[nodiscard]] std::string time_text(std::chrono::nanoseconds time);

/// Wall time; nothing but a bench may look at it.
class Watch {
 public:
  [[nodiscard]] double seconds() const noexcept {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count();
  }

 private:
  std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
};

/// Instructions that this program takes when it is started with these arguments, counted by valgrind's callgrind.
/// Empty: no valgrind here, or the run failed.
[[nodiscard]] std::optional<std::uint64_t> instructions(const std::vector<std::string>& arguments);
/// The same of any program: `command` is its path and its arguments.
[[nodiscard]] std::optional<std::uint64_t> instructions_of(const std::vector<std::string>& command);
/// What is counted, of what: `option N` makes this program do it N times.
struct Counted {
  const char* name;
  const char* option;
  unsigned items;
  double aim;
  double ceiling;  ///< ./run test fails above; the aim where it is met
};
/// Instructions each, against the aim.
[[nodiscard]] Figure count(const Counted& counted);
/// For ./run test: prints the count against its ceiling. False above it, and where nothing can be counted.
[[nodiscard]] bool holds(const Counted& counted);
/// What the figure says where `instructions` is empty.
inline constexpr const char* no_valgrind = "valgrind missing";

}  // namespace berth::bench
