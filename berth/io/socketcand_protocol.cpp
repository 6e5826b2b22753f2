#include "berth/io/socketcand_protocol.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <vector>

namespace berth::io {
namespace {

constexpr std::string_view blanks = " \t\r\n";

constexpr bool blank(char c) noexcept { return blanks.find(c) != std::string_view::npos; }

std::string_view trimmed(std::string_view text) noexcept {
  const auto first = text.find_first_not_of(blanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

/// The words of an element. If there are more than any element may have, the first ones.
class Words {
 public:
  explicit Words(std::string_view text) {
    while (count_ < words_.size()) {
      const auto first = text.find_first_not_of(blanks);
      if (first == std::string_view::npos) return;
      const auto end = std::min(text.find_first_of(blanks, first), text.size());
      words_[count_++] = text.substr(first, end - first);
      text.remove_prefix(end);
    }
  }
  [[nodiscard]] std::size_t size() const noexcept { return count_; }
  [[nodiscard]] std::string_view operator[](std::size_t i) const noexcept {
    return i < count_ ? words_[i] : std::string_view();
  }

 private:
  std::array<std::string_view, 16> words_{};
  std::size_t count_ = 0;
};

template <class T>
bool read(std::string_view word, T& value, int base) {
  if (base == 16 && (word.starts_with("0x") || word.starts_with("0X"))) word.remove_prefix(2);
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value, base);
  return error == std::errc{} && end == word.data() + word.size();
}

bool read_id(std::string_view word, can::Frame& frame) {
  frame.extended = word.size() == 8;
  return read(word, frame.id, 16) && frame.id <= (frame.extended ? can::extended_mask : can::base_mask);
}

// Reads the identifier, the length, and exactly that many bytes.
bool read_frame(const Words& words, std::size_t at, can::Frame& frame) {
  if (!read_id(words[at], frame) || !read(words[at + 1], frame.size, 10)) return false;
  if (frame.size > 8 || words.size() != at + 2 + frame.size) return false;
  for (std::size_t i = 0; i < frame.size; ++i) {
    if (!read(words[at + 2 + i], frame.data[i], 16)) return false;
  }
  return true;
}

bool read_interval(const Words& words, std::size_t at, rt::Duration& interval) {
  constexpr std::uint64_t most_seconds = 1'000'000;
  std::uint64_t seconds = 0;
  std::uint64_t micros = 0;
  if (!read(words[at], seconds, 10) || !read(words[at + 1], micros, 10)) return false;
  if (seconds > most_seconds || micros > most_seconds * 1'000'000) return false;
  interval = std::chrono::seconds(seconds) + std::chrono::microseconds(micros);
  return true;
}

using Kind = SocketcandCommand::Kind;

Kind with_words(const Words& words, SocketcandCommand& command, Kind kind) {
  bool good = false;
  switch (kind) {
    case Kind::send:
    case Kind::update: good = read_frame(words, 1, command.frame); break;
    case Kind::add:
    case Kind::filter: good = read_interval(words, 1, command.interval) && read_frame(words, 3, command.frame); break;
    case Kind::subscribe:
      good = words.size() == 4 && read_interval(words, 1, command.interval) && read_id(words[3], command.frame);
      break;
    case Kind::remove:
    case Kind::unsubscribe: good = words.size() == 2 && read_id(words[1], command.frame); break;
    case Kind::statistics: {
      std::uint32_t ms = 0;
      good = words.size() == 2 && read(words[1], ms, 10);
      command.interval = std::chrono::milliseconds(ms);
      break;
    }
    default: break;
  }
  return good ? kind : Kind::malformed;
}

// Reads the data of a frame: pairs of digits, with or without blanks between them.
bool read_data(const Words& words, std::size_t at, can::Frame& frame) {
  frame.size = 0;
  for (std::size_t w = at; w < words.size(); ++w) {
    const auto word = words[w];
    if (word.size() % 2 != 0) return false;
    for (std::size_t i = 0; i < word.size(); i += 2) {
      if (frame.size >= 8 || !read(word.substr(i, 2), frame.data[frame.size], 16)) return false;
      ++frame.size;
    }
  }
  return true;
}

bool read_time(std::string_view word, std::chrono::microseconds& at) {
  constexpr std::int64_t most_seconds = 1'000'000'000'000;
  const auto point = word.find('.');
  std::int64_t seconds = 0;
  if (!read(word.substr(0, point), seconds, 10) || seconds < 0 || seconds > most_seconds) return false;
  std::int64_t micros = 0;
  if (point != std::string_view::npos) {
    const auto digits = word.substr(point + 1, 6);
    if (digits.empty() || !read(digits, micros, 10) || micros < 0) return false;
    for (std::size_t i = digits.size(); i < 6; ++i) micros *= 10;
  }
  at = std::chrono::seconds(seconds) + std::chrono::microseconds(micros);
  return true;
}

constexpr std::string_view upper = "0123456789ABCDEF";
constexpr std::string_view lower = "0123456789abcdef";

void append_id(std::string& out, const can::Frame& frame) {
  for (int shift = frame.extended ? 28 : 8; shift >= 0; shift -= 4) out += upper[(frame.id >> shift) & 0xFU];
}

}  // namespace

void ElementReader::fault(std::size_t at) noexcept {
  if (in_fault_) return;
  in_fault_ = true;
  ++faults_;
  fault_at_ = before_ + at;
}

void ElementReader::skip_to_bracket() noexcept {
  for (; head_ < buffer_.size() && buffer_[head_] != '<'; ++head_) {
    if (!blank(buffer_[head_]) && buffer_[head_] != '\0') fault(head_);  // some send the NUL of their strings, too
  }
}

std::optional<std::string_view> ElementReader::next() {
  if (head_ > 0 && (head_ == buffer_.size() || head_ > longest_element)) {
    buffer_.erase(0, head_);
    before_ += head_;
    head_ = 0;
  }
  for (;;) {
    skip_to_bracket();
    if (head_ == buffer_.size()) return std::nullopt;
    const auto end = buffer_.find('>', head_);
    const auto beyond = end == std::string::npos ? buffer_.size() : end + 1;
    if (beyond - head_ <= longest_element) {
      if (end == std::string::npos) return std::nullopt;
      const auto inside = std::string_view(buffer_).substr(head_ + 1, end - head_ - 1);
      head_ = end + 1;
      in_fault_ = false;
      return trimmed(inside);
    }
    // The element is too long. A later bracket may begin a better one.
    fault(head_);
    head_ = beyond - longest_element;
  }
}

SocketcandCommand parse_command(std::string_view element) {
  static constexpr std::pair<std::string_view, Kind> plain[] = {{"echo", Kind::echo},
                                                                {"rawmode", Kind::raw_mode},
                                                                {"bcmmode", Kind::bcm_mode},
                                                                {"controlmode", Kind::control_mode}};
  static constexpr std::pair<std::string_view, Kind> wordy[] = {{"send", Kind::send},
                                                                {"add", Kind::add},
                                                                {"update", Kind::update},
                                                                {"delete", Kind::remove},
                                                                {"filter", Kind::filter},
                                                                {"subscribe", Kind::subscribe},
                                                                {"unsubscribe", Kind::unsubscribe},
                                                                {"statistics", Kind::statistics}};
  SocketcandCommand command;
  const auto text = trimmed(element);
  for (const auto& [name, kind] : plain) {
    if (text == name) {
      command.kind = kind;
      return command;
    }
  }
  const auto name = text.substr(0, text.find_first_of(blanks));
  if (name == "open" && name.size() < text.size()) {
    command.kind = Kind::open;
    command.bus = trimmed(text.substr(name.size()));
    return command;
  }
  const Words words(text);
  for (const auto& [word, kind] : wordy) {
    if (name == word && name.size() < text.size()) {
      command.kind = with_words(words, command, kind);
      return command;
    }
  }
  if (words[1] == "B" || words[1] == "C") {
    command.kind = Kind::configure;
    command.bus = words[0];
  }
  return command;
}

SocketcandNotice parse_notice(std::string_view element) {
  using Said = SocketcandNotice::Kind;
  SocketcandNotice notice;
  const auto text = trimmed(element);
  const auto name = text.substr(0, text.find_first_of(blanks));
  if (text == "hi") {
    notice.kind = Said::hi;
  } else if (text == "ok") {
    notice.kind = Said::ok;
  } else if (text == "echo") {
    notice.kind = Said::echo;
  } else if (name == "frame") {
    const Words words(text);
    const bool good = words.size() >= 3 && read_id(words[1], notice.frame) && read_time(words[2], notice.at) &&
                      read_data(words, 3, notice.frame);
    notice.kind = good ? Said::frame : Said::malformed;
  } else if (name == "error") {
    notice.kind = Said::error;
    notice.text = trimmed(text.substr(name.size()));
  } else if (name == "stat") {
    notice.kind = Said::stat;
  }
  return notice;
}

void append_send(std::string& out, const can::Frame& frame) {
  out += "< send ";
  append_id(out, frame);
  out += ' ';
  out += static_cast<char>('0' + std::min<unsigned>(frame.size, 8));
  for (const auto byte : frame.bytes().first(std::min<std::size_t>(frame.bytes().size(), 8))) {
    out += ' ';
    if (byte > 0xF) out += lower[byte >> 4U];
    out += lower[byte & 0xFU];
  }
  out += " >";
}

void append_frame(std::string& out, const can::Frame& frame, std::chrono::microseconds at, bool spaced) {
  out += "< frame ";
  append_id(out, frame);
  out += ' ';
  const auto time = static_cast<std::uint64_t>(std::max<std::int64_t>(at.count(), 0));
  std::array<char, 24> digits{};
  const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), time / 1'000'000);
  out.append(digits.data(), error == std::errc{} ? static_cast<std::size_t>(end - digits.data()) : 0);
  out += '.';
  for (std::uint64_t unit = 100'000; unit > 0; unit /= 10) out += static_cast<char>('0' + time / unit % 10);
  out += ' ';
  for (const auto byte : frame.bytes().first(std::min<std::size_t>(frame.bytes().size(), 8))) {
    out += upper[byte >> 4U];
    out += upper[byte & 0xFU];
    if (spaced) out += ' ';
  }
  out += " >";
}

}  // namespace berth::io
