#pragma GCC optimize("O2")
#include "bit_model.hpp"

#include <algorithm>

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

bool is_passive(const Node& n) { return n.tec >= 128 || n.rec >= 128; }

}  // namespace

Wire encode(const Frame& f) {
  std::vector<char> plain;
  append(plain, 0, 1);
  if (f.extended) append(plain, f.id >> 18, 11), append(plain, 3, 2), append(plain, f.id, 18);
  if (!f.extended) append(plain, f.id, 11);
  append(plain, f.remote ? 1 : 0, 1);
  const std::size_t rtr = plain.size() - 1;
  append(plain, 0, 2);
  append(plain, f.size, 4);
  for (std::size_t i = 0; !f.remote && i < f.size; ++i) append(plain, f.data[i], 8);
  append(plain, crc_sequence(plain.data(), plain.size()), 15);
  Wire w;
  for (std::size_t i = 0; i < plain.size(); ++i) {
    w.dominant.push_back(plain[i]);
    w.part.push_back(i == 0 ? 'S' : i <= rtr ? 'A' : '.');
    const std::size_t n = w.dominant.size();
    if (n < 5) continue;
    const auto tail = w.dominant.end() - 5;
    if (std::count(tail, w.dominant.end(), plain[i]) != 5) continue;
    // Five equal bits; a stuff bit among them counts too, and never stands in the middle of six.
    w.dominant.push_back(plain[i] != 0 ? 0 : 1);
    w.part.push_back(i < rtr ? 's' : '.');
  }
  for (const char c : {'.', 'K', '.', '.', '.', '.', '.', '.', '.', '.'}) w.dominant.push_back(0), w.part.push_back(c);
  return w;
}

Reading read(const std::vector<char>& history) {
  Reading r;
  const char* seen = history.data();  // plain pointers: this is read anew for every bit
  char plain[160];
  std::size_t count = 0;
  int same = 0;
  std::size_t length = 0;
  for (std::size_t i = 0; i < history.size(); ++i) {
    const bool stuffed = same == 5;
    if (length != 0 && count == length && !stuffed) {
      r.delimiter = i;
      break;
    }
    if (stuffed && seen[i] == seen[i - 1]) {
      r.stuff_error = true;
      return r;
    }
    same = i > 0 && seen[i] == seen[i - 1] ? same + 1 : 1;
    if (stuffed) continue;
    plain[count++] = seen[i];
    const bool extended = count > 13 && plain[13] == 0;
    const std::size_t dlc = extended ? 35 : 15;
    if (count != dlc + 4) continue;
    unsigned bytes = 0;
    for (std::size_t k = dlc; k < dlc + 4; ++k) bytes = 2 * bytes + (plain[k] != 0 ? 0 : 1);
    bytes = std::min(bytes, 8U);
    r.frame.size = static_cast<std::uint8_t>(bytes);
    r.frame.extended = extended;
    r.frame.remote = 0 == plain[extended ? 32 : 12];
    length = dlc + 4 + (r.frame.remote ? 0 : 8 * bytes) + 15;
  }
  if (!r.delimiter && length != 0 && count == length && same < 5) r.delimiter = history.size();
  if (!r.delimiter) return r;
  const auto number = [&](std::size_t from, std::size_t bits) {
    std::uint32_t value = 0;
    for (std::size_t k = from; k < from + bits; ++k) value = 2 * value + (plain[k] != 0 ? 0 : 1);
    return value;
  };
  r.frame.id = r.frame.extended ? number(1, 11) * 0x40000U + number(14, 18) : number(1, 11);
  const std::size_t data = r.frame.extended ? 39 : 19;
  for (unsigned i = 0; !r.frame.remote && i < r.frame.size; ++i) {
    r.frame.data[i] = static_cast<std::uint8_t>(number(data + 8 * i, 8));
  }
  r.crc_right = crc_sequence(plain, length - 15) == number(length - 15, 15);
  return r;
}

bool Bus::wants(const Node& n) const {
  return !n.listens_only && std::ranges::any_of(n.queue, [&](const auto& q) { return q.ready <= now; });
}

