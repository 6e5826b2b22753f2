/// The log format of can-utils' `candump -L`, which `canplayer` plays: one frame a line, bytes in and bytes out.
///
///     (1436509052.249713) can0 7E5#5100000000800000        base, data
///     (1436509052.250001) can0 1F900135#                   extended, no data
///     (1436509052.250400) can0 701#R                       remote
///     (1436509052.250900) can0 123##1AABB                  FD, flags 1 = BRS, 2 = ESI
///
/// Time is seconds and six digits of microseconds; the bus's name has no blanks; the frame is as `can::to_string`
/// writes it. A direction may stand behind it (` R`, ` T`: `candump -x`). SocketCAN's error frames are lines like any
/// other, with 2000 0000h in the identifier: (1436509052.251100) can0 20000004#0008000000000000. What `candump` prints
/// without -L is read too (candump_plain.hpp).
#pragma once

#include <string>
#include <string_view>

#include "berth/base/finding.hpp"
#include "berth/trace/lines.hpp"
#include "berth/trace/trace.hpp"

namespace berth::trace {

/// Piece by piece (stream.hpp). Strict: anything that candump does not write is an error, and its line is left out.
class CandumpReader final : public LineReader {
 public:
  /// Without `error_frames` they are warnings, and left out.
  explicit CandumpReader(std::string file, bool error_frames = true)
      : LineReader(std::move(file)), error_frames_(error_frames) {}

 private:
  void line(std::string_view line) override;
  [[nodiscard]] bool quick(std::string_view line);
  [[nodiscard]] std::size_t quick_name(std::string_view text);
  [[nodiscard]] bool for_people(std::string_view line);
  void careful();
  [[nodiscard]] std::optional<rt::Duration> time();
  [[nodiscard]] std::optional<std::string_view> word(const char* what);
  [[nodiscard]] bool tail();

  bool error_frames_;
  Entry entry_;
  std::string last_name_;  // the bus of the line before
  std::uint16_t last_bus_ = 0;
  std::string_view line_;
  std::size_t column_ = 0;
};

class CandumpWriter final : public Writer {
 public:
  explicit CandumpWriter(bool directions) : directions_(directions) {}
  void write(const Entry& entry, std::string_view bus, std::string& out) override;
  void finish(std::string&) override {}

 private:
  bool directions_;
  LineNames names_;
  std::int64_t seconds_ = -1;  // whose digits `digits_` are
  std::array<char, 10> digits_{};
};

struct Reading {
  Trace trace;        ///< every line that could be read, errors or not
  Findings findings;  ///< with line and column; errors: lines that are not of this format
};

/// Reads a whole log into memory. Empty lines and either kind of line end pass. Warnings: time goes backwards on a bus;
/// error frames, which are no frames and are left out. After `most_findings` the rest is counted in one last finding.
[[nodiscard]] Reading read_candump(std::string_view text, const std::string& file_name);
inline constexpr std::size_t most_findings = 100;

/// One line without its end. `at` 0 or later, rounded to the nearest microsecond. `bus` is written as it is.
[[nodiscard]] std::string candump_line(rt::Duration at, std::string_view bus, const can::Frame& frame);
/// The same for a frame that is text already, as `can::to_string` writes it.
[[nodiscard]] std::string candump_line(rt::Duration at, std::string_view bus, std::string_view frame);
/// The whole log, each line with its end.
[[nodiscard]] std::string write_candump(const Trace& trace);

}  // namespace berth::trace
