// The judge's frames, bit by bit.
#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "bit_model.hpp"

namespace judge {
namespace {

void append(std::vector<char>& bits, std::uint32_t value, int count) {
  for (int i = count - 1; i >= 0; --i) bits.push_back((value >> i & 1U) == 0 ? 1 : 0);
}

// Bosch CAN 2.0 §3.1.1: the pseudo code, bit for bit.
std::uint32_t crc_sequence(const char* dominant, std::size_t count) {
  std::uint32_t rg = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t next = (dominant[i] != 0 ? 0U : 1U) ^ (rg >> 14 & 1U);
    rg = rg << 1 & 0x7FFEU;
    if (next != 0) rg ^= 0x4599U;
  }
  return rg;
}

// Five equal bits; a stuff bit among them counts too, and never stands in the middle of six.
bool five_equal(const std::vector<char>& bits) {
  return bits.size() >= 5 && std::count(bits.end() - 5, bits.end(), bits.back()) == 5;
}

void put(Wire& w, char bit, char part, char stuff_part) {
  w.dominant.push_back(bit);
  w.part.push_back(part);
  if (!five_equal(w.dominant)) return;
  w.dominant.push_back(bit != 0 ? 0 : 1);
  w.part.push_back(stuff_part);
}

// SOF to the bit behind IDE (base) or RTR (extended): r0 and r1 are what differs.
std::vector<char> head(const Frame& f) {
  std::vector<char> plain;
  append(plain, 0, 1);
  if (f.extended) append(plain, f.id >> 18, 11), append(plain, 3, 2), append(plain, f.id, 18);
  if (!f.extended) append(plain, f.id, 11);
  append(plain, f.remote ? 1 : 0, 1);
  return plain;
}

}  // namespace

Wire encode(const Frame& f) {
  std::vector<char> plain = head(f);
  const std::size_t rtr = plain.size() - 1;
  if (f.fd) {
    if (!f.extended) append(plain, 0, 1);
  } else {
    append(plain, 0, 2);
    append(plain, f.size, 4);
    for (std::size_t i = 0; !f.remote && i < f.size; ++i) append(plain, f.data[i], 8);
    append(plain, crc_sequence(plain.data(), plain.size()), 15);
  }
  Wire w;
  for (std::size_t i = 0; i < plain.size(); ++i) {
    put(w, plain[i], i == 0 ? 'S' : i <= rtr ? 'A' : '.', i < rtr ? 's' : '.');
  }
  if (f.fd) {
    w.dominant.push_back(0);
    w.part.push_back('F');
    return w;
  }
  for (const char c : {'.', 'K', '.', '.', '.', '.', '.', '.', '.', '.'}) w.dominant.push_back(0), w.part.push_back(c);
  return w;
}

// ISO 11898-1:2015; docs/protocols/can-frames.md §Frame layout.
FdLength fd_length(const Frame& f) {
  std::vector<char> plain = head(f);
  if (!f.extended) append(plain, 0, 1);  // IDE
  append(plain, 2, 2);                   // FDF, res
  append(plain, f.brs ? 1 : 0, 1);
  const std::size_t brs = plain.size() - 1;
  append(plain, f.esi ? 1 : 0, 1);
  const unsigned sizes[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
  append(plain, static_cast<std::uint32_t>(std::ranges::find(sizes, f.size) - sizes), 4);
  for (std::size_t i = 0; i < f.size; ++i) append(plain, f.data[i], 8);
  std::vector<char> bits;
  unsigned nominal = 0;
  for (std::size_t i = 0; i < plain.size(); ++i) {
    if (five_equal(bits)) bits.push_back(bits.back() != 0 ? 0 : 1);  // not behind the last: a fixed one stands there
    bits.push_back(plain[i]);
    if (i == brs) nominal = static_cast<unsigned>(bits.size());
  }
  auto fast = static_cast<unsigned>(bits.size()) - nominal;
  const unsigned check = 4 + (f.size > 16 ? 21 : 17);  // stuff count and CRC
  for (unsigned i = 0; i < check; ++i) fast += i % 4 == 0 ? 2 : 1;
  ++fast;         // CRC delimiter
  nominal += 12;  // ACK slot and delimiter, end-of-frame, intermission
  if (!f.brs) nominal += std::exchange(fast, 0);
  return {nominal, fast};
}

void Reading::push(bool dominant) {
  const bool stuffed = same_ == 5;
  const bool same = count > 0 && dominant == last_;
  ++count;
  if (delimiter || stuff_error) return;
  if (stuffed && same) {
    stuff_error = true;
    return;
  }
  same_ = same ? same_ + 1 : 1;
  last_ = dominant;
  if (!stuffed) plain_.push_back(dominant ? 1 : 0);
  const bool extended = plain_.size() > 13 && plain_[13] == 0;
  const std::size_t dlc = extended ? 35 : 15;
  if (!stuffed && plain_.size() == dlc + 4) {
    unsigned bytes = 0;
    for (std::size_t k = dlc; k < dlc + 4; ++k) bytes = 2 * bytes + (plain_[k] != 0 ? 0 : 1);
    bytes = std::min(bytes, 8U);
    frame.size = static_cast<std::uint8_t>(bytes);
    frame.extended = extended;
    frame.remote = 0 == plain_[extended ? 32 : 12];
    length_ = dlc + 4 + (frame.remote ? 0 : 8 * bytes) + 15;
  }
  if (length_ != 0 && plain_.size() == length_ && same_ < 5) finish();
}

void Reading::finish() {
  delimiter = count;
  const auto number = [&](std::size_t from, std::size_t bits) {
    std::uint32_t value = 0;
    for (std::size_t k = from; k < from + bits; ++k) value = 2 * value + (plain_[k] != 0 ? 0 : 1);
    return value;
  };
  frame.id = frame.extended ? number(1, 11) * 0x40000U + number(14, 18) : number(1, 11);
  const std::size_t data = frame.extended ? 39 : 19;
  for (unsigned i = 0; !frame.remote && i < frame.size; ++i) {
    frame.data[i] = static_cast<std::uint8_t>(number(data + 8 * i, 8));
  }
  crc_right = crc_sequence(plain_.data(), length_ - 15) == number(length_ - 15, 15);
}

}  // namespace judge
