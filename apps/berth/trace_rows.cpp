#include "trace_rows.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/text/printable.hpp"
#include "redraw.hpp"

namespace berth::cli {
namespace {

using namespace std::chrono_literals;

// Slack: how far a file's times may go back. Patience: how long a transfer may hold back the rows after it.
constexpr rt::Duration file_slack = 5s;
constexpr rt::Duration file_patience = 60s;
constexpr rt::Duration live_patience = 1s;
// Marks a line in red until it is printed; no row's text begins with this character.
constexpr char red_mark = '\x01';

}  // namespace

RowPrinter::RowPrinter(Form form, bool live, const std::string& times)
    : form_(form),
      colours_(form == Form::words && coloured()),
      queue_(live ? rt::Duration::zero() : file_slack, live ? live_patience : file_patience,
             [this](std::string_view line, RowQueue::Kind kind) { print(line, kind); }) {
  if (form == Form::words && on_terminal()) brief_ = BriefStyle{.width = terminal_size().columns};
  relative_ = times.empty() ? live && brief_ : times == "relative";
  if (colours_) screen_.filter_nothing();
}

void RowPrinter::begin(rt::Duration first, std::size_t buses) {
  first_ = first;
  if (brief_) brief_->bus = buses > 1;
}

// The row with the time to be shown, which is put into `entry`.
decode::Row RowPrinter::timed(const decode::Row& row, trace::Entry& entry) const {
  decode::Row shown = row;
  if (!relative_ || !first_) return shown;
  entry = *row.entry;
  entry.at = std::max(rt::Duration::zero(), entry.at - *first_);  // candump has no time before 0
  shown.began -= *first_;
  shown.entry = &entry;
  return shown;
}

namespace {

bool stands_out(const decode::Row& row) {
  const bool error = row.meaning.service == decode::Service::emcy || row.meaning.service == decode::Service::error;
  return error || row.words.find("abort") != std::string_view::npos;
}

}  // namespace

void RowPrinter::row(const decode::Row& row, const std::string& bus, const std::string& path) {
  switch (form_) {
    case Form::words: {
      trace::Entry entry;
      const decode::Row shown = timed(row, entry);
      std::string& out = queue_.buffer();
      const bool red = colours_ && stands_out(row);
      if (red) out += red_mark;
      if (brief_) {
        RowText::brief(out, shown, bus, path, *brief_);
      } else {
        text_.words(out, shown, bus, path);
      }
      break;
    }
    case Form::json: text_.json(queue_.buffer(), row, bus, path); break;
    case Form::table: RowText::table(queue_.buffer(), row); break;
  }
  queue_.add(row.entry->at);
}

void RowPrinter::remark(const Finding& finding) {
  std::string& out = queue_.buffer();
  if (form_ == Form::json) {
    out += "{\"finding\":";
    put_json(out, finding);
    out += "}\n";
  } else {
    out += to_string(finding);
  }
  queue_.remark();
}

void RowPrinter::settle(const std::optional<rt::Duration>& pending, bool more) {
  const auto now = std::chrono::steady_clock::now();
  if (more) heard_ = now;
  if (brief_) brief_->width = terminal_size().columns;
  if (now - heard_ >= live_patience) {
    queue_.release_all();
  } else {
    queue_.release(pending);
  }
  screen_.flush();
}

// Prints a line in its order. Standard output and standard error may go to the same terminal.
void RowPrinter::print(std::string_view line, RowQueue::Kind kind) {
  if (kind == RowQueue::Kind::remark && form_ != Form::json) {
    screen_.flush();
    return print_error(std::string(line));
  }
  if (form_ == Form::table) {
    if (printed_ == 0) screen_.buffer() += "Msg\tID\tDetails\tRaw Message\n";
    screen_.buffer() += fmt::format("{}\t", ++printed_);
  }
  if (!colours_) {
    screen_.buffer() += line;
  } else if (line.starts_with(red_mark)) {
    screen_.buffer() += "\x1b[31m" + text::one_line(line.substr(1, line.size() - 2)) + "\x1b[0m\n";
  } else {
    screen_.buffer() += text::printable(line);
  }
  screen_.full();
}

}  // namespace berth::cli
