#include "berth/trace/trc.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "berth/can/length.hpp"
#include "berth/trace/calendar.hpp"

namespace berth::trace {
namespace {

constexpr std::string_view bus_comment = "berth: bus ";
constexpr std::uint32_t protocol_error = 0x08;  // CAN_ERR_PROT; data[2] holds its kind, with 80h while sending
constexpr std::uint8_t while_sending = 0x80;
constexpr unsigned most_buses_here = 255;

std::optional<unsigned> number(std::string_view word, int base, unsigned most) noexcept {
  unsigned value = 0;
  const auto [end, bad] = std::from_chars(word.data(), word.data() + word.size(), value, base);
  if (word.empty() || bad != std::errc{} || end != word.data() + word.size() || value > most) return std::nullopt;
  return value;
}

std::string_view take_word(std::string_view line, std::size_t& at) noexcept {
  while (at < line.size() && is_blank(line[at])) ++at;
  const std::size_t begin = at;
  while (at < line.size() && !is_blank(line[at])) ++at;
  return line.substr(begin, at - begin);
}

unsigned size_of_dlc(unsigned dlc) noexcept {
  constexpr std::uint8_t sizes[] = {12, 16, 20, 24, 32, 48, 64};
  return dlc <= 8 ? dlc : sizes[dlc - 9];
}

}  // namespace

std::string_view TrcReader::word() { return take_word(line_, at_); }

void TrcReader::wrong(std::string_view word, std::string message) {
  error(word.data() == nullptr || word.empty() ? line_.size() : static_cast<std::size_t>(word.data() - line_.data()),
        std::move(message));
}

void TrcReader::line(std::string_view line) {
  line_ = line;
  at_ = 0;
  const auto begin = line.find_first_not_of(" \t");
  if (begin == std::string_view::npos) return;
  if (line[begin] == ';') return head(line.substr(begin + 1));
  const auto row = this->row();
  if (!row) return;
  if (row->type == "ER" || row->type == "Error") return error_frame(*row);
  frame(*row);
}

void TrcReader::head(std::string_view line) {
  if (line.starts_with("$FILEVERSION=")) return version(line.substr(13));
  if (line.starts_with("$COLUMNS=")) return columns(line.substr(9));
  if (line.starts_with("$STARTTIME=")) {
    auto text = line.substr(11);
    text = text.substr(0, text.find_last_not_of(" \t") + 1);
    if (const auto start = parse_ole_date(text)) {
      start_ = *start;
    } else {
      tell(Finding::Severity::warning, 12,
           "this start is not a number of days since 1899, or lies before 1970: times count from the beginning of the "
           "log");
    }
    return;
  }
  table(line);
}

void TrcReader::version(std::string_view text) {
  text = text.substr(0, text.find_last_not_of(" \t") + 1);
  constexpr std::pair<std::string_view, std::string_view> known[] = {{"1.0", "NOIlD"},   {"1.1", "NOTIlD"},
                                                                     {"1.2", "NOBTIlD"}, {"1.3", "NOBTIRlD"},
                                                                     {"2.0", "NOTIdlD"}, {"2.1", "NOTBIdRLD"}};
  const auto found = std::find_if(std::begin(known), std::end(known), [&](const auto& k) { return k.first == text; });
  version_2_ = text.starts_with('2');
  if (found != std::end(known)) {
    columns_ = found->second;
    return;
  }
  columns_ = "NOTBIdRLD";
  version_2_ = true;
  tell(Finding::Severity::warning, 13, fmt::format("version {} of TRC is not known here; it is read as 2.1", text));
}

void TrcReader::columns(std::string_view text) {
  std::string found;
  for (const char c : text) {
    if (c == ',' || is_blank(c)) continue;
    if (std::string_view("NOTBIdRlLD").find(c) == std::string_view::npos || found.find(c) != std::string::npos)
      return error(10, fmt::format("there is no column {}, or it appears twice; the version's own order is taken",
                                   is_hex(c) || c > ' ' ? std::string(1, c) : std::string("?")));
    found += c;
  }
  const bool whole = found.find('O') != std::string::npos && found.find('T') != std::string::npos &&
                     found.find('I') != std::string::npos && found.find_first_of("lL") != std::string::npos &&
                     found.ends_with('D');
  if (!whole) return error(10, "the columns O, T, I, l or L must be there, and D at the end");
  columns_ = std::move(found);
}

// The table of buses in the head (number, name, connection, ...), or Berth's own comment.
void TrcReader::table(std::string_view line) {
  std::size_t at = 0;
  const auto first = take_word(line, at);
  if (first == "berth:" && line.find(bus_comment) != std::string_view::npos) {
    at = line.find(bus_comment) + bus_comment.size();
    const auto bus = number(take_word(line, at), 10, most_buses_here);
    if (bus && take_word(line, at) == "is") {
      const auto name = take_word(line, at);
      if (!name.empty()) names_.emplace_back(*bus, std::string(name));
    }
    return;
  }
  const auto second = take_word(line, at);
  if (first == "Bus" && second == "Name") {
    in_table_ = true;
    return;
  }
  if (first.starts_with("--")) in_table_ = false;
  if (!in_table_) return;
  const auto bus = number(first, 10, most_buses_here);
  const bool taken = std::any_of(names_.begin(), names_.end(), [&](const auto& n) { return n.second == second; });
  if (bus && !second.empty() && second != "N/A" && !taken) names_.emplace_back(*bus, std::string(second));
}

bool TrcReader::known_type(std::string_view type) const noexcept {
  if (!version_2_) return type == "Rx" || type == "Tx" || type == "Error";
  constexpr std::string_view known[] = {"DT", "RR", "FD", "FB", "FE", "BI", "ER"};
  return std::find(std::begin(known), std::end(known), type) != std::end(known);
}

// Empty: the line needs nothing more.
std::optional<TrcReader::Row> TrcReader::row() {
  Row row;
  if (columns_.find('T') == std::string::npos) row.type = "Rx";
  for (const char column : columns_) {
    if (column == 'D') {
      while (at_ < line_.size() && is_blank(line_[at_])) ++at_;
      row.data = line_.substr(at_);
      row.data = row.data.substr(0, row.data.find_last_not_of(" \t") + 1);
      break;
    }
    const auto text = word();
    if (column == 'N') {
      const auto digits = text.ends_with(')') ? text.substr(0, text.size() - 1) : text;
      if (!number(digits, 10, 0xFFFF'FFFF)) {
        wrong(text, "a line begins with its number");
        return std::nullopt;
      }
    } else if (column == 'O') {
      const bool minus = text.starts_with('-');
      const auto offset = parse_milliseconds(minus ? text.substr(1) : text);
      if (!offset) {
        wrong(text, "this is not a time in milliseconds");
        return std::nullopt;
      }
      row.offset = minus ? -*offset : *offset;
    } else if (column == 'T') {
      if (!known_type(text)) {
        if (text.empty()) {
          wrong(text, "the line ends before its type");
        } else {
          ++others_;
        }
        return std::nullopt;
      }
      row.type = text;
    } else if (column == 'B') {
      const auto bus = number(text, 10, most_buses_here);
      if (!bus || *bus == 0) {
        wrong(text, "this is not a number of a bus");
        return std::nullopt;
      }
      row.bus = *bus;
    } else if (column == 'I') {
      row.id = text;
    } else if (column == 'd') {
      row.way = text;
    } else if (column != 'R') {
      row.size = text;
      row.size_kind = column;
    }
  }
  if (row.offset > std::chrono::seconds(most_seconds) - start_ || row.offset < -start_) {
    error(0, "added to the start, this time lies outside of 1970 to 2255");
    return std::nullopt;
  }
  entry_.at = start_ + row.offset;
  return row;
}

void TrcReader::frame(const Row& row) {
  if (row.id == "FFFFFFFF" && !version_2_) {
    ++others_;  // a warning of version 1.0
    return;
  }
  if (row.data.starts_with("ERROR") && !version_2_) {
    Row error = row;
    error.data = row.data.substr(5);
    return error_frame(error);
  }
  can::Frame& frame = entry_.frame;
  const auto id = number(row.id, 16, can::extended_mask);
  frame.extended = row.id.size() > 4;
  if (!id || (!frame.extended && *id > can::base_mask))
    return wrong(row.id, "this is not an identifier: four hex digits up to 07FF, or eight up to 1FFFFFFF");
  frame.id = *id;
  const std::string_view type = row.type;
  const std::string_view way = version_2_ ? row.way : type;
  if (way != "Rx" && way != "Tx" && columns_.find_first_of("dT") != std::string::npos && !(version_2_ && way.empty()))
    return wrong(way, "a direction is Rx or Tx");
  const bool says = version_2_ ? !way.empty() : columns_.find('T') != std::string::npos;
  entry_.direction = !says ? Direction::unknown : way == "Tx" ? Direction::sent : Direction::received;
  entry_.error = false;
  frame.fd = type == "FD" || type == "FB" || type == "FE" || type == "BI";
  frame.brs = type == "FB" || type == "BI";
  frame.esi = type == "FE" || type == "BI";
  frame.remote = type == "RR" || (!frame.fd && row.data.starts_with("RTR"));
  if (size_of(row) && (frame.remote || data(row))) keep_on(row);
}

bool TrcReader::size_of(const Row& row) {
  can::Frame& frame = entry_.frame;
  const auto value = number(row.size, 10, 64);
  if (!value || (row.size_kind == 'L' && *value > 15)) {
    wrong(row.size, row.size_kind == 'L' ? "this is not a DLC, 0 to 15" : "this is not a number of data bytes");
    return false;
  }
  unsigned size = *value;
  if (row.size_kind == 'L') size = frame.fd ? size_of_dlc(size) : std::min(size, 8U);
  if (frame.fd ? !can::fd_dlc(size).has_value() : size > 8) {
    wrong(row.size, fmt::format("a frame cannot have {} data bytes", size));
    return false;
  }
  frame.size = static_cast<std::uint8_t>(size);
  return true;
}

bool TrcReader::data(const Row& row) {
  can::Frame& frame = entry_.frame;
  std::size_t at = 0;
  for (unsigned i = 0; i < frame.size; ++i) {
    const auto text = take_word(row.data, at);
    if (text.size() != 2 || !is_hex(text[0]) || !is_hex(text[1])) {
      wrong(text, fmt::format("data byte {} of {} is missing or no byte", i + 1, frame.size));
      return false;
    }
    frame.data[i] = static_cast<std::uint8_t>(hex_value(text[0]) << 4 | hex_value(text[1]));
  }
  return true;
}

// Identifier: 1 bit, 2 form, 4 stuff, 8 other error. Data: 0 sending or 1 receiving, the place, the receive and the
// transmit counter.
void TrcReader::error_frame(const Row& row) {
  const auto kind = number(row.id, 16, 0xFFFF);
  if (!kind) return wrong(row.id, "this is not a kind of an error frame");
  std::array<std::uint8_t, 4> bytes{1, 0, 0, 0};
  std::size_t at = 0;
  for (auto& byte : bytes) {
    const auto text = take_word(row.data, at);
    const auto value = number(text, 16, 255);
    if (!value) break;
    byte = static_cast<std::uint8_t>(*value);
  }
  can::Frame frame;
  frame.id = protocol_error;
  frame.size = 8;
  frame.data[2] = static_cast<std::uint8_t>((*kind & 7U) | (bytes[0] == 0 ? while_sending : 0U));
  frame.data[6] = bytes[3];
  frame.data[7] = bytes[2];
  entry_.frame = frame;
  entry_.error = true;
  entry_.direction = Direction::unknown;
  keep_on(row);
}

void TrcReader::keep_on(const Row& row) {
  auto known = std::find_if(numbers_.begin(), numbers_.end(), [&](const auto& n) { return n.first == row.bus; });
  if (known == numbers_.end()) {
    const auto named = std::find_if(names_.begin(), names_.end(), [&](const auto& n) { return n.first == row.bus; });
    const auto index = bus(named != names_.end() ? named->second : fmt::format("can{}", row.bus - 1));
    if (!index) return;
    numbers_.emplace_back(row.bus, *index);
    known = numbers_.end() - 1;
  }
  entry_.bus = known->second;
  keep(entry_);
}

void TrcReader::over() {
  if (others_ > 0) {
    tell_of_file(Finding::Severity::note,
                 fmt::format("{} lines that are not frames (warnings, states, events) are left out", others_));
  }
}

void TrcWriter::begin(rt::Duration first, std::string& out) {
  if (begun_) return;
  begun_ = true;
  start_ = std::max(std::chrono::floor<std::chrono::milliseconds>(first), std::chrono::milliseconds(0));
  out += fmt::format(";$FILEVERSION={}\r\n;$STARTTIME={}\r\n", old_ ? "1.1" : "2.1", write_ole_date(start_));
  if (!old_) out += ";$COLUMNS=N,O,T,B,I,d,R,L,D\r\n";
  out += fmt::format(";\r\n;   Start time: {} UTC\r\n;   Generated by berth\r\n;\r\n", write_date(start_));
  if (old_) {
    out +=
        ";   Message Number\r\n;   |         Time Offset (ms)\r\n;   |         |        Type\r\n"
        ";   |         |        |        ID (hex)\r\n;   |         |        |        |     Data Length\r\n"
        ";   |         |        |        |     |   Data Bytes (hex) ...\r\n"
        ";---+--   ----+----  --+--  ----+---  +  -+ -- -- -- -- -- -- --\r\n";
  } else {
    out +=
        ";   Message   Time    Type    ID     Rx/Tx\r\n;   Number    Offset  |  Bus  [hex]  |  Reserved\r\n"
        ";   |         [ms]    |  |    |      |  |  Data Length Code\r\n"
        ";   |         |       |  |    |      |  |  |    Data [hex] ...\r\n"
        ";---+-- ------+------ +- +- --+----- +- +- +--- +- -- -- -- -- -- -- --\r\n";
  }
}

// Milliseconds with three digits after the point, or one in version 1.1; right-aligned.
char* TrcWriter::offset(rt::Duration at, char* to) {
  const std::int64_t unit = old_ ? 100'000 : 1000;
  const unsigned scale = old_ ? 10 : 1000;
  const std::int64_t nanos = (at - start_).count();
  if (nanos % unit != 0) lose(Loss::time);
  const auto count = static_cast<std::uint64_t>((std::abs(nanos) + unit / 2) / unit);
  *to++ = ' ';
  if (nanos < 0) *to++ = '-';
  to = put_number(to, count / scale, nanos < 0 ? 1 : 9);
  *to++ = '.';
  return put_decimal(to, count % scale, old_ ? 1 : 3);
}

void TrcWriter::write(const Entry& entry, std::string_view bus, std::string& out) {
  begin(entry.at, out);
  const bool fresh = names_.add(entry.bus, bus);
  if (old_) {
    if (names_.number(entry.bus) > 1) lose(Loss::bus);
    if (entry.frame.fd) return lose(Loss::fd_frame);
  } else if (fresh && names_.of(entry.bus) != fmt::format("can{}", names_.number(entry.bus) - 1)) {
    out += fmt::format(";   {}{} is {}\r\n", bus_comment, names_.number(entry.bus), names_.of(entry.bus));
  }
  if (entry.error) {
    lose(Loss::error_detail);
  } else if (entry.direction == Direction::unknown) {
    lose(Loss::direction);
  }
  ++count_;
  if (old_) {
    write_old(entry, out);
  } else {
    write_new(entry, out);
  }
}

namespace {

char* put_data(char* to, const can::Frame& frame) noexcept {
  for (unsigned i = 0; i < frame.size; ++i) {
    *to++ = ' ';
    to = put_byte(to, frame.data[i]);
  }
  return to;
}

// The frame that stands for an error in the file: kind as identifier, four data bytes.
can::Frame error_row(const can::Frame& error) noexcept {
  const bool protocol = (error.id & protocol_error) != 0;
  const unsigned kind = protocol ? error.data[2] & 7U : 0U;
  const bool sending = protocol && (error.data[2] & while_sending) != 0;
  return can::Frame::base(kind == 0 ? 8 : kind,
                          {static_cast<std::uint8_t>(sending ? 0 : 1), 0, error.data[7], error.data[6]});
}

char* put_id(char* to, const can::Frame& frame) noexcept {
  if (frame.extended) return put_hex(to, frame.id, 8);
  return put_hex(put_text(to, "    "), frame.id, 4);
}

}  // namespace

void TrcWriter::write_old(const Entry& entry, std::string& out) {
  std::array<char, 128> line;
  char* to = put_number(line.data(), count_, 6);
  *to++ = ')';
  to = offset(entry.at, to);
  const can::Frame frame = entry.error ? error_row(entry.frame) : entry.frame;
  to = put_text(to, entry.error ? "  Error  " : entry.direction == Direction::sent ? "  Tx     " : "  Rx     ");
  to = put_id(to, frame);
  to = put_text(to, "  ");
  *to++ = static_cast<char>('0' + frame.size);
  *to++ = ' ';
  to = frame.remote ? put_text(to, " RTR") : put_data(to, frame);
  to = put_text(to, "\r\n");
  out.append(line.data(), static_cast<std::size_t>(to - line.data()));
}

void TrcWriter::write_new(const Entry& entry, std::string& out) {
  std::array<char, 320> line;
  char* to = put_number(line.data(), count_, 7);
  to = offset(entry.at, to);
  const can::Frame& frame = entry.frame;
  const can::Frame shown = entry.error ? error_row(frame) : frame;
  constexpr const char* fd_types[] = {" FD ", " FB ", " FE ", " BI "};
  to = put_text(to, entry.error    ? " ER "
                    : frame.fd     ? fd_types[(frame.brs ? 1 : 0) + (frame.esi ? 2 : 0)]
                    : frame.remote ? " RR "
                                   : " DT ");
  const unsigned bus = names_.number(entry.bus);
  to = put_number(to, bus, 1);
  if (bus < 10) *to++ = ' ';
  *to++ = ' ';
  to = put_id(to, shown);
  to = put_text(to, entry.direction == Direction::sent && !entry.error ? " Tx -  " : " Rx -  ");
  const unsigned dlc = shown.fd ? can::fd_dlc(shown.size).value_or(15) : shown.size;
  to = put_number(to, dlc, 1);
  if (!shown.remote && shown.size > 0) {
    to = put_text(to, dlc < 10 ? "   " : "  ");
    to = put_data(to, shown);
  }
  to = put_text(to, "\r\n");
  out.append(line.data(), static_cast<std::size_t>(to - line.data()));
}

void TrcWriter::finish(std::string& out) { begin(rt::Duration(0), out); }

}  // namespace berth::trace
