#include "berth/trace/asc.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "berth/can/length.hpp"
#include "berth/trace/calendar.hpp"

namespace berth::trace {
namespace {

constexpr std::string_view channel_comment = "// berth: channel ";
constexpr unsigned most_channels = 65'535;
// Flags of a CANFD row; CANoe writes such rows for classic frames, too.
constexpr std::uint32_t remote_flag = 1U << 4U;
constexpr std::uint32_t fd_flag = 1U << 12U;

bool is_direction(std::string_view word) noexcept { return word == "Rx" || word == "Tx"; }
bool same_letters(std::string_view text, std::string_view small) noexcept {
  return text.size() >= small.size() && std::equal(small.begin(), small.end(), text.begin(), [](char a, char b) {
           return a == (b >= 'A' && b <= 'Z' ? static_cast<char>(b + ('a' - 'A')) : b);
         });
}

}  // namespace

void AscReader::line(std::string_view line) {
  line_ = line;
  at_ = 0;
  if (head(line)) return;
  at_ = 0;
  if (event()) return;
  error(0, "this is neither an event nor a part of the head",
        "an event begins with its time in seconds: 0.001900 1  7E5  Rx   d 2 51 00");
}

bool AscReader::head(std::string_view line) {
  const std::size_t begin = line.find_first_not_of(" \t");
  if (begin == std::string_view::npos) return true;
  if (is_digit(line[begin]) || line[begin] == '-') return false;
  line.remove_prefix(begin);
  if (line.starts_with("//")) {
    comment(line);
    return true;
  }
  if (same_letters(line, "date")) {
    date(line.substr(4));
    return true;
  }
  if (same_letters(line, "base")) {
    decimal_ = line.find("dec") != std::string_view::npos;
    relative_ = line.find("relative") != std::string_view::npos;
    return true;
  }
  if (same_letters(line, "begin triggerblock")) {
    if (!dated_) date(line.substr(18));
    return true;
  }
  return same_letters(line, "end triggerblock") || same_letters(line, "internal events logged") ||
         same_letters(line, "no internal events logged") || line.starts_with('#') || line.starts_with("Comment:");
}

void AscReader::date(std::string_view text) {
  if (text.find_first_not_of(" \t") == std::string_view::npos) return;
  const auto time = parse_date(text);
  if (!time) {
    return tell(Finding::Severity::warning, 0, "this date is not understood: times count from the beginning of the log",
                "write it as in: date Fri Jul 10 06:17:32.249 2015");
  }
  dated_ = true;
  start_ = *time;
}

void AscReader::comment(std::string_view text) {
  if (!text.starts_with(channel_comment)) return;
  text.remove_prefix(channel_comment.size());
  const auto is = text.find(" is ");
  if (is == std::string_view::npos || names_.size() >= most_channels) return;
  const auto channel = number(text.substr(0, is), 10, most_channels);
  const auto name = text.substr(is + 4);
  if (channel && !name.empty()) names_.emplace_back(*channel, std::string(name));
}

std::string_view AscReader::word() {
  while (at_ < line_.size() && is_blank(line_[at_])) ++at_;
  const std::size_t begin = at_;
  while (at_ < line_.size() && !is_blank(line_[at_])) ++at_;
  return line_.substr(begin, at_ - begin);
}

void AscReader::wrong(std::string_view word, std::string message) {
  error(word.empty() ? line_.size() : static_cast<std::size_t>(word.data() - line_.data()), std::move(message));
}

std::optional<unsigned> AscReader::number(std::string_view word, unsigned base, unsigned most) const noexcept {
  unsigned value = 0;
  const auto [end, bad] = std::from_chars(word.data(), word.data() + word.size(), value, static_cast<int>(base));
  if (word.empty() || bad != std::errc{} || end != word.data() + word.size() || value > most) return std::nullopt;
  return value;
}

// "   0.001900": seconds and any number of digits after the point.
std::optional<rt::Duration> AscReader::time() {
  auto text = word();
  const bool minus = text.starts_with('-');
  if (minus) text.remove_prefix(1);
  const auto time = parse_seconds(text);
  if (!time) return std::nullopt;
  return minus ? -*time : *time;
}

bool AscReader::event() {
  const auto time = this->time();
  if (!time) return false;
  // `latest_` is never before 1970 nor beyond `most_seconds`, so that neither side overflows.
  const rt::Duration before = relative_ ? latest_ : rt::Duration(0);
  if (*time > std::chrono::seconds(most_seconds) - start_ - before || *time < -start_ - before) {
    wrong(line_, "added to the date, or to the times before it, this time lies outside of 1970 to 2255");
    return true;
  }
  latest_ = before + *time;
  entry_.at = start_ + latest_;
  const auto kind = word();
  if (kind == "CANFD") {
    flexible();
    return true;
  }
  const auto channel = number(kind, 10, most_channels);
  if (!channel || *channel == 0) {
    if (kind != "Start") ++others_;  // every log has "Start of measurement"
    return true;
  }
  classic(*channel);
  return true;
}

void AscReader::classic(unsigned channel) {
  const auto id = word();
  if (id == "ErrorFrame") return error_frame(channel);
  const std::size_t id_at = static_cast<std::size_t>(id.data() - line_.data());
  const auto way = word();
  if (!is_direction(way)) {
    ++others_;
    return;
  }
  if (!identifier(id, id_at)) return;
  can::Frame& frame = entry_.frame;
  entry_.error = false;
  entry_.direction = way == "Rx" ? Direction::received : Direction::sent;
  frame.fd = frame.brs = frame.esi = false;
  const auto kind = word();
  frame.remote = kind == "r" || kind == "R";
  if (!frame.remote && kind != "d" && kind != "D")
    return wrong(kind, "after the direction comes d (data) or r (remote)");
  const auto size = word();
  const auto dlc = number(size, 16, 15);
  if (frame.remote) {
    // Without a DLC it requests no bytes; what follows may be an appendix.
    frame.size = static_cast<std::uint8_t>(dlc ? std::min(*dlc, 8U) : 0U);
    return keep_on(channel);
  }
  if (!dlc) return wrong(size, "after d comes the DLC, one hex digit");
  frame.size = static_cast<std::uint8_t>(std::min(*dlc, 8U));
  if (data(size)) keep_on(channel);
}

// "CANFD  1 Rx  123  Name  1 0 8  8 01 ..": BRS, ESI, DLC, bytes, data. The name may be missing.
void AscReader::flexible() {
  const auto channel_word = word();
  const auto channel = number(channel_word, 10, most_channels);
  if (!channel || *channel == 0) {
    const bool event = !channel_word.empty() && !is_digit(channel_word.front());
    if (!event) return wrong(channel_word, "after CANFD comes the channel");
    if (channel_word != "Start") ++others_;
    return;
  }
  const auto way = word();
  if (way == "ErrorFrame") return error_frame(*channel);
  if (!is_direction(way)) {
    if (way != "TxRq") return wrong(way, "after the channel comes Rx or Tx");
    ++others_;
    return;
  }
  const auto id = word();
  if (id == "ErrorFrame") return error_frame(*channel);
  if (!identifier(id, static_cast<std::size_t>(id.data() - line_.data()))) return;
  auto flag = word();
  if (flag != "0" && flag != "1") flag = word();
  const auto state = word();
  if ((flag != "0" && flag != "1") || (state != "0" && state != "1"))
    return wrong(flag, "after the identifier come BRS and ESI, 0 or 1 each");
  const auto dlc_word = word();
  const auto dlc = number(dlc_word, 16, 15);
  const auto size_word = word();
  const auto size = number(size_word, 10, 64);
  if (!dlc || !size) return wrong(dlc ? size_word : dlc_word, "after ESI come the DLC and the number of data bytes");
  can::Frame& frame = entry_.frame;
  entry_.error = false;
  entry_.direction = way == "Rx" ? Direction::received : Direction::sent;
  frame.remote = false;
  frame.brs = flag == "1";
  frame.esi = state == "1";
  frame.fd = true;
  frame.size = static_cast<std::uint8_t>(*size);
  if (!data(size_word)) return;
  const auto flags = row_flags();
  const bool classic = flags && (*flags & fd_flag) == 0;
  if (classic) {
    frame.fd = frame.brs = frame.esi = false;
    frame.remote = (*flags & remote_flag) != 0;
    if (frame.remote) frame.size = static_cast<std::uint8_t>(std::min(*dlc, 8U));
  }
  const bool fits = frame.remote || (classic ? *size == std::min(*dlc, 8U) : can::fd_dlc(*size) == std::min(*dlc, 15U));
  if (!fits) return wrong(dlc_word, fmt::format("a frame of {} data bytes does not have DLC {}", *size, dlc_word));
  keep_on(*channel);
}

// What follows the data of a CANFD row: its duration, its bits, and flags in hex. Empty: the row is shorter.
std::optional<std::uint32_t> AscReader::row_flags() {
  static_cast<void>(word());
  static_cast<void>(word());
  const auto text = word();
  return number(text, 16, 0xFFFF'FFFF);
}

void AscReader::error_frame(unsigned channel) {
  entry_.error = true;
  entry_.direction = Direction::unknown;
  entry_.frame = can::Frame();
  entry_.frame.size = 8;
  keep_on(channel);
}

bool AscReader::identifier(std::string_view word, std::size_t column) {
  auto digits = word;
  const bool extended = digits.ends_with('x') || digits.ends_with('X');
  if (extended) digits.remove_suffix(1);
  const auto id = number(digits, decimal_ ? 10 : 16, can::extended_mask);
  if (!id || (!extended && *id > can::base_mask)) {
    error(column,
          id ? "a base identifier is at most 7FF; an extended one has x after it" : "this is not an identifier of CAN");
    return false;
  }
  entry_.frame.id = *id;
  entry_.frame.extended = extended;
  return true;
}

bool AscReader::data(std::string_view last) {
  can::Frame& frame = entry_.frame;
  for (unsigned i = 0; i < frame.size; ++i) {
    if (!decimal_ && at_ + 3 <= line_.size() && line_[at_] == ' ' && is_hex(line_[at_ + 1]) && is_hex(line_[at_ + 2]) &&
        (at_ + 3 == line_.size() || is_blank(line_[at_ + 3]))) [[likely]] {
      frame.data[i] = static_cast<std::uint8_t>(hex_value(line_[at_ + 1]) << 4 | hex_value(line_[at_ + 2]));
      at_ += 3;
      continue;
    }
    const auto text = word();
    const auto byte = number(text, decimal_ ? 10 : 16, 255);
    if (!byte) {
      wrong(text, fmt::format("data byte {} of {} is missing or no byte", i + 1, last));
      return false;
    }
    frame.data[i] = static_cast<std::uint8_t>(*byte);
  }
  return true;
}

void AscReader::keep_on(unsigned channel) {
  auto known = std::find_if(channels_.begin(), channels_.end(), [&](const auto& c) { return c.first == channel; });
  if (known == channels_.end()) {
    const auto named = std::find_if(names_.begin(), names_.end(), [&](const auto& n) { return n.first == channel; });
    const auto number = bus(named != names_.end() ? named->second : fmt::format("can{}", channel - 1));
    if (!number) return;
    channels_.emplace_back(channel, *number);
    known = channels_.end() - 1;
  }
  entry_.bus = known->second;
  keep(entry_);
}

void AscReader::over() {
  if (others_ > 0) {
    tell_of_file(Finding::Severity::note,
                 fmt::format("{} events that are not frames (statistics, states and the like) are left out", others_));
  }
}

void AscWriter::begin(rt::Duration first, std::string& out) {
  if (begun_) return;
  begun_ = true;
  start_ = std::max(std::chrono::floor<std::chrono::milliseconds>(first), std::chrono::milliseconds(0));
  const std::string date = write_date(start_);
  out += fmt::format(
      "date {0}\nbase hex  timestamps absolute\nno internal events logged\n// version 9.0.0\n// written by berth, "
      "times are UTC\nBegin Triggerblock {0}\n   0.000000 Start of measurement\n",
      date);
}

namespace {

// The identifier, as wide as the column.
char* put_asc_id(char* to, const can::Frame& frame) {
  char* const id = to;
  if (frame.extended) {
    unsigned digits = 1;
    while (digits < 8 && frame.id >> (4 * digits) != 0) ++digits;
    to = put_hex(to, frame.id, digits);
    *to++ = 'x';
  } else {
    to = put_hex(to, frame.id, frame.id > 0xFF ? 3 : frame.id > 0xF ? 2 : 1);
  }
  while (to - id < (frame.fd ? 36 : 15)) *to++ = ' ';
  return to;
}

// Writes what follows the identifier: kind, length, data, and the flags of an FD frame.
char* put_rest(char* to, const Entry& entry) {
  const can::Frame& frame = entry.frame;
  if (frame.fd) {
    to = put_text(to, frame.brs ? " 1" : " 0");
    to = put_text(to, frame.esi ? " 1 " : " 0 ");
    *to++ = "0123456789abcdef"[can::fd_dlc(frame.size).value_or(15) & 15U];
    to = put_number(to, frame.size, 3);
  } else {
    to = put_text(to, entry.direction == Direction::sent ? " Tx   " : " Rx   ");
    to = put_text(to, frame.remote ? "r " : "d ");
    *to++ = static_cast<char>('0' + frame.size);
  }
  if (!frame.remote) {
    for (unsigned i = 0; i < frame.size; ++i) {
      *to++ = ' ';
      to = put_byte(to, frame.data[i]);
    }
  }
  if (frame.fd) {
    to = put_text(to, "        0    0 ");
    const unsigned flags = 0x1000U | (frame.brs ? 0x2000U : 0U) | (frame.esi ? 0x4000U : 0U);
    to = put_text(to, "    ");
    to = put_hex(to, flags, 4);
    to = put_text(to, "        0        0        0        0        0");
  }
  return to;
}

}  // namespace

void AscWriter::write(const Entry& entry, std::string_view bus, std::string& out) {
  begin(entry.at, out);
  if (names_.add(entry.bus, bus) && names_.of(entry.bus) != fmt::format("can{}", names_.number(entry.bus) - 1))
    out += fmt::format("{}{} is {}\n", channel_comment, names_.number(entry.bus), names_.of(entry.bus));
  const std::int64_t nanos = (entry.at - start_).count();
  if (nanos % 1000 != 0) lose(Loss::time);
  const auto micros = static_cast<std::uint64_t>((std::abs(nanos) + 500) / 1000);
  const unsigned channel = names_.number(entry.bus);
  std::array<char, 512> line;
  char* to = line.data();
  if (nanos < 0) *to++ = '-';
  to = put_number(to, micros / 1'000'000, nanos < 0 ? 1 : 4);
  *to++ = '.';
  to = put_decimal(to, micros % 1'000'000, 6);
  *to++ = ' ';
  if (entry.frame.fd) {
    to = put_text(to, "CANFD ");
    to = put_number(to, channel, 3);
    to = put_text(to, entry.direction == Direction::sent ? " Tx " : " Rx ");
  } else {
    to = put_number(to, channel, 1);
    to = put_text(to, "  ");
  }
  if (entry.error) {
    lose(Loss::error_detail);
    to = put_text(to, "ErrorFrame\n");
  } else {
    if (entry.direction == Direction::unknown) lose(Loss::direction);
    to = put_asc_id(to, entry.frame);
    to = put_rest(to, entry);
    *to++ = '\n';
  }
  out.append(line.data(), static_cast<std::size_t>(to - line.data()));
}

void AscWriter::finish(std::string& out) {
  begin(rt::Duration(0), out);
  out += "End TriggerBlock\n";
}

}  // namespace berth::trace
