#include "trace_rows.hpp"

#include <fmt/format.h>

namespace berth::cli {
namespace {

using namespace std::chrono_literals;

// How far the times of a file's lines may go back, and how long a transfer may hold back the rows after it.
constexpr rt::Duration file_slack = 5s;
constexpr rt::Duration file_patience = 60s;
constexpr rt::Duration live_patience = 1s;

}  // namespace

RowPrinter::RowPrinter(Form form, bool live)
    : form_(form),
      queue_(live ? rt::Duration::zero() : file_slack, live ? live_patience : file_patience,
             [this](std::string_view line, RowQueue::Kind kind) { print(line, kind); }) {}

void RowPrinter::row(const decode::Row& row, const std::string& bus, const std::string& path) {
  switch (form_) {
    case Form::words: text_.words(queue_.buffer(), row, bus, path); break;
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
  if (now - heard_ >= live_patience) {
    queue_.release_all();
  } else {
    queue_.release(pending);
  }
  screen_.flush();
}

// A line in its place. Both streams may go to one.
void RowPrinter::print(std::string_view line, RowQueue::Kind kind) {
  if (kind == RowQueue::Kind::remark && form_ != Form::json) {
    screen_.flush();
    return print_error(std::string(line));
  }
  if (form_ == Form::table) {
    if (printed_ == 0) screen_.buffer() += "Msg\tID\tDetails\tRaw Message\n";
    screen_.buffer() += fmt::format("{}\t", ++printed_);
  }
  screen_.buffer() += line;
  screen_.full();
}

}  // namespace berth::cli
