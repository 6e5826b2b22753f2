/// Output for users and programs.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "berth/base/finding.hpp"

namespace berth::cli {

/// An error: a message for users, and one JSON object.
struct Failure {
  int status = 0;
  std::string message;  ///< may have several lines, each filtered (`text::one_line`)
  std::string json;
};
[[nodiscard]] Failure failure(int status, const std::string& message);
/// A message in several lines: each of `lines` begins a new one, line feeds within one do not.
[[nodiscard]] Failure failure_in_lines(int status, const std::vector<std::string>& lines);
/// Every error of a file, with its place. Status 2.
[[nodiscard]] Failure failure(const Findings& findings);

/// Prints every warning on standard error; nothing with `json`.
void warn(const Findings& findings, bool json);
/// Prints the message on standard error, or with `json` the object on standard output. Returns the status.
int tell(const Failure& failure, bool json);

/// Call it first in a program.
/// - A closed standard stream gets /dev/null, so that no file opened later takes its number and gets the text.
/// - When the reader of the output leaves, that is an error of the output and does not end the program.
/// - The same holds for a file that reaches `ulimit -f`.
void secure_streams();
/// Standard output could not be written: the reader has left, or the disk is full. The run then ends as by SIGTERM.
[[nodiscard]] bool output_broken() noexcept;
/// From now on until `with_output` a thread of its own writes what is printed, so that nothing of this program waits
/// for a reader that has stopped: a run whose buses go on meanwhile (`io::WriteBehind`).
void write_behind();
/// The run cannot go on: it ends as by SIGTERM, with status 3. The caller has printed the reason.
void end_run() noexcept;
/// `end_run` was called, or the output is broken.
[[nodiscard]] bool run_must_end() noexcept;
/// Call it last in a program: returns `status`, or 3 after `end_run` or when standard output could not be written,
/// which is reported once.
[[nodiscard]] int with_output(int status);

/// Only these, `Screen` and `Outlet` write to a terminal. Each filters what it writes (`text::one_line`), because it
/// gets texts of devices, files and peers unfiltered. One line feed each, at its end.
void print_line(const std::string& line);
void print_lines(const std::vector<std::string>& lines);
void print_error(const std::string& message);
/// Progress, on standard error: it is not part of the answer.
void print_progress(const std::string& line);
/// Text that has line feeds of this program: JSON, a file that Berth wrote. Everything else is filtered
/// (`text::printable`).
void print_text(const std::string& text);
/// While it exists, `take` gets the lines of `print_error`, `print_errors` and `print_progress` in place of standard
/// error, if that is a terminal: otherwise a table drawn in place would overwrite them. One at a time.
class ErrorLines {
 public:
  using Take = std::function<void(const std::string& line)>;
  explicit ErrorLines(Take take);
  ~ErrorLines();
  ErrorLines(const ErrorLines&) = delete;
  ErrorLines& operator=(const ErrorLines&) = delete;
};
/// Several errors, one per line, as in `Failure::message` and `command::Reply::error`.
void print_errors(const std::string& message);
/// Cursor movements, with texts that are already filtered.
void write_text(const std::string& text);
[[nodiscard]] bool on_terminal();

enum class Colour : std::uint8_t {
  automatic,  ///< on a terminal that can draw, unless NO_COLOR is set
  always,
  never
};
/// `--color`.
void choose_colour(Colour colour) noexcept;
/// Highlights are coloured.
[[nodiscard]] bool coloured() noexcept;

}  // namespace berth::cli
