#include "trace_outlet.hpp"
#include "outputs.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <iterator>
#include <nlohmann/json.hpp>

#include "berth/study/words.hpp"
#include "berth/text/printable.hpp"

namespace berth::cli {

Outlet::~Outlet() {
  if (fd_ > STDOUT_FILENO) ::close(fd_);
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

std::optional<Failure> Outlet::open(const std::string& path, bool grows, bool force) {
  path_ = path;
  screen_ = false;
  if (path == "-") return std::nullopt;
  if (auto bad = may_write(path, "--output", force)) return bad;
  struct stat what {};
  // Only a regular file can be replaced, not a pipe or a terminal.
  const bool plain = ::stat(path.c_str(), &what) != 0 || S_ISREG(what.st_mode);
  if (!grows && plain) temporary_ = fmt::format("{}.{}.part", path, ::getpid());
  const std::string& name = temporary_.empty() ? path : temporary_;
  fd_ = ::open(name.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (fd_ >= 0) return std::nullopt;
  error_ = errno;
  temporary_.clear();
  return failed();
}

Failure Outlet::failed() const {
  return failure(Exit::failed, fmt::format("{}: {}", path_.empty() || path_ == "-" ? "standard output" : path_,
                                           std::strerror(error_)));
}

bool Outlet::left() const noexcept { return error_ == EPIPE; }

void Outlet::flush() {
  const bool shown = screen_ || (fd_ == STDOUT_FILENO && ::isatty(fd_) == 1);
  if (filters_ && shown) buffer_ = text::printable(buffer_);
  std::string_view rest(buffer_);
  while (!rest.empty() && error_ == 0) {
    const auto wrote = ::write(fd_, rest.data(), rest.size());
    if (wrote >= 0) {
      rest.remove_prefix(static_cast<std::size_t>(wrote));
    } else if (errno == EAGAIN) {
      pollfd ready{fd_, POLLOUT, 0};
      ::poll(&ready, 1, -1);
    } else if (errno != EINTR) {
      error_ = errno;
    }
  }
  buffer_.clear();
}

std::optional<Failure> Outlet::done() {
  flush();
  if (error_ == 0 && !temporary_.empty()) {
    if (::fsync(fd_) != 0 || ::rename(temporary_.c_str(), path_.c_str()) != 0) {
      error_ = errno;
    } else {
      temporary_.clear();
    }
  }
  if (error_ == 0) return std::nullopt;
  return failed();
}

void put_json(std::string& out, std::string_view text) {
  const bool plain =
      std::all_of(text.begin(), text.end(), [](char c) { return c >= ' ' && c < 0x7F && c != '"' && c != '\\'; });
  if (plain) {
    out += '"';
    out += text;
    out += '"';
    return;
  }
  out += nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

void put_seconds(std::string& out, rt::Duration time) {
  const auto nanos = time.count();
  const auto size = nanos < 0 ? -nanos : nanos;
  if (nanos < 0) out += '-';
  if (size % 1000 == 0) {
    fmt::format_to(std::back_inserter(out), "{}.{:06}", size / 1'000'000'000, size / 1000 % 1'000'000);
  } else {
    fmt::format_to(std::back_inserter(out), "{}.{:09}", size / 1'000'000'000, size % 1'000'000'000);
  }
}

void put_json(std::string& out, const Finding& finding) {
  constexpr const char* kinds[]{"note", "warning", "error"};
  fmt::format_to(std::back_inserter(out), "{{\"severity\":\"{}\",\"file\":", kinds[static_cast<int>(finding.severity)]);
  put_json(out, finding.file);
  fmt::format_to(std::back_inserter(out), ",\"line\":{},\"column\":{},\"message\":", finding.line, finding.column);
  put_json(out, finding.key.empty() ? finding.message : finding.key + ": " + finding.message);
  out += '}';
}

namespace {

// The words have names of objects and devices in them, which may contain a line feed. `flush` filters other control
// characters, but cannot distinguish that line feed from a row's own.
void put_line(std::string& out, std::string_view words) {
  if (words.find('\n') == std::string_view::npos) {
    out += words;
  } else {
    out += text::one_line(words);
  }
}

}  // namespace

void RowText::words(std::string& out, const decode::Row& row, const std::string& bus, const std::string& path) {
  constexpr std::size_t width = 60;
  const std::size_t begin = out.size();
  writer_.write(*row.entry, bus, out);
  out.pop_back();  // the line end
  const std::size_t used = out.size() - begin;
  out.append(used < width ? width - used : 2, ' ');
  put_line(out, row.words);
  if (!path.empty()) out += "  (" + path + ")";
  if (row.frames > 1)
    fmt::format_to(std::back_inserter(out), "  [{} frames, {:.3f} ms]", row.frames,
                   std::chrono::duration<double, std::milli>(row.entry->at - row.began).count());
  out += '\n';
}

void RowText::brief(std::string& out, const decode::Row& row, const std::string& bus, const std::string& path,
                    const BriefStyle& style) {
  std::string words(row.words);
  if (!path.empty()) words += "  (" + path + ")";
  out += brief_line(row.entry->at, bus, can::to_string(row.entry->frame), words, style) + "\n";
}

void RowText::json(std::string& out, const decode::Row& row, const std::string& bus, const std::string& path) {
  out += "{\"at_s\":";
  put_seconds(out, row.entry->at);
  out += ",\"bus\":";
  put_json(out, bus);
  line_.clear();
  writer_.write(*row.entry, bus, line_);
  line_.pop_back();
  // "(time) bus frame R": the text after the second space, without the direction.
  auto frame = std::string_view(line_).substr(line_.find(' ', line_.find(' ') + 1) + 1);
  frame = frame.substr(0, frame.find(' '));
  out += ",\"frame\":";
  put_json(out, frame);
  if (row.entry->direction != trace::Direction::unknown)
    out += row.entry->direction == trace::Direction::sent ? ",\"direction\":\"sent\"" : ",\"direction\":\"received\"";
  out += ",\"words\":";
  put_json(out, row.words);
  fmt::format_to(std::back_inserter(out), ",\"service\":\"{}\"", decode::name(row.meaning.service));
  if (row.meaning.node != 0) fmt::format_to(std::back_inserter(out), ",\"node\":{}", row.meaning.node);
  if (!path.empty()) fmt::format_to(std::back_inserter(out), ",\"path\":\"{}\"", path);
  if (row.frames > 1) {
    fmt::format_to(std::back_inserter(out), ",\"frames\":{},\"began_s\":", row.frames);
    put_seconds(out, row.began);
  }
  bool signals = false;
  for (const auto& field : row.fields) {
    const bool signal = field.kind == decode::Field::Kind::signal;
    if (signal != signals) out += signal ? ",\"signals\":{" : "}";
    if (!signal || signals) out += ',';
    signals = signal;
    put_json(out, field.key);
    out += ':';
    if (field.kind == decode::Field::Kind::number) {
      out += field.value;
    } else {
      put_json(out, field.value);
    }
  }
  out += signals ? "}}\n" : "}\n";
}

void RowText::table(std::string& out, const decode::Row& row) {
  out += study::id_text(row.entry->frame) + "\t";
  put_line(out, row.words);
  out += "\t" + study::raw(row.entry->frame) + "\n";
}

}  // namespace berth::cli
