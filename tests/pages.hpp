/// Does what a page of docs/ tells its reader to do, and compares what the page shows with what comes.
///
/// Of a page count its fenced blocks of the language `console`: a line that begins with "$ " is typed in a shell on a
/// terminal, the lines below it are the screen that follows. A line "…" stands for any number of lines left out. A
/// comment directly above a fence says what only the test has to know:
///
///     <!-- test: stays -->          the command goes on in a terminal of its own; the screen is waited for
///     <!-- test: screen -->         no command: the terminal that stays shows this by now
///     <!-- test: status 1 -->       the exit status of the last command, 0 unless told
///     <!-- test: times -->          durations, rates and shares differ from run to run: only their form is compared
///     <!-- test: not run -->        nobody types this here: it builds for minutes
///     <!-- test: stamps -->         the same of the stamps of frames
///     <!-- test: write NAME -->     the reader writes this file
///     <!-- test: shown NAME -->     this is in that file
///     <!-- test: ctrl-c -->         above no fence: the terminal that stays is ended
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace berth::test {

/// Why the screen is not as shown, with the whole screen; nothing: it is.
[[nodiscard]] std::optional<std::string> difference(const std::string& shown, const std::string& screen);

/// The text with each number that has a unit of time, a rate or a share as "#", and with single spaces.
[[nodiscard]] std::string without_times(const std::string& text);

/// The text with each time stamp of a candump log as "(#)".
[[nodiscard]] std::string without_stamps(const std::string& text);

struct PageBlock {
  std::size_t line = 0;  ///< of the first line of its text, from 1; of a mark without a fence, that of the mark
  std::string language;  ///< empty: a mark without a fence
  std::string mark;      ///< what stands behind `test:`
  std::string text;      ///< whole lines
};

/// The fenced blocks, and the marks that stand above none.
[[nodiscard]] std::vector<PageBlock> blocks_of(const std::string& page);

/// A folder with a shell in it, as a reader of a page has one: `berth` is this build's, ~/berth is the repository.
class PageShell {
 public:
  PageShell();
  ~PageShell();
  PageShell(const PageShell&) = delete;
  PageShell& operator=(const PageShell&) = delete;

  struct Typed {
    int status = -1;  ///< 128 + signal when it was killed; -1 when it did not end in time
    std::string screen;
  };
  /// To its end.
  [[nodiscard]] Typed type(const std::string& command);
  /// In a terminal of its own, until `end` or the end of this object.
  void start(const std::string& command);
  /// What the newest one of these shows: also what went out at the top.
  [[nodiscard]] std::string screen();
  /// Ctrl-C in the newest one, and what it showed last.
  [[nodiscard]] Typed end();
  /// A file where the shell is.
  [[nodiscard]] std::string file(const std::string& name) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

/// Does all that the page tells, and reports each difference at its line of the page as a failure of the test. With
/// BERTH_PAGES_UPDATE=1 it writes what came into the page instead, but for screens with a line left out.
void follow(PageShell& shell, const std::string& page);

}  // namespace berth::test
