#include "berth/trace/candump.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <utility>

#include "berth/trace/calendar.hpp"
#include "berth/trace/candump_plain.hpp"

namespace berth::trace {
namespace {

bool is_error_frame(std::string_view text) noexcept {
  if (text.find('#') != 8) return false;
  std::uint32_t id = 0;
  const auto [end, bad] = std::from_chars(text.data(), text.data() + 8, id, 16);
  return bad == std::errc{} && end == text.data() + 8 && (id & 0xE000'0000U) == 0x2000'0000U;
}

// "_F" after eight bytes, or after "R8".
bool has_raw_dlc(std::string_view text) noexcept {
  if (text.size() < 4 || text[text.size() - 2] != '_' || !is_hex(text.back()) || hex_value(text.back()) <= 8)
    return false;
  const auto frame = can::parse_frame(text.substr(0, text.size() - 2));
  return frame && !frame->fd && frame->size == 8;
}

// Where a frame that cannot be read is wrong, and why.
std::pair<std::size_t, std::string> why(std::string_view text) {
  const auto hash = text.find('#');
  if (hash == std::string_view::npos) return {text.size(), "a frame has # after its identifier"};
  for (std::size_t i = 0; i < hash; ++i) {
    if (!is_hex(text[i])) return {i, "this is not a hex digit of an identifier"};
  }
  if (hash == 0 || hash > 8) return {0, "an identifier has one to three hex digits, or up to eight"};
  std::uint32_t id = 0;
  std::from_chars(text.data(), text.data() + hash, id, 16);
  if (id > (hash > 3 ? can::extended_mask : can::base_mask))
    return {0, hash > 3 ? "an extended identifier is at most 1FFFFFFF" : "a base identifier is at most 7FF"};
  std::size_t at = hash + 1;
  if (at < text.size() && text[at] == 'R') return {at + 1, "after R comes the DLC, one digit from 0 to 8"};
  const bool fd = at < text.size() && text[at] == '#';
  if (fd) {
    ++at;
    if (at >= text.size() || !is_hex(text[at])) return {at, "after ## comes one hex digit with the FD flags"};
    ++at;
  }
  for (std::size_t i = at; i < text.size(); ++i) {
    if (!is_hex(text[i])) return {i, "this is not a hex digit of the data"};
  }
  if ((text.size() - at) % 2 != 0) return {text.size(), "the last data byte has one digit"};
  if (fd) return {at, "an FD frame has 0 to 8, 12, 16, 20, 24, 32, 48 or 64 data bytes"};
  return {at, "a classic frame has at most 8 data bytes"};
}

// Keeps a whole log, and the first findings.
class Collector final : public Sink {
 public:
  explicit Collector(const std::string& file) : file_(file) {}
  void entry(const Entry& entry) override { reading_.trace.entries.push_back(entry); }
  void finding(Finding finding) override {
    if (finding.severity == Finding::Severity::note) return;
    if (reading_.findings.size() < most_findings) return reading_.findings.push_back(std::move(finding));
    ++left_out_;
    worst_ = std::max(worst_, finding.severity);
  }
  Reading done(const Reader& reader) {
    reading_.trace.buses = reader.buses();
    if (left_out_ > 0)
      reading_.findings.push_back({worst_, file_, 0, 0, {}, fmt::format("{} more findings", left_out_), {}});
    return std::move(reading_);
  }

 private:
  const std::string& file_;
  Reading reading_;
  std::size_t left_out_ = 0;
  Finding::Severity worst_ = Finding::Severity::note;
};

}  // namespace

DeltaTimes::Turn DeltaTimes::add(Entry& entry) {
  constexpr auto from_zero = std::chrono::hours(1);  // no computer's clock shows such a time
  if (kind_ == Kind::times) return Turn::as_it_is;
  if (kind_ == Kind::deltas) {
    entry.at = sum_ += entry.at;
    return Turn::as_it_is;
  }
  const bool falls = !held_.empty() && entry.at < held_.back().at;
  if (falls) {
    kind_ = Kind::deltas;
  } else if (entry.at >= from_zero || held_.size() == enough) {
    kind_ = Kind::times;
  }
  held_.push_back(entry);
  return kind_ == Kind::open ? Turn::held : Turn::decided;
}

std::vector<Entry> DeltaTimes::take() {
  if (kind_ == Kind::deltas) {
    for (Entry& entry : held_) entry.at = sum_ += entry.at;
  }
  return std::exchange(held_, {});
}

void CandumpReader::keep_timed() {
  const auto turn = deltas_.add(entry_);
  if (turn == DeltaTimes::Turn::as_it_is) return keep(entry_);
  if (turn != DeltaTimes::Turn::decided) return;
  if (deltas_.deltas()) {
    tell(Finding::Severity::warning, 0,
         "times near 0 that decrease are differences between two lines (candump -td): they are added up from the first "
         "line on");
  }
  give_held();
}

void CandumpReader::give_held() {
  for (const Entry& entry : deltas_.take()) keep(entry);
}

void CandumpReader::line(std::string_view line) {
  const bool words = std::exchange(words_follow_, false) && line.front() == '\t';
  if (words) {
    words_follow_ = true;
    return;
  }
  if (quick(line) || for_people(line)) return;
  line_ = line;
  column_ = 0;
  careful();
}

// The length of the bus's name and the blank after it; 0: `careful` must look at it.
std::size_t CandumpReader::quick_name(std::string_view text) {
  if (!last_name_.empty() && text.size() > last_name_.size() && text[last_name_.size()] == ' ' &&
      std::memcmp(text.data(), last_name_.data(), last_name_.size()) == 0)
    return last_name_.size() + 1;
  const auto name = text.substr(0, text.find_first_of(" \t"));
  // A name is only taken from a completely correct line.
  const auto known = name.empty() ? std::nullopt : known_bus(name);
  if (!known || name.size() == text.size() || text[name.size()] != ' ') return 0;
  last_name_ = name;
  last_bus_ = *known;
  return name.size() + 1;
}

// Fast path for usual lines. False: `careful` must read the line; it knows everything and reports errors.
bool CandumpReader::quick(std::string_view line) {
  const char* at = line.data();
  const char* const end = at + line.size();
  if (line.size() < 24 || *at++ != '(') return false;
  std::int64_t seconds = 0;
  const char* const digits = at;
  while (is_digit(*at) && at - digits < 11) seconds = seconds * 10 + (*at++ - '0');
  if (at == digits || end - at < 12 || *at != '.' || seconds > most_seconds) return false;
  ++at;
  std::int64_t micros = 0;
  for (int i = 0; i < 6; ++i, ++at) {
    if (!is_digit(*at)) return false;
    micros = micros * 10 + (*at - '0');
  }
  if (*at != ')' || at[1] != ' ') return false;
  at += 2;
  const std::size_t name = quick_name(std::string_view(at, static_cast<std::size_t>(end - at)));
  if (name == 0) return false;
  at += name;
  std::uint32_t id = 0;
  const char* const first = at;
  for (; at < end; ++at) {
    const std::uint8_t value = hex_value(*at);
    if (value == 0xFF) break;
    id = id << 4 | value;
  }
  const auto width = at - first;
  if (at == end || *at != '#' || (width != 3 && width != 8) || id > (width == 3 ? can::base_mask : can::extended_mask))
    return false;
  ++at;
  can::Frame& frame = entry_.frame;
  std::uint8_t size = 0;
  for (; end - at >= 2; at += 2) {
    const unsigned byte = static_cast<unsigned>(hex_value(at[0])) << 4 | hex_value(at[1]);
    if (hex_value(at[0]) == 0xFF || hex_value(at[1]) == 0xFF) break;
    if (size == 8) return false;
    frame.data[size++] = static_cast<std::uint8_t>(byte);
  }
  entry_.direction = Direction::unknown;
  if (at != end) {
    if (end - at != 2 || at[0] != ' ' || (at[1] != 'R' && at[1] != 'T')) return false;
    entry_.direction = at[1] == 'R' ? Direction::received : Direction::sent;
  }
  entry_.at = std::chrono::seconds(seconds) + std::chrono::microseconds(micros);
  entry_.bus = last_bus_;
  entry_.error = false;
  frame.id = id;
  frame.extended = width == 8;
  frame.remote = frame.fd = frame.brs = frame.esi = false;
  frame.size = size;
  keep(entry_);
  return true;
}

// A line of candump without -L.
bool CandumpReader::for_people(std::string_view text) {
  const auto plain = parse_plain_candump(text);
  if (!plain) return false;
  if (plain->error && !error_frames_) {
    tell(Finding::Severity::warning, 0, "an error frame of SocketCAN: it is left out");
    words_follow_ = true;
    return true;
  }
  const auto number = bus(plain->bus);
  if (!number) return true;
  entry_.at = plain->at;
  entry_.bus = *number;
  entry_.frame = plain->frame;
  entry_.direction = plain->direction;
  entry_.error = plain->error;
  words_follow_ = plain->error;
  if (plain->timed) {
    keep_timed();
  } else {
    keep(entry_);
  }
  return true;
}

void CandumpReader::careful() {
  const auto at = time();
  if (!at) return;
  const auto name = word("the name of the bus");
  if (!name) return;
  const std::size_t frame_column = column_;
  const auto text = word("the frame");
  if (!text || !tail()) return;
  entry_.at = *at;
  const bool is_error = is_error_frame(*text);
  if (is_error && !error_frames_)
    return tell(Finding::Severity::warning, frame_column, "an error frame of SocketCAN: it is left out");
  // The rest of an error frame's identifier is read as an extended one, by the same code.
  std::string plain(*text);
  if (has_raw_dlc(plain)) plain.resize(plain.size() - 2);
  if (is_error) plain[0] = plain[0] == '3' ? '1' : '0';
  auto frame = can::parse_frame(plain);
  if (!frame || (is_error && (frame->fd || frame->remote))) {
    const auto [column, message] = why(plain);
    return error(frame_column + column, message, "candump writes 7E5#0401000000000000, 1F900135#, 701#R or 123##1AA");
  }
  if (is_error) frame->extended = false;
  const auto number = bus(*name);
  if (!number) return;
  entry_.bus = *number;
  entry_.frame = *frame;
  entry_.error = is_error;
  keep(entry_);
}

// "(1436509052.249713) "
std::optional<rt::Duration> CandumpReader::time() {
  const auto wrong = [&](std::size_t column, const char* message) -> std::optional<rt::Duration> {
    error(column, message, "write (SECONDS.MICROSECONDS) and a blank");
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
  if (at >= line_.size() || line_[at] != '.') return wrong(at, "there is no point after the seconds");
  if (++at >= line_.size() || !is_digit(line_[at])) return wrong(at, "digits are missing after the point");
  while (at < line_.size() && is_digit(line_[at])) ++at;
  const auto time = parse_seconds(line_.substr(1, at - 1));
  if (!time) return wrong(1, "so many seconds cannot be");
  if (at >= line_.size() || line_[at] != ')') return wrong(at, "the time does not end with )");
  if (++at >= line_.size() || line_[at] != ' ') return wrong(at, "there is no blank after the time");
  column_ = at;
  skip_blanks();
  return *time;
}

void CandumpReader::skip_blanks() {
  while (column_ < line_.size() && is_blank(line_[column_])) ++column_;
}

// Reads up to a blank or the end of the line, and passes the blanks after it.
std::optional<std::string_view> CandumpReader::word(const char* what) {
  std::size_t end = column_;
  while (end < line_.size() && !is_blank(line_[end])) ++end;
  if (end == column_) {
    error(column_, fmt::format("{} is missing", what), "write (TIME) BUS FRAME with one blank between");
    return std::nullopt;
  }
  const auto found = line_.substr(column_, end - column_);
  column_ = end;
  skip_blanks();
  return found;
}

bool CandumpReader::tail() {
  auto rest = line_.substr(column_);
  while (!rest.empty() && is_blank(rest.back())) rest.remove_suffix(1);
  entry_.direction = rest == "R" ? Direction::received : rest == "T" ? Direction::sent : Direction::unknown;
  if (rest.empty() || entry_.direction != Direction::unknown) return true;
  error(column_, "there is text after the frame", "one frame a line");
  return false;
}

void CandumpWriter::write(const Entry& entry, std::string_view bus, std::string& out) {
  names_.add(entry.bus, bus);
  const std::int64_t nanos = entry.at.count();
  if (nanos < 0) lose(Loss::time_before_zero);
  if (nanos % 1000 != 0) lose(Loss::time);
  const std::int64_t micros = nanos < 0 ? 0 : (nanos + 500) / 1000;
  const std::int64_t seconds = micros / 1'000'000;
  if (seconds != seconds_) {
    seconds_ = seconds;
    put_decimal(digits_.data(), static_cast<std::uint64_t>(seconds), 10);
  }
  std::array<char, 160> line;  // 64 bytes of FD at most
  char* to = line.data();
  *to++ = '(';
  to = put_text(to, {digits_.data(), digits_.size()});
  *to++ = '.';
  to = put_decimal(to, static_cast<std::uint64_t>(micros % 1'000'000), 6);
  to = put_text(to, ") ");
  out.append(line.data(), static_cast<std::size_t>(to - line.data()));
  out += names_.of(entry.bus);
  to = line.data();
  *to++ = ' ';
  const can::Frame& frame = entry.frame;
  if (entry.error) {
    to = put_hex(to, frame.id | 0x2000'0000U, 8);
  } else {
    to = put_hex(to, frame.id, frame.extended ? 8 : 3);
  }
  *to++ = '#';
  if (frame.remote) {
    *to++ = 'R';
    if (frame.size > 0) *to++ = static_cast<char>('0' + frame.size);
  } else {
    if (frame.fd) {
      *to++ = '#';
      *to++ = static_cast<char>('0' + ((frame.brs ? 1 : 0) | (frame.esi ? 2 : 0)));
    }
    for (unsigned i = 0; i < frame.size; ++i) to = put_byte(to, frame.data[i]);
  }
  if (directions_ && entry.direction != Direction::unknown)
    to = put_text(to, entry.direction == Direction::sent ? " T" : " R");
  *to++ = '\n';
  out.append(line.data(), static_cast<std::size_t>(to - line.data()));
}

Reading read_candump(std::string_view text, const std::string& file_name) {
  CandumpReader reader(file_name, false);
  Collector collector(file_name);
  reader.feed(text, collector);
  reader.finish(collector);
  return collector.done(reader);
}

std::string candump_line(rt::Duration at, std::string_view bus, std::string_view frame) {
  const std::int64_t micros = (at.count() + 500) / 1000;
  return fmt::format("({:010}.{:06}) {} {}", micros / 1'000'000, micros % 1'000'000, bus, frame);
}

std::string candump_line(rt::Duration at, std::string_view bus, const can::Frame& frame) {
  return candump_line(at, bus, can::to_string(frame));
}

std::string write_candump(const Trace& trace) {
  std::string text;
  CandumpWriter writer(true);
  for (const Entry& entry : trace.entries) writer.write(entry, trace.buses[entry.bus], text);
  return text;
}

}  // namespace berth::trace
