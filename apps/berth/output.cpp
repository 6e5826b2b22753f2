#include "output.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <fmt/format.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "berth/io/service_manager.hpp"
#include "berth/io/write_behind.hpp"
#include "berth/text/printable.hpp"
#include "options.hpp"

namespace berth::cli {

using Json = nlohmann::ordered_json;

namespace {

constexpr std::size_t most_told = 100;  // errors of one file, and as many warnings

int broken_by = 0;  // errno of the first write that failed
bool run_ended = false;
std::optional<io::WriteBehind> behind;  // writes in the place of this thread

std::string dump(const Json& json) { return json.dump(2, ' ', false, Json::error_handler_t::replace); }

}  // namespace

Failure failure(int status, const std::string& message) { return failure_in_lines(status, {message}); }

Failure failure_in_lines(int status, const std::vector<std::string>& lines) {
  std::string raw;
  std::string shown;
  for (const auto& line : lines) {
    const char* const separator = &line == &lines.front() ? "" : "\n";
    raw += separator + line;
    shown += separator + text::one_line(line);
  }
  Json json;
  json["error"]["message"] = raw;
  return {status, shown, dump(json)};
}

Failure failure(const Findings& findings) {
  Failure f{2, {}, {}};
  Json json;
  auto& list = json["error"]["findings"];
  std::size_t told = 0;
  for (const auto& finding : findings) {
    if (finding.severity != Finding::Severity::error) continue;
    if (++told > most_told) continue;
    f.message += (f.message.empty() ? "" : "\n") + text::one_line(to_string(finding));
    Json one;
    one["file"] = finding.file;
    one["line"] = finding.line;
    one["column"] = finding.column;
    one["key"] = finding.key;
    one["message"] = finding.message;
    if (!finding.fix.empty()) one["fix"] = finding.fix;
    list.push_back(one);
  }
  if (told > most_told) f.message += fmt::format("\n{} more errors are not shown", told - most_told);
  json["error"]["message"] = f.message;
  f.json = dump(json);
  return f;
}

void warn(const Findings& findings, bool json) {
  std::size_t told = 0;
  for (const auto& f : findings) {
    if (f.severity != Finding::Severity::warning || json) continue;
    if (++told <= most_told) print_error(to_string(f));
  }
  if (told > most_told) print_error(fmt::format("{} more warnings are not shown", told - most_told));
}

int tell(const Failure& failure, bool json) {
  if (json) {
    print_text(failure.json);
  } else {
    print_errors(failure.message);
  }
  return failure.status;
}

void secure_streams() {
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::fcntl(fd, F_GETFD) < 0 && errno == EBADF) static_cast<void>(::open("/dev/null", O_RDWR));
  }
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

bool output_broken() noexcept {
  if (behind && broken_by == 0) broken_by = behind->broken(STDOUT_FILENO);
  return broken_by != 0;
}

void write_behind() {
  if (behind) return;
  std::fflush(stdout);
  behind.emplace(io::WriteBehind::Options{.lost = [](std::size_t lines) {
    return fmt::format("{}berth: {} lines of output are lost: nobody has read them in time\n",
                       io::is_journal(STDERR_FILENO) ? "<4>" : "", lines);
  }});
  if (!behind->good()) behind.reset();
}

void end_run() noexcept { run_ended = true; }

bool run_must_end() noexcept { return run_ended || output_broken(); }

int with_output(int status) {
  if (behind) behind->finish();
  static_cast<void>(output_broken());
  behind.reset();
  if (std::fflush(stdout) != 0 && broken_by == 0) broken_by = errno;
  if (broken_by == 0) return run_ended ? int{Exit::failed} : status;
  // EPIPE is not reported: the reader itself closed the pipe.
  if (broken_by != EPIPE) print_error(std::string("standard output: ") + std::strerror(broken_by));
  return Exit::failed;
}

void write_text(const std::string& text) {
  if (output_broken()) return;
  if (behind) return behind->add(STDOUT_FILENO, text);
  const bool good = std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
  if (!good) broken_by = errno;
}

void print_line(const std::string& line) { write_text(text::one_line(line) + "\n"); }

void print_lines(const std::vector<std::string>& lines) {
  for (const auto& line : lines) print_line(line);
}

void print_text(const std::string& text) { write_text(text::printable(text) + "\n"); }

void print_error(const std::string& message) { print_errors(text::one_line(message)); }

namespace {

ErrorLines::Take error_lines;  // empty: standard error

// The lines are filtered already.
void write_errors(const std::string& lines) {
  if (!error_lines && behind) return behind->add(STDERR_FILENO, lines + "\n");
  if (!error_lines) {
    std::fflush(stdout);
    std::fprintf(stderr, "%s\n", lines.c_str());
    return;
  }
  std::istringstream each(lines);
  for (std::string line; std::getline(each, line);) error_lines(line);
}

}  // namespace

ErrorLines::ErrorLines(Take take) {
  if (::isatty(STDERR_FILENO) == 1) error_lines = std::move(take);
}

ErrorLines::~ErrorLines() { error_lines = {}; }

void print_progress(const std::string& line) { write_errors(text::one_line(line)); }

// A journal gets the level with each line (sd-daemon(3)).
void print_errors(const std::string& message) {
  static const bool journal = io::is_journal(STDERR_FILENO);
  const std::string lines = "berth: " + text::printable(message);
  if (!journal) return write_errors(lines);
  std::istringstream each(lines);
  std::string levelled;
  for (std::string line; std::getline(each, line);) levelled += (levelled.empty() ? "<3>" : "\n<3>") + line;
  write_errors(levelled);
}

namespace {

Colour chosen_colour = Colour::automatic;

bool is_set(const char* name) noexcept {
  const char* const value = std::getenv(name);
  return value != nullptr && *value != '\0';
}

}  // namespace

void choose_colour(Colour colour) noexcept { chosen_colour = colour; }

bool coloured() noexcept {
  if (chosen_colour != Colour::automatic) return chosen_colour == Colour::always;
  const char* const terminal = std::getenv("TERM");
  return on_terminal() && is_set("TERM") && std::strcmp(terminal, "dumb") != 0 && !is_set("NO_COLOR");
}

bool on_terminal() { return ::isatty(STDOUT_FILENO) == 1; }

}  // namespace berth::cli