void Bus::count_frame() {
  if (origin_ == now) return;
  origin_ = now;
  ++frames;
  flips_live_ = true;
}

void Bus::start(Node& n, bool behind_start_bit) {
  count_frame();
  n.chosen = 0;
  for (std::size_t i = 0; n.by_priority && i < n.queue.size(); ++i) {
    if (n.queue[i].ready > now) continue;
    const auto key = [](const Frame& f) {
      std::vector<char> recessive;  // the arbitration field without stuff bits; IDE of a base frame belongs to it
      const std::uint32_t rtr = f.remote ? 1 : 0;
      std::vector<char> bits;
      append(bits, f.extended ? f.id >> 18 : f.id, 11);
      if (f.extended) append(bits, 3, 2), append(bits, f.id, 18), append(bits, rtr, 1);
      if (!f.extended) append(bits, rtr, 1), append(bits, 0, 20);
      for (const char d : bits) recessive.push_back(d != 0 ? 0 : 1);
      return recessive;
    };
    if (key(n.queue[i].frame) < key(n.queue[n.chosen].frame)) n.chosen = i;
  }
  n.wire = encode(n.queue[n.chosen].frame);
  n.doing = Doing::transmitting;
  n.was_transmitter = true;
  n.at = behind_start_bit ? 1 : 0;
  n.history.clear();
  n.reading = {};
  if (behind_start_bit) n.history.push_back(1);
}

bool Bus::level(const Node& n) const {
  switch (n.doing) {
    case Doing::transmitting: return n.wire.dominant[n.at] != 0;
    case Doing::receiving:  // the ACK slot stands behind the CRC delimiter
      return n.reading.delimiter && n.history.size() == *n.reading.delimiter + 1 && n.reading.crc_right &&
             !n.listens_only;
    case Doing::flag:
    case Doing::overload_flag: return !n.listens_only;
    default: return false;
  }
}

void Bus::step() {
  for (auto& n : nodes) {
    if (n.doing == Doing::idle && wants(n)) start(n, false);
  }
  const bool dominant = std::ranges::any_of(nodes, [&](const Node& n) { return level(n); });
  const std::uint64_t frame = frames;
  const std::int64_t origin = origin_;
  const bool live = flips_live_ && !flips_.empty();
  for (int i = 0; i < static_cast<int>(nodes.size()); ++i) {
    const bool turned = live && flips_.contains({frame - 1, static_cast<int>(now - origin), i});
    hear(i, dominant != turned);
  }
  ++now;
  // A disturbance lasts no longer than the frame it came with: on a silent bus there is none.
  if (std::ranges::all_of(nodes, [](const Node& n) {
        return n.doing == Doing::idle || n.doing == Doing::suspended || n.doing == Doing::off;
      })) {
    flips_live_ = false;
  }
}

void Bus::punish(Node& n, unsigned points) {
  if (n.listens_only) return;
  if (!n.was_transmitter) {
    n.rec = std::min(n.rec + points, 255U);
    return;
  }
  n.tec += points;
  if (n.tec > 255) n.doing = Doing::off;
}

// kind: 'a' no acknowledgement, 's' stuff bit in arbitration, 'f' bit error within an active flag, '.' all else
void Bus::error(Node& n, char kind) {
  ++errors;
  const bool passive = is_passive(n) || n.listens_only;
  n.done = 0;
  n.after_error = true;
  n.doing = passive ? Doing::passive_flag : Doing::flag;
  n.ack_error_pending = kind == 'a' && passive;
  if (n.ack_error_pending || kind == 's') return;
  punish(n, n.was_transmitter || kind == 'f' ? 8 : 1);
}

void Bus::overload(Node& n) {
  n.done = 0;
  n.after_error = false;
  n.ack_error_pending = false;
  n.doing = n.listens_only ? Doing::passive_flag : Doing::overload_flag;
}

