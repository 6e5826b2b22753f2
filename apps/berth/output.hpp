/// What goes to a person or a program, and how.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "berth/base/finding.hpp"

namespace berth::cli {

/// Something went wrong: words for people, and one JSON object.
struct Failure {
  int status = 0;
  std::string message;  ///< may have several lines, each filtered (`text::one_line`)
  std::string json;
};
[[nodiscard]] Failure failure(int status, const std::string& message);
/// In several lines: each of `lines` begins a new one, a line feed within one does not.
[[nodiscard]] Failure failure_in_lines(int status, const std::vector<std::string>& lines);
/// Of a file: every error with its place. Status 2.
[[nodiscard]] Failure failure(const Findings& findings);

/// Every warning, on standard error; with `json` nothing.
void warn(const Findings& findings, bool json);
/// Message on standard error, or with `json` the object on standard output. Gives the status.
int tell(const Failure& failure, bool json);

/// First thing in a program. A closed standard stream gets /dev/null, so that no file that is opened later takes its
/// number and gets the text; and a reader of the output that leaves is an error of the output, not the program's end;
/// so is a file that is as large as `ulimit -f` allows.
void secure_streams();
/// Something could not be written to standard output: the reader has left, or the disk is full. What runs ends then,
/// as by SIGTERM.
[[nodiscard]] bool output_broken() noexcept;
/// What runs cannot go on: it ends, as by SIGTERM, and with status 3. Whoever calls this has told why.
void end_run() noexcept;
/// `end_run` was called, or the output is broken.
[[nodiscard]] bool run_must_end() noexcept;
/// Last thing in a program: `status`, or 3 when standard output could not be written, which is told once, or after
/// `end_run`.
[[nodiscard]] int with_output(int status);

/// These, `Screen` and `Outlet` are the only places that write to a terminal, and each filters what it writes
/// (`text::one_line`): texts of devices, files and peers reach them as they came. One line feed each, at its end.
void print_line(const std::string& line);
void print_lines(const std::vector<std::string>& lines);
void print_error(const std::string& message);
/// What happens meanwhile, on standard error: it is no part of the answer.
void print_progress(const std::string& line);
/// Text whose line feeds are this program's own: JSON, a file that Berth wrote. The rest is filtered
/// (`text::printable`).
void print_text(const std::string& text);
/// While it lives, what `print_error`, `print_errors` and `print_progress` say goes to `take`, line by line, instead of
/// standard error, if that is a terminal: a table that is drawn in place there would be drawn over it. One at a time.
class ErrorLines {
 public:
  using Take = std::function<void(const std::string& line)>;
  explicit ErrorLines(Take take);
  ~ErrorLines();
  ErrorLines(const ErrorLines&) = delete;
  ErrorLines& operator=(const ErrorLines&) = delete;
};
/// Errors one a line, as `Failure::message` and `command::Reply::error` have them.
void print_errors(const std::string& message);
/// What moves a cursor, with the texts in it filtered already.
void write_text(const std::string& text);
[[nodiscard]] bool on_terminal();

enum class Colour : std::uint8_t {
  automatic,  ///< on a terminal that can draw, unless NO_COLOR is set
  always,
  never
};
/// `--color`.
void choose_colour(Colour colour) noexcept;
/// What stands out is written in colour.
[[nodiscard]] bool coloured() noexcept;

}  // namespace berth::cli
