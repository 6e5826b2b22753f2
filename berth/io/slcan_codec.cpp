#include "berth/io/slcan_codec.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>

#include "berth/can/length.hpp"

namespace berth::io {
namespace {

constexpr std::array<std::uint8_t, 16> fd_sizes{0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

template <class T>
bool read_hex(std::string_view digits, T& value) {
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
  return !digits.empty() && error == std::errc{} && end == digits.data() + digits.size();
}

// Reads what follows the letter; `time` is what follows the data.
bool read_frame(std::string_view line, can::Frame& frame, std::optional<std::uint32_t>& time) {
  const char letter = line[0];
  const char small = static_cast<char>(letter | 0x20);
  frame.extended = letter != small;
  frame.remote = small == 'r';
  frame.fd = small == 'd' || small == 'b';
  frame.brs = small == 'b';
  const std::size_t digits = frame.extended ? 8 : 3;
  unsigned dlc = 0;
  if (line.size() < digits + 2 || !read_hex(line.substr(1, digits), frame.id) ||
      !read_hex(line.substr(digits + 1, 1), dlc)) {
    return false;
  }
  if (frame.id > (frame.extended ? can::extended_mask : can::base_mask) || (!frame.fd && dlc > 8)) return false;
  frame.size = fd_sizes[dlc];
  line.remove_prefix(digits + 2);
  if (!frame.remote) {
    if (line.size() < 2U * frame.size) return false;
    for (std::size_t i = 0; i < frame.size; ++i) {
      if (!read_hex(line.substr(2 * i, 2), frame.data[i])) return false;
    }
    line.remove_prefix(2U * frame.size);
  }
  if (line.size() % 4 == 1) {  // the sender's error state
    if (line.back() != '0' && line.back() != '1') return false;
    frame.esi = line.back() == '1' && frame.fd;
    line.remove_suffix(1);
  }
  if (line.empty()) return true;
  std::uint32_t value = 0;
  if ((line.size() != 4 && line.size() != 8) || !read_hex(line, value)) return false;
  time = value;
  return true;
}

constexpr bool is_frame(char letter) noexcept {
  return std::string_view("tTrRdDbB").find(letter) != std::string_view::npos;
}

}  // namespace

SlcanLine parse_slcan(std::string_view line) {
  using Kind = SlcanLine::Kind;
  SlcanLine parsed;
  const auto is = [&](Kind kind) {
    parsed.kind = kind;
    return parsed;
  };
  if (line.empty()) return is(Kind::done);
  if (line == "\a") return is(Kind::refused);
  if (line == "z" || line == "Z") return is(Kind::taken);
  const char first = line[0];
  if (is_frame(first)) {
    if (read_frame(line, parsed.frame, parsed.time)) return is(Kind::frame);
  } else if ((first == 'z' || first == 'Z') && is_frame(line[1])) {
    if (read_frame(line.substr(1), parsed.frame, parsed.time)) return is(Kind::confirmed);
  } else if (first == 'F' && line.size() == 3) {
    if (read_hex(line.substr(1), parsed.number)) return is(Kind::flags);
  }
  if (!std::ranges::all_of(line, [](char c) { return c >= ' ' && c <= '~'; })) return is(Kind::garbage);
  parsed.text = line;
  if (first == 'V' && line.size() == 5) return is(Kind::version);
  if (first == 'N' && line.size() == 5) return is(Kind::serial);
  // Letters and digits alone are the rest of a frame.
  const bool words = std::ranges::any_of(line, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; });
  return is(words ? Kind::text : Kind::garbage);
}

std::string write_slcan(const can::Frame& frame) {
  constexpr std::string_view upper = "0123456789ABCDEF";
  char letter = frame.remote ? 'r' : frame.fd ? (frame.brs ? 'b' : 'd') : 't';
  if (frame.extended) letter = static_cast<char>(letter & ~0x20);
  const auto last = frame.fd ? fd_sizes.end() : fd_sizes.begin() + 9;
  const auto dlc =
      static_cast<std::size_t>(std::upper_bound(fd_sizes.begin(), last, frame.size) - fd_sizes.begin() - 1);
  std::string out(1, letter);
  for (int shift = frame.extended ? 28 : 8; shift >= 0; shift -= 4) out += upper[(frame.id >> shift) & 0xFU];
  out += upper[dlc];
  for (std::size_t i = 0; !frame.remote && i < fd_sizes[dlc]; ++i) {
    out += upper[frame.data[i] >> 4U];
    out += upper[frame.data[i] & 0xFU];
  }
  return out += '\r';
}

std::string slcan_rate(std::uint32_t bit_rate) {
  constexpr std::array<std::uint32_t, 9> rates{10'000,  20'000,  50'000,  100'000,  125'000,
                                               250'000, 500'000, 800'000, 1'000'000};
  const auto it = std::ranges::find(rates, bit_rate);
  if (it != rates.end()) return fmt::format("S{}\r", it - rates.begin());
  constexpr std::uint32_t clock = 8'000'000;
  if (bit_rate == 0 || bit_rate > 1'000'000) return {};
  // Of all ways to divide the clock, takes the one whose sample point is nearest to CiA's 87.5 %.
  std::string best;
  double best_off = 1;
  for (std::uint32_t prescaler = 1; prescaler <= 64; ++prescaler) {
    const std::uint32_t quanta = (clock + prescaler * bit_rate / 2) / (prescaler * bit_rate);
    if (quanta < 8 || quanta > 25) continue;
    // 33 333 bit/s becomes 33 333 1/3: a deviation that a crystal may have is no other bit rate.
    const double error = std::abs(static_cast<double>(quanta * prescaler) * bit_rate / clock - 1);
    if (error > 0.001) continue;
    const auto after = std::max<std::uint32_t>(1, (quanta + 4) / 8);  // quanta after the sample point
    const std::uint32_t before = quanta - 1 - after;
    if (after > 8 || before > 16) continue;
    const double off = std::abs(static_cast<double>(quanta - after) / quanta - 0.875);
    if (off >= best_off) continue;
    best_off = off;
    best = fmt::format("s{:02X}{:02X}\r", prescaler - 1, (after - 1) << 4U | (before - 1));
  }
  return best;
}

std::optional<SlcanReader::Line> SlcanReader::next() {
  if (head_ > 0 && (head_ == buffer_.size() || head_ > 4096)) {
    buffer_.erase(0, head_);
    before_ += head_;
    head_ = 0;
  }
  const auto end = buffer_.find_first_of("\r\a", head_);
  if (end == std::string::npos) {
    if (buffer_.size() - head_ > longest) {
      if (!broken_at_) broken_at_ = before_ + head_;
      head_ = buffer_.size();
    }
    return std::nullopt;
  }
  Line line{std::string_view(buffer_).substr(head_, end - head_), broken_at_.has_value(), before_ + head_};
  if (broken_at_) line.at = *broken_at_;
  broken_at_.reset();
  // Some adapters end their lines with CR LF.
  if (line.text.starts_with('\n')) line.text.remove_prefix(1);
  if (buffer_[end] == '\a' && line.text.empty() && !line.broken) {
    line.text = std::string_view(buffer_).substr(end, 1);
    head_ = end + 1;
    return line;
  }
  // A BEL after other bytes: those are a broken line, and the BEL is the next line.
  head_ = buffer_[end] == '\a' ? end : end + 1;
  line.broken = line.broken || line.text.size() > longest || buffer_[end] == '\a' ||
                std::ranges::any_of(line.text, [](char c) { return c < ' ' || c > '~'; });
  return line;
}

void SlcanReader::reset() { *this = SlcanReader(); }

}  // namespace berth::io
