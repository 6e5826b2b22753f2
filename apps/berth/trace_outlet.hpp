/// Writes a trace to a file or to standard output in large pieces; rows as words, as JSON or as a table.
#pragma once

#include <string>
#include <string_view>

#include "berth/decode/decoder.hpp"
#include "berth/trace/candump.hpp"
#include "output.hpp"
#include "trace.hpp"
#include "trace_brief.hpp"

namespace berth::cli {

/// A file that appears complete at the end, or one that grows under its own name; or standard output.
class Outlet {
 public:
  static constexpr std::size_t piece = 1U << 18U;

  Outlet() = default;  ///< standard output
  ~Outlet();
  Outlet(const Outlet&) = delete;
  Outlet& operator=(const Outlet&) = delete;

  /// `grows`: a live source's record remains if the program dies. "-": standard output.
  [[nodiscard]] std::optional<Failure> open(const std::string& path, bool grows, bool force);
  /// Append to it, then call `full`.
  std::string& buffer() noexcept { return buffer_; }
  /// From now on the appended text is already filtered (`text::printable`), or is a colour code.
  void filter_nothing() noexcept { filters_ = false; }
  void full() {
    if (buffer_.size() >= piece) flush();
  }
  /// Writes what is buffered. `done` and `broken` report errors.
  void flush();
  [[nodiscard]] bool broken() const noexcept { return error_ != 0; }
  /// The reader of a pipe has left; that is not reported.
  [[nodiscard]] bool left() const noexcept;
  /// Gives the file its name.
  [[nodiscard]] std::optional<Failure> done();

 private:
  [[nodiscard]] Failure failed() const;
  int fd_ = 1;
  bool filters_ = true;
  bool screen_ = true;  // lines for a user or a program, not a trace file
  int error_ = 0;
  std::string path_;
  std::string temporary_;  // empty: the file grows, or it is standard output
  std::string buffer_;
};

/// Appends a JSON string with its quotes.
void put_json(std::string& out, std::string_view text);
/// "12.000001": seconds with six digits, or nine if needed.
void put_seconds(std::string& out, rt::Duration time);
void put_json(std::string& out, const Finding& finding);

/// One row as a line.
class RowText {
 public:
  /// The frame as candump writes it, then the words.
  void words(std::string& out, const decode::Row& row, const std::string& bus, const std::string& path);
  /// One line on a terminal.
  static void brief(std::string& out, const decode::Row& row, const std::string& bus, const std::string& path,
                    const BriefStyle& style);
  void json(std::string& out, const decode::Row& row, const std::string& bus, const std::string& path);
  /// Identifier, details and raw message, separated by tabs.
  static void table(std::string& out, const decode::Row& row);

 private:
  trace::CandumpWriter writer_{true};
  std::string line_;
};

}  // namespace berth::cli
