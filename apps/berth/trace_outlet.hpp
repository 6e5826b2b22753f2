/// Where a trace goes: bytes in large pieces to a file or to standard output, rows as words, as JSON, as a table.
#pragma once

#include <string>
#include <string_view>

#include "berth/decode/decoder.hpp"
#include "berth/trace/candump.hpp"
#include "output.hpp"
#include "trace.hpp"
#include "trace_brief.hpp"

namespace berth::cli {

/// A file that appears whole when it is done, or one that grows under its own name; or standard output.
class Outlet {
 public:
  static constexpr std::size_t piece = 1U << 18U;

  Outlet() = default;  ///< standard output
  ~Outlet();
  Outlet(const Outlet&) = delete;
  Outlet& operator=(const Outlet&) = delete;

  /// `grows`: what a live source recorded stays when the program dies. "-": standard output.
  [[nodiscard]] std::optional<Failure> open(const std::string& path, bool grows, bool force);
  /// Append here, then call `full`.
  std::string& buffer() noexcept { return buffer_; }
  /// What is appended is filtered already (`text::printable`), or is a colour.
  void filter_nothing() noexcept { filters_ = false; }
  void full() {
    if (buffer_.size() >= piece) flush();
  }
  /// Writes what is there. What went wrong is told by `done` and `broken`.
  void flush();
  [[nodiscard]] bool broken() const noexcept { return error_ != 0; }
  /// The reader of a pipe has left: it knows, and is not told.
  [[nodiscard]] bool left() const noexcept;
  /// The file gets its name.
  [[nodiscard]] std::optional<Failure> done();

 private:
  [[nodiscard]] Failure failed() const;
  int fd_ = 1;
  bool filters_ = true;
  bool screen_ = true;  // lines for a person or a program, no file of a trace
  int error_ = 0;
  std::string path_;
  std::string temporary_;  // empty: it grows, or is standard output
  std::string buffer_;
};

/// A JSON string with its quotes, appended.
void put_json(std::string& out, std::string_view text);
/// "12.000001": seconds with six digits, or nine where they are needed.
void put_seconds(std::string& out, rt::Duration time);
void put_json(std::string& out, const Finding& finding);

/// One row as a line.
class RowText {
 public:
  /// As candump writes the frame, then the words.
  void words(std::string& out, const decode::Row& row, const std::string& bus, const std::string& path);
  /// One line on a terminal.
  static void brief(std::string& out, const decode::Row& row, const std::string& bus, const std::string& path,
                    const BriefStyle& style);
  void json(std::string& out, const decode::Row& row, const std::string& bus, const std::string& path);
  /// Identifier, details, raw message, with tabs between.
  static void table(std::string& out, const decode::Row& row);

 private:
  trace::CandumpWriter writer_{true};
  std::string line_;
};

}  // namespace berth::cli
