/// Prints a trace's rows and the remarks between them on standard output, ordered by time.
#pragma once

#include <chrono>
#include <optional>

#include "trace_brief.hpp"
#include "trace_order.hpp"
#include "trace_outlet.hpp"

namespace berth::cli {

class RowPrinter {
 public:
  enum class Form : std::uint8_t { words, json, table };

  /// `live`: prints rows at once, except those after an unanswered request. `times`: of --times.
  RowPrinter(Form form, bool live, const std::string& times);
  /// Gives the trace's first frame and its number of buses. Call it before the first row.
  void begin(rt::Duration first, std::size_t buses);

  /// `path`: of the node beneath gateways that the row is about; empty: on the bus itself.
  void row(const decode::Row& row, const std::string& bus, const std::string& path);
  /// After the present rows: with JSON a line of its own, else on standard error.
  void remark(const Finding& finding);
  [[nodiscard]] bool many() const noexcept { return queue_.many(); }
  /// Prints rows that nothing earlier can follow (`RowQueue::release`).
  void release(const std::optional<rt::Duration>& pending) { queue_.release(pending); }
  void release_all() { queue_.release_all(); }
  /// For a live source, after each turn. `more`: the turn brought entries.
  void settle(const std::optional<rt::Duration>& pending, bool more);
  [[nodiscard]] std::uint64_t late() const noexcept { return queue_.late(); }
  /// For text after all rows.
  Outlet& screen() noexcept { return screen_; }
  [[nodiscard]] bool broken() const noexcept { return screen_.broken(); }

 private:
  void print(std::string_view line, RowQueue::Kind kind);
  [[nodiscard]] decode::Row timed(const decode::Row& row, trace::Entry& entry) const;

  Form form_;
  bool relative_ = false;
  bool colours_;                     // highlighted rows
  std::optional<BriefStyle> brief_;  // one line per row on this terminal
  std::optional<rt::Duration> first_;
  Outlet screen_;
  RowText text_;
  RowQueue queue_;
  std::uint64_t printed_ = 0;  // rows of the table
  std::chrono::steady_clock::time_point heard_ = std::chrono::steady_clock::now();
};

}  // namespace berth::cli
