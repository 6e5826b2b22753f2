/// The rows of a trace on standard output, and what is said between them, in the order of their times.
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

  /// `live`: rows are seen at once, but for those after a request without an answer. `times`: of --times.
  RowPrinter(Form form, bool live, const std::string& times);
  /// The trace has this as its first frame, and so many buses. Before the first row.
  void begin(rt::Duration first, std::size_t buses);

  /// `path`: of the node beneath gateways that the row is about; empty: the bus's own.
  void row(const decode::Row& row, const std::string& bus, const std::string& path);
  /// Behind the rows that are there: as JSON a line of its own, else on standard error.
  void remark(const Finding& finding);
  [[nodiscard]] bool many() const noexcept { return queue_.many(); }
  /// What nothing earlier can follow is printed (`RowQueue::release`).
  void release(const std::optional<rt::Duration>& pending) { queue_.release(pending); }
  void release_all() { queue_.release_all(); }
  /// Of a live source, after each turn: `more`, whether anything came in it.
  void settle(const std::optional<rt::Duration>& pending, bool more);
  [[nodiscard]] std::uint64_t late() const noexcept { return queue_.late(); }
  /// For what is printed after all rows.
  Outlet& screen() noexcept { return screen_; }
  [[nodiscard]] bool broken() const noexcept { return screen_.broken(); }

 private:
  void print(std::string_view line, RowQueue::Kind kind);
  [[nodiscard]] decode::Row timed(const decode::Row& row, trace::Entry& entry) const;

  Form form_;
  bool relative_ = false;
  bool colours_;                     // rows that stand out
  std::optional<BriefStyle> brief_;  // one line a row on this terminal
  std::optional<rt::Duration> first_;
  Outlet screen_;
  RowText text_;
  RowQueue queue_;
  std::uint64_t printed_ = 0;  // rows of the table
  std::chrono::steady_clock::time_point heard_ = std::chrono::steady_clock::now();
};

}  // namespace berth::cli
