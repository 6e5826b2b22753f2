#include "berth/trace/candump.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>

namespace berth::trace {
namespace {

// Seconds beyond this do not fit into nanoseconds of 64 bits.
constexpr std::int64_t most_seconds = 9'000'000'000;
constexpr std::size_t most_buses = 65'536;

constexpr bool is_digit(char c) noexcept { return c >= '0' && c <= '9'; }
constexpr bool is_blank(char c) noexcept { return c == ' ' || c == '\t'; }

class Reader {
 public:
  Reader(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  Reading read() {
    std::size_t at = 0;
    while (at < text_.size()) {
      const auto end = std::min(text_.find('\n', at), text_.size());
      line_ = text_.substr(at, end - at);
      if (line_.ends_with('\r')) line_.remove_suffix(1);
      ++number_;
      at = end + 1;
      column_ = 0;
      if (!line_.empty()) one();
    }
    if (left_out_ > 0) {
      reading_.findings.push_back({worst_, file_, 0, 0, {}, fmt::format("{} more findings", left_out_), {}});
    }
    return std::move(reading_);
  }

 private:
  void tell(Finding::Severity severity, std::size_t column, std::string message, std::string fix = {}) {
    if (reading_.findings.size() >= most_findings) {
      ++left_out_;
      worst_ = std::max(worst_, severity);
      return;
    }
    reading_.findings.push_back(
        {severity, file_, number_, static_cast<int>(column) + 1, {}, std::move(message), std::move(fix)});
  }
  void error(std::size_t column, std::string message, std::string fix = {}) {
    tell(Finding::Severity::error, column, std::move(message), std::move(fix));
  }

  void one() {
    const auto at = time();
    if (!at) return;
    const auto bus = word("the name of the bus");
    if (!bus) return;
    const std::size_t frame_column = column_;
    const auto text = word("the frame");
    if (!text) return;
    if (!tail()) return;
    if (is_error_frame(*text)) {
      tell(Finding::Severity::warning, frame_column, "an error frame of SocketCAN: it is left out");
      return;
    }
    const auto frame = can::parse_frame(*text);
    if (!frame) {
      const auto [column, message] = why(*text);
      return error(frame_column + column, message, "candump writes 7E5#0401000000000000, 1F900135#, 701#R or 123##1AA");
    }
    keep(*at, *bus, *frame);
  }

  // "(1436509052.249713) "
  std::optional<rt::Duration> time() {
    const auto wrong = [&](std::size_t column, const char* message) -> std::optional<rt::Duration> {
      error(column, message, "write (SECONDS.MICROSECONDS), six digits behind the point, and one blank");
      return std::nullopt;
    };
    if (line_.front() != '(') return wrong(0, "the line does not begin with its time");
    std::int64_t seconds = 0;
    const char* const first = line_.data() + 1;
    const char* const last = line_.data() + line_.size();
    if (first == last || !is_digit(*first)) return wrong(1, "the seconds are missing");
    const auto [point, bad] = std::from_chars(first, last, seconds);
    if (bad != std::errc{} || seconds > most_seconds) return wrong(1, "so many seconds cannot be");
    std::size_t at = static_cast<std::size_t>(point - line_.data());
    if (at >= line_.size() || line_[at] != '.') return wrong(at, "there is no point behind the seconds");
    std::int64_t micros = 0;
    for (int i = 0; i < 6; ++i) {
      if (++at >= line_.size() || !is_digit(line_[at])) return wrong(at, "microseconds have six digits");
      micros = micros * 10 + (line_[at] - '0');
    }
    if (++at >= line_.size() || line_[at] != ')') return wrong(at, "the time does not end with )");
    if (++at >= line_.size() || line_[at] != ' ') return wrong(at, "there is no blank behind the time");
    column_ = at + 1;
    return std::chrono::seconds(seconds) + std::chrono::microseconds(micros);
  }

  // Up to a blank or the end of the line; one blank behind it is passed.
  std::optional<std::string_view> word(const char* what) {
    std::size_t end = column_;
    while (end < line_.size() && !is_blank(line_[end])) ++end;
    if (end == column_) {
      error(column_, fmt::format("{} is missing", what), "write (TIME) BUS FRAME with one blank between");
      return std::nullopt;
    }
    const auto found = line_.substr(column_, end - column_);
    column_ = end < line_.size() && line_[end] == ' ' ? end + 1 : end;
    return found;
  }

  bool tail() {
    const auto rest = line_.substr(column_);
    if (rest.empty() || rest == "R" || rest == "T") return true;
    error(column_, "there is something behind the frame", "one frame a line");
    return false;
  }

  static bool is_error_frame(std::string_view text) noexcept {
    std::uint32_t id = 0;
    const auto hash = text.find('#');
    if (hash != 8) return false;
    const auto [end, bad] = std::from_chars(text.data(), text.data() + 8, id, 16);
    return bad == std::errc{} && end == text.data() + 8 && (id & 0xE000'0000U) == 0x2000'0000U;
  }

  // Where a frame that cannot be read goes wrong.
  static std::pair<std::size_t, std::string> why(std::string_view text) {
    const auto hash = text.find('#');
    if (hash == std::string_view::npos) return {text.size(), "a frame has # behind its identifier"};
    const auto is_hex = [](char c) { return is_digit(c) || (c >= 'A' && c <= 'F') || (c >= 'a' && c <= 'f'); };
    for (std::size_t i = 0; i < hash; ++i) {
      if (!is_hex(text[i])) return {i, "this is no hex digit of an identifier"};
    }
    if (hash == 0 || hash > 8) return {0, "an identifier has one to three hex digits, or up to eight"};
    std::uint32_t id = 0;
    std::from_chars(text.data(), text.data() + hash, id, 16);
    if (id > (hash > 3 ? can::extended_mask : can::base_mask))
      return {0, hash > 3 ? "an extended identifier is at most 1FFFFFFF" : "a base identifier is at most 7FF"};
    std::size_t at = hash + 1;
    if (at < text.size() && text[at] == 'R') return {at + 1, "behind R stands the DLC, one digit from 0 to 8"};
    const bool fd = at < text.size() && text[at] == '#';
    if (fd) {
      ++at;
      if (at >= text.size() || !is_hex(text[at])) return {at, "behind ## stands one hex digit with the FD flags"};
      ++at;
    }
    for (std::size_t i = at; i < text.size(); ++i) {
      if (!is_hex(text[i])) return {i, "this is no hex digit of the data"};
    }
    if ((text.size() - at) % 2 != 0) return {text.size(), "the last data byte has one digit"};
    if (fd) return {at, "an FD frame has 0 to 8, 12, 16, 20, 24, 32, 48 or 64 data bytes"};
    return {at, "a classic frame has at most 8 data bytes"};
  }

  void keep(rt::Duration at, std::string_view name, const can::Frame& frame) {
    auto& trace = reading_.trace;
    const bool known = std::ranges::find(trace.buses, name) != trace.buses.end();
    if (!known && trace.buses.size() >= most_buses) return error(0, "a trace has at most 65,536 buses");
    const auto bus = trace.bus(name);
    if (!known) latest_.push_back(at);
    if (at < latest_[bus]) {
      tell(Finding::Severity::warning, 0,
           "earlier than the line before of this bus: the clock was set back, or two logs were joined");
    }
    latest_[bus] = at;
    trace.entries.push_back({at, bus, frame});
  }

  std::string_view text_;
  const std::string& file_;
  Reading reading_;
  std::vector<rt::Duration> latest_;  // by bus
  std::string_view line_;
  std::size_t column_ = 0;
  std::size_t left_out_ = 0;
  Finding::Severity worst_ = Finding::Severity::note;
  int number_ = 0;
};

}  // namespace

Reading read_candump(std::string_view text, const std::string& file_name) { return Reader(text, file_name).read(); }

std::string candump_line(rt::Duration at, std::string_view bus, std::string_view frame) {
  const std::int64_t micros = (at.count() + 500) / 1000;
  return fmt::format("({:010}.{:06}) {} {}", micros / 1'000'000, micros % 1'000'000, bus, frame);
}

std::string candump_line(rt::Duration at, std::string_view bus, const can::Frame& frame) {
  return candump_line(at, bus, can::to_string(frame));
}

std::string write_candump(const Trace& trace) {
  std::string text;
  for (const Entry& entry : trace.entries) text += candump_line(entry.at, trace.buses[entry.bus], entry.frame) + '\n';
  return text;
}

}  // namespace berth::trace