void Bus::transmit_bit(int index, bool dominant) {
  Node& n = nodes[static_cast<std::size_t>(index)];
  const bool mine = n.wire.dominant[n.at] != 0;
  const char part = n.wire.part[n.at];
  n.history.push_back(dominant ? 1 : 0);
  if (part == 'K') {
    if (!dominant) return error(n, 'a');
  } else if (mine != dominant) {
    if (!mine && part == 's') return error(n, 's');
    if (mine || part != 'A') return error(n, '.');
    n.doing = Doing::receiving;  // lost
    n.was_transmitter = false;
    n.reading = read(n.history);
    if (n.reading.stuff_error) error(n, '.');
    return;
  }
  if (++n.at < n.wire.dominant.size()) return;
  if (n.tec > 0) --n.tec;
  events.push_back({now + 1, index, true, n.queue[n.chosen].frame});
  n.queue.erase(n.queue.begin() + static_cast<std::ptrdiff_t>(n.chosen));
  n.doing = Doing::intermission;
  n.done = 0;
}

void Bus::receive_bit(int index, bool dominant) {
  Node& n = nodes[static_cast<std::size_t>(index)];
  const bool mine = level(n);
  n.history.push_back(dominant ? 1 : 0);
  if (!n.reading.delimiter) {
    n.reading = read(n.history);
    if (n.reading.stuff_error) error(n, '.');
    return;
  }
  const std::size_t place = n.history.size() - *n.reading.delimiter;  // 1 CRC delimiter, 2 ACK, 3 delimiter, 4..10 EOF
  if (place == 2) {
    if (mine && !dominant) return error(n, '.');
    if (mine && n.rec > 0) n.rec = n.rec > 127 ? 127 : n.rec - 1;
    return;
  }
  if (place == 10) {
    n.done = 0;
    n.doing = Doing::intermission;
    if (dominant) overload(n);
    return;
  }
  if (dominant || (place == 3 && !n.reading.crc_right)) return error(n, '.');
  if (place == 9) events.push_back({now + 2, index, false, n.reading.frame});
}

void Bus::hear(int index, bool dominant) {
  Node& n = nodes[static_cast<std::size_t>(index)];
  const auto follow = [&] {  // somebody's start of frame
    n.doing = Doing::receiving;
    n.was_transmitter = false;
    n.history.assign(1, 1);
    n.reading = {};
  };
  switch (n.doing) {
    case Doing::idle:
      n.was_transmitter = false;
      if (dominant) follow();
      return;
    case Doing::transmitting: return transmit_bit(index, dominant);
    case Doing::receiving: return receive_bit(index, dominant);
    case Doing::flag:
    case Doing::overload_flag:
      if (!dominant) return error(n, 'f');
      if (++n.done == 6) n.doing = Doing::waiting, n.dominant_after = 0;
      return;
    case Doing::passive_flag:
      if (dominant && n.ack_error_pending) {
        n.ack_error_pending = false;
        punish(n, 8);
        if (n.doing == Doing::off) return;
      }
      n.done = n.done > 0 && dominant == n.last_level ? n.done + 1 : 1;
      n.last_level = dominant;
      if (n.done == 6) n.doing = Doing::waiting, n.dominant_after = 0;
      return;
    case Doing::waiting:
      if (!dominant) {
        n.doing = Doing::delimiting;
        n.done = 1;
        return;
      }
      ++n.dominant_after;
      if (n.dominant_after == 1 && n.after_error && !n.was_transmitter) punish(n, 8);
      if (n.dominant_after % 8 == 0) punish(n, 8);
      return;
    case Doing::delimiting:
      if (dominant) return n.done == 7 ? overload(n) : error(n, '.');
      if (++n.done == 8) n.doing = Doing::intermission, n.done = 0;
      return;
    case Doing::intermission:
      if (dominant && n.done < 2) return overload(n);
      if (dominant) {
        const bool must_wait = n.was_transmitter && is_passive(n);
        follow();
        if (!must_wait && wants(n)) start(n, true);
      } else if (++n.done == 3) {
        n.doing = n.was_transmitter && is_passive(n) ? Doing::suspended : Doing::idle;
        n.done = 0;
        n.was_transmitter = false;
      }
      return;
    case Doing::suspended:
      if (dominant) return follow();
      if (++n.done == 8) n.doing = Doing::idle;
      return;
    case Doing::off: return;
  }
}

}  // namespace judge
