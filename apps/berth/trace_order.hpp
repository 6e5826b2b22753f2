/// Sorts the rows of a trace by time. A row is held while an earlier one may still come: from a line further down in
/// the file, or from an SDO transfer whose last frame is past but whose end is not known yet.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/rt/executor.hpp"

namespace berth::cli {

class RowQueue {
 public:
  static constexpr std::size_t most = 65536;  ///< rows held; beyond that the earliest is emitted
  enum class Kind : std::uint8_t { row, remark };
  using Emit = std::function<void(std::string_view line, Kind kind)>;

  /// `slack`: how far back the times of a source may go. `patience`: how long a transfer in progress holds back later
  /// rows. Both in the trace's time.
  RowQueue(rt::Duration slack, rt::Duration patience, Emit emit)
      : slack_(slack), patience_(patience), emit_(std::move(emit)) {}

  /// Append a line here, then call `add`.
  std::string& buffer() noexcept { return text_; }
  /// The appended line belongs to this time. Lines of equal time keep their order.
  void add(rt::Duration at, Kind kind = Kind::row);
  /// Adds to the newest row.
  void remark() { add(newest_.value_or(rt::Duration::min()), Kind::remark); }
  /// Emits rows that nothing earlier can follow. `pending`: of all transfers in progress, the earliest last frame.
  void release(const std::optional<rt::Duration>& pending);
  void release_all() { release_until(rt::Duration::max()); }
  [[nodiscard]] bool many() const noexcept { return held_.size() - first_ >= 256; }
  [[nodiscard]] bool empty() const noexcept { return held_.size() == first_; }
  /// Rows that came too late for their place in the order.
  [[nodiscard]] std::uint64_t late() const noexcept { return late_; }

 private:
  struct Held {
    rt::Duration at;
    std::size_t from;
    std::size_t size;
    Kind kind;
  };
  void release_until(rt::Duration at);
  void emit_first();

  rt::Duration slack_;
  rt::Duration patience_;
  Emit emit_;
  std::string text_;
  std::size_t begun_ = 0;   // where the next line begins in `text_`
  std::vector<Held> held_;  // ascending
  std::size_t first_ = 0;   // those before it were emitted
  std::optional<rt::Duration> newest_;
  rt::Duration emitted_ = rt::Duration::min();
  std::uint64_t late_ = 0;
};

}  // namespace berth::cli
