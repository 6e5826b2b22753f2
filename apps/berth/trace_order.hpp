/// Rows of a trace in the order of their times. A row is held for as long as an earlier one may come: one of a line
/// that stands further down in the file, or that of an SDO transfer of which the last frame is over and the end not
/// known.
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
  static constexpr std::size_t most = 65536;  ///< rows held; the earliest goes when there are more
  enum class Kind : std::uint8_t { row, remark };
  using Emit = std::function<void(std::string_view line, Kind kind)>;

  /// `slack`: how far back the times of a source may go; `patience`: how long a transfer that is under way holds back
  /// what comes after it. Both in time of the trace.
  RowQueue(rt::Duration slack, rt::Duration patience, Emit emit)
      : slack_(slack), patience_(patience), emit_(std::move(emit)) {}

  /// Append a line here, then call `add`.
  std::string& buffer() noexcept { return text_; }
  /// What was appended belongs to this time. Of one time the order stays.
  void add(rt::Duration at, Kind kind = Kind::row);
  /// To the newest row.
  void remark() { add(newest_.value_or(rt::Duration::min()), Kind::remark); }
  /// Emits what nothing earlier can follow. `pending`: of the transfers that are under way, the last frame of the one
  /// that was heard least lately.
  void release(const std::optional<rt::Duration>& pending);
  void release_all() { release_until(rt::Duration::max()); }
  [[nodiscard]] bool many() const noexcept { return held_.size() - first_ >= 256; }
  [[nodiscard]] bool empty() const noexcept { return held_.size() == first_; }
  /// Rows that came too late for their place.
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
  std::size_t begun_ = 0;   // where in `text_` the next line begins
  std::vector<Held> held_;  // ascending
  std::size_t first_ = 0;   // those before it are emitted
  std::optional<rt::Duration> newest_;
  rt::Duration emitted_ = rt::Duration::min();
  std::uint64_t late_ = 0;
};

}  // namespace berth::cli
