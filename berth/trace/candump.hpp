/// The log format of can-utils' `candump -L`, which `canplayer` plays: one frame per line.
///
///     (1436509052.249713) can0 7E5#5100000000800000        base, data
///     (1436509052.250001) can0 1F900135#                   extended, no data
///     (1436509052.250400) can0 701#R                       remote
///     (1436509052.250900) can0 123##1AABB                  FD, flags 1 = BRS, 2 = ESI
///
/// Time is seconds and digits after the point, six or, with -N, nine; blanks pad the bus's name, which contains none;
/// the frame is as `can::to_string` writes it, perhaps with a DLC above 8 after it (`_F`: `candump -8`). A direction
/// may follow (` R`, ` T`: `candump -x`). SocketCAN's error frames are lines like any other, with 2000 0000h in the
/// identifier: (1436509052.251100) can0 20000004#0008000000000000. The output of `candump` without -L is read too
/// (candump_plain.hpp), and the words that -e prints below an error frame.
///
/// `candump -td` prints the time since the previous line. Times near 0 that decrease show such a log: they are summed,
/// with a finding. `ReadOptions::deltas` is for such a log whose times never decrease.
#pragma once

#include <string>
#include <string_view>

#include "berth/base/finding.hpp"
#include "berth/trace/lines.hpp"
#include "berth/trace/trace.hpp"

namespace berth::trace {

/// Holds lines whose times count from 0 until their kind is known: times decrease, or enough of them do not.
class DeltaTimes {
 public:
  static constexpr std::size_t enough = 64;
  explicit DeltaTimes(bool known) noexcept : kind_(known ? Kind::deltas : Kind::open) {}
  enum class Turn : std::uint8_t {
    as_it_is,  ///< use the entry now
    held,      ///< the entry is held
    decided    ///< `take` returns it and those before it
  };
  /// The next line with a time. If times are known to be deltas, `entry.at` is the sum.
  [[nodiscard]] Turn add(Entry& entry);
  /// The held entries with corrected times; `deltas` gives their kind. May also be called at the end of the log.
  [[nodiscard]] std::vector<Entry> take();
  [[nodiscard]] bool deltas() const noexcept { return kind_ == Kind::deltas; }

 private:
  enum class Kind : std::uint8_t { open, times, deltas };
  Kind kind_;
  rt::Duration sum_{};
  std::vector<Entry> held_;
};

/// Reads piece by piece (stream.hpp). Anything that candump does not write is an error, and its line is left out.
class CandumpReader final : public LineReader {
 public:
  /// Without `error_frames` they are warnings, and left out. `deltas`: each time counts from the previous line.
  explicit CandumpReader(std::string file, bool error_frames = true, bool deltas = false)
      : LineReader(std::move(file)), error_frames_(error_frames), deltas_(deltas) {}

 private:
  void line(std::string_view line) override;
  void over() override { give_held(); }
  void keep_timed();
  void give_held();
  [[nodiscard]] bool quick(std::string_view line);
  [[nodiscard]] std::size_t quick_name(std::string_view text);
  [[nodiscard]] bool for_people(std::string_view line);
  void careful();
  [[nodiscard]] std::optional<rt::Duration> time();
  [[nodiscard]] std::optional<std::string_view> word(const char* what);
  [[nodiscard]] bool tail();
  void skip_blanks();

  bool error_frames_;
  DeltaTimes deltas_;
  bool words_follow_ = false;  // of an error frame
  Entry entry_;
  std::string last_name_;  // the bus of the previous line
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
  std::int64_t seconds_ = -1;  // the seconds whose digits are in `digits_`
  std::array<char, 10> digits_{};
};

struct Reading {
  Trace trace;        ///< every line that could be read, errors or not
  Findings findings;  ///< with line and column; errors: lines that are not of this format
};

/// Reads a whole log into memory. Accepts empty lines and both kinds of line end. Warnings: time goes backwards on a
/// bus; error frames, which are left out. After `most_findings` one last finding counts the rest.
[[nodiscard]] Reading read_candump(std::string_view text, const std::string& file_name);
inline constexpr std::size_t most_findings = 100;

/// One line without its line end. `at` 0 or later, rounded to the nearest microsecond. `bus` is written unchanged.
[[nodiscard]] std::string candump_line(rt::Duration at, std::string_view bus, const can::Frame& frame);
/// The same for a frame that is already text, as `can::to_string` writes it.
[[nodiscard]] std::string candump_line(rt::Duration at, std::string_view bus, std::string_view frame);
/// The whole log, with line ends.
[[nodiscard]] std::string write_candump(const Trace& trace);

}  // namespace berth::trace
