#include "bit_model.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

namespace judge {
namespace {

bool is_passive(const Node& n) { return n.tec >= 128 || n.rec >= 128; }

bool is_quiet(const Node& n) {
  return n.doing == Doing::idle || n.doing == Doing::suspended || n.doing == Doing::integrating ||
         n.doing == Doing::off;
}

Time sample_point(Time bit) { return bit * 7 / 8; }

// The arbitration field without stuff bits, recessive bits as ones; IDE of a base frame belongs to it.
std::vector<char> priority(const Frame& f) {
  std::vector<char> bits;
  const auto append = [&](std::uint32_t value, int count) {
    for (int i = count - 1; i >= 0; --i) bits.push_back(static_cast<char>(value >> i & 1U));
  };
  const std::uint32_t rtr = f.remote ? 1 : 0;
  append(f.extended ? f.id >> 18 : f.id, 11);
  if (f.extended) append(3, 2), append(f.id, 18), append(rtr, 1);
  if (!f.extended) append(rtr, 1), append(0, 20);
  return bits;
}

}  // namespace

// ---- time ----

std::vector<int> Bus::on(int segment) const {
  std::vector<int> all;
  for (int i = 0; i < static_cast<int>(nodes.size()); ++i) {
    const Node& n = nodes[static_cast<std::size_t>(i)];
    if (n.powered && n.segment == segment) all.push_back(i);
  }
  return all;
}

bool Bus::silent(int segment) const {
  return std::ranges::all_of(nodes, [&](const Node& n) { return !n.powered || n.segment != segment || is_quiet(n); });
}

bool Bus::one_rate(int segment) const {
  const auto all = on(segment);
  const auto bit = [&](int i) { return nodes[static_cast<std::size_t>(i)].bit; };
  return std::ranges::all_of(all, [&](int i) { return bit(i) == bit(all.front()); });
}

bool Bus::wants(const Node& n) { return n.powered && n.doing == Doing::idle && !n.listens_only && !n.queue.empty(); }

Time Bus::next() const {
  Time first = std::numeric_limits<Time>::max();
  const auto consider = [&](Time t) {
    if (t > now) first = std::min(first, t);
  };
  if (!acts_.empty()) consider(acts_.begin()->first);
  for (const auto& n : nodes) {
    if (!n.powered) continue;
    const auto wave = waves_.find(n.segment);
    if (wave != waves_.end() && wave->second.whole_until > now) {
      consider(wave->second.whole_until);
      continue;
    }
    consider(n.start);
    consider(n.start + sample_point(n.bit));
    if (wants(n)) consider(n.free_from);
  }
  return first;
}

void Bus::run(Time until) {
  now = -1;
  for (Time t = 0; t <= until; t = next()) {
    now = t;
    for (auto due = acts_.begin(); due != acts_.end() && due->first <= now; due = acts_.erase(due)) due->second(*this);
    end_whole();
    begin_frames();
    sample();
  }
}

// ---- what happens to nodes ----

void Bus::send(int node, const Frame& frame) {
  Node& n = nodes[static_cast<std::size_t>(node)];
  if (n.powered && !n.bus_off && !n.listens_only) n.queue.push_back(frame);
}

// Rule 4.
void Bus::leave(int index, bool loses_power) {
  Node& n = nodes[static_cast<std::size_t>(index)];
  std::erase_if(events, [&](const Event& e) { return e.node == index && e.end >= now && (!e.sent || loses_power); });
  n.before = false;
  n.was_transmitter = false;
}

// On a segment that is not silent the node takes over the clock of its rate.
void Bus::integrate(Node& n, unsigned runs) {
  n.doing = Doing::off;
  n.done = 0;
  n.start = now;
  if (!silent(n.segment)) {
    for (const auto& other : nodes) {
      if (&other != &n && other.powered && other.segment == n.segment && other.bit == n.bit) n.start = other.start;
    }
  }
  n.doing = Doing::integrating;
  n.runs = runs;
}

void Bus::power(int node, bool on) {
  Node& n = nodes[static_cast<std::size_t>(node)];
  if (n.powered == on) return;
  leave(node, true);
  n.queue.clear();
  n.tec = n.rec = 0;
  n.bus_off = false;
  n.powered = on;
  n.doing = Doing::off;
  if (on) integrate(n, 1);
}

void Bus::restart(int node) {
  Node& n = nodes[static_cast<std::size_t>(node)];
  if (!n.powered) return;
  leave(node, false);
  n.queue.clear();
  n.tec = n.rec = 0;
  integrate(n, n.bus_off ? runs_to_recover : 1);
}

void Bus::set_bit(int node, Time bit) {
  Node& n = nodes[static_cast<std::size_t>(node)];
  if (n.bit == bit) return;
  leave(node, false);
  n.bit = bit;
  if (n.powered && !n.bus_off) integrate(n, 1);
}

void Bus::move(int node, int segment) {
  Node& n = nodes[static_cast<std::size_t>(node)];
  const Wave from = waves_[n.segment];
  const bool was_silent = silent(n.segment);
  if (on(segment).empty()) {
    waves_[segment] = {};
    if (!was_silent) waves_[segment].origin = from.origin;
  }
  n.segment = segment;
}

// ---- beginnings ----

// Disturbances that wait for a frame of this segment belong to it now.
void Bus::count_frame(int segment, Time when, bool from_silence) {
  Wave& wave = waves_[segment];
  wave.origin = when;
  wave.from_silence = from_silence;
  wave.live = true;
  wave.of_fd = wave.struck = false;
  wave.flips.clear();
  ++frames;
  std::erase_if(planned_, [&](const Flip& f) {
    if (f.from > when || nodes[static_cast<std::size_t>(f.node)].segment != segment) return false;
    wave.struck = true;
    if (const std::pair place{f.bit, f.node}; !wave.flips.insert(place).second) wave.flips.erase(place);
    return true;
  });
}

void Bus::start(Node& n, bool behind_start_bit) {
  n.chosen = 0;
  for (std::size_t i = 0; n.by_priority && i < n.queue.size(); ++i) {
    if (priority(n.queue[i]) < priority(n.queue[n.chosen])) n.chosen = i;
  }
  Frame& frame = n.queue[n.chosen];
  n.wire = encode(frame);
  n.doing = Doing::transmitting;
  n.was_transmitter = true;
  n.at = behind_start_bit ? 1 : 0;
  n.reading = {};
  if (behind_start_bit) n.reading.push(true);
}

void Bus::begin_on_silent(int segment) {
  const auto all = on(segment);
  const auto ready = [&](int i) {
    const Node& n = nodes[static_cast<std::size_t>(i)];
    return wants(n) && n.free_from <= now;
  };
  if (std::ranges::none_of(all, ready)) return;
  count_frame(segment, now, true);
  Time fastest = std::numeric_limits<Time>::max();
  for (const int i : all) {
    Node& n = nodes[static_cast<std::size_t>(i)];
    n.start = now;
    n.before = false;
    fastest = std::min(fastest, n.bit);
  }
  waves_[segment].open_until = now + sample_point(fastest);
}

void Bus::begin_at_edges(int segment) {
  Wave& wave = waves_[segment];
  const bool alike = one_rate(segment);
  for (const int i : on(segment)) {
    Node& n = nodes[static_cast<std::size_t>(i)];
    if (!wants(n) || n.free_from > now) continue;
    const bool joins = n.start == wave.origin && now <= wave.open_until;
    const bool begins = !joins && (alike ? n.start <= now : n.start == now);
    if (!joins && !begins) continue;
    if (begins && wave.origin != n.start) {
      count_frame(segment, n.start, false);
      for (const int k : on(segment)) {  // rule 1
        const Time rate = nodes[static_cast<std::size_t>(k)].bit;
        const auto quiet = [&](const Node& other) {
          return !other.powered || other.segment != segment || other.bit != rate || is_quiet(other);
        };
        if (rate != n.bit && std::ranges::all_of(nodes, quiet)) nodes[static_cast<std::size_t>(k)].start = n.start;
      }
    }
    start(n, false);
  }
  // Disturbances that concern an FD frame destroy it, and strike nothing else: rule 3.
  const Frame* first = nullptr;
  for (const int i : on(segment)) {
    const Node& n = nodes[static_cast<std::size_t>(i)];
    if (n.doing != Doing::transmitting || n.at > 0) continue;
    const Frame& frame = n.queue[n.chosen];
    if (first == nullptr || priority(frame) < priority(*first)) first = &frame;
  }
  if (first != nullptr) wave.of_fd = first->fd;
}

void Bus::begin_frames() {
  if (std::ranges::none_of(nodes, wants)) return;
  std::set<int> segments;
  for (const auto& n : nodes) segments.insert(n.segment);
  for (const int segment : segments) {
    if (waves_[segment].whole_until >= 0) continue;
    if (silent(segment)) {
      begin_on_silent(segment);
      if (waves_[segment].origin != now) continue;
    }
    begin_at_edges(segment);
  }
}

// ---- levels ----

bool Bus::level(const Node& n) const {
  if (!n.powered) return false;
  switch (n.doing) {
    case Doing::transmitting: return n.wire.dominant[n.at] != 0;
    case Doing::receiving:  // the ACK slot stands behind the CRC delimiter
      return n.reading.delimiter && n.reading.count == *n.reading.delimiter + 1 && n.reading.crc_right &&
             !n.listens_only;
    case Doing::flag:
    case Doing::overload_flag: return !n.listens_only;
    default: return false;
  }
}

// Behind its sample point a node still drives the bit that it sampled.
bool Bus::wire(int segment) const {
  return std::ranges::any_of(
      nodes, [&](const Node& n) { return n.powered && n.segment == segment && (now < n.start ? n.before : level(n)); });
}

void Bus::sample() {
  std::vector<std::pair<int, bool>> seen;
  for (int i = 0; i < static_cast<int>(nodes.size()); ++i) {
    Node& n = nodes[static_cast<std::size_t>(i)];
    Wave& wave = waves_[n.segment];
    if (!n.powered || n.start + sample_point(n.bit) != now || wave.whole_until >= 0) continue;
    const bool turned =
        wave.live && !wave.of_fd && wave.flips.contains({static_cast<int>((n.start - wave.origin) / n.bit), i});
    seen.emplace_back(i, wire(n.segment) != turned);
  }
  std::set<int> busy;
  for (auto& [segment, wave] : waves_) wave.passes = passes_whole(segment);  // before any of them has heard FDF
  for (const auto& [i, dominant] : seen) {
    Node& n = nodes[static_cast<std::size_t>(i)];
    if (!silent(n.segment)) busy.insert(n.segment);
    n.before = level(n);
    hear(i, dominant);
    n.start += n.bit;
  }
  for (const auto& [i, dominant] : seen) {
    const int segment = nodes[static_cast<std::size_t>(i)].segment;
    const Wave& wave = waves_[segment];
    if ((busy.contains(segment) || wave.live) && silent(segment) && wave.whole_until < 0) fall_silent(segment);
  }
}

// Rule 1: the next frame begins when the bits that were sampled are over.
void Bus::fall_silent(int segment) {
  Time over = 0;
  for (const int i : on(segment)) over = std::max(over, nodes[static_cast<std::size_t>(i)].start);
  for (const int i : on(segment)) {
    Node& n = nodes[static_cast<std::size_t>(i)];
    n.free_from = std::max(n.free_from, over);
  }
  waves_[segment].live = false;
}

void Bus::fall_idle(Node& n) {
  n.doing = Doing::idle;
  n.done = 0;
  n.free_from = n.start + n.bit;
}

// ---- FD frames that pass whole: rule 3 ----

bool Bus::passes_whole(int segment) const {
  const Wave& wave = waves_.at(segment);
  if (fast_bit_ == 0) return false;
  if (!wave.from_silence || wave.struck) return false;
  const Frame* first = nullptr;
  bool esi = false;
  bool heard = false;
  for (const int i : on(segment)) {
    const Node& n = nodes[static_cast<std::size_t>(i)];
    if (n.doing != Doing::transmitting) {
      heard = heard || (n.doing == Doing::receiving && !n.listens_only);
      continue;
    }
    const Frame& frame = n.queue[n.chosen];
    if (first != nullptr && (*first != frame || esi != is_passive(n))) return false;
    first = &frame;
    esi = is_passive(n);
  }
  return first != nullptr && heard;
}

void Bus::end_whole() {
  for (auto& [segment, wave] : waves_) {
    if (wave.whole_until != now) continue;
    wave.whole_until = -1;
    for (const int i : on(segment)) {
      Node& n = nodes[static_cast<std::size_t>(i)];
      n.start = now;
      n.before = false;
      if (n.doing == Doing::integrating) {
        n.done = 8;  // ACK delimiter and end-of-frame
        continue;
      }
      const bool sent = std::ranges::find(wave.whole_senders, i) != wave.whole_senders.end();
      if (n.doing != Doing::receiving && !sent) continue;
      n.was_transmitter = sent;
      n.doing = Doing::intermission;
      n.done = 0;
      events.push_back({now, i, sent, wave.whole});
      if (sent) {
        if (n.tec > 0) --n.tec;
        n.queue.erase(n.queue.begin() + static_cast<std::ptrdiff_t>(n.chosen));
      } else if (!n.listens_only && n.rec > 0) {
        n.rec = n.rec > 127 ? 127 : n.rec - 1;
      }
    }
  }
}

// ---- what a bit means ----

void Bus::punish(Node& n, unsigned points) {
  if (n.listens_only) return;
  if (!n.was_transmitter) {
    n.rec = std::min(n.rec + points, 255U);
    return;
  }
  n.tec += points;
  if (n.tec <= 255) return;
  n.doing = Doing::off;
  n.bus_off = true;
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
  n.reading.push(dominant);
  if (part == 'K') {
    if (!dominant) return error(n, 'a');
  } else if (mine != dominant) {
    if (!mine && part == 's') return error(n, 's');
    if (mine || part != 'A') return error(n, '.');
    n.doing = Doing::receiving;  // lost
    n.was_transmitter = false;
    if (n.reading.stuff_error) error(n, '.');
    return;
  } else if (part == 'F') {
    Wave& wave = waves_[n.segment];
    if (wave.whole_until < 0) {
      if (!wave.passes) return error(n, 'a');
      wave.whole = n.queue[n.chosen];
      Frame sent = wave.whole;
      sent.esi = sent.esi || is_passive(n);
      const FdLength length = fd_length(sent);
      wave.whole_until = wave.origin + (length.nominal - 3) * n.bit + length.fast * fast_bit_;
      wave.whole_senders.clear();
      ++whole_fd;
    }
    wave.whole_senders.push_back(index);
    return;
  }
  if (++n.at < n.wire.dominant.size()) return;
  if (n.tec > 0) --n.tec;
  events.push_back({n.start + n.bit, index, true, n.queue[n.chosen]});
  n.queue.erase(n.queue.begin() + static_cast<std::ptrdiff_t>(n.chosen));
  n.doing = Doing::intermission;
  n.done = 0;
}

void Bus::receive_bit(int index, bool dominant) {
  Node& n = nodes[static_cast<std::size_t>(index)];
  const bool mine = level(n);
  const bool in_frame = !n.reading.delimiter;
  n.reading.push(dominant);
  if (in_frame) {
    if (n.reading.stuff_error) error(n, '.');
    return;
  }
  const std::size_t place = n.reading.count - *n.reading.delimiter;  // 1 CRC delimiter, 2 ACK, 3 delimiter, 4..10 EOF
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
  if (place == 9) events.push_back({n.start + 2 * n.bit, index, false, n.reading.frame});
}

// docs/protocols/can-frames.md §Fault confinement, rule 12; and what a node must see before it takes part.
void Bus::count_recessive(Node& n, bool dominant) {
  n.done = dominant ? 0 : n.done + 1;
  if (n.done < 11) return;
  n.done = 0;
  if (--n.runs > 0) return;
  if (n.bus_off) {
    n.bus_off = false;
    n.tec = n.rec = 0;
    ++recovered;
  }
  fall_idle(n);
}

void Bus::hear(int index, bool dominant) {
  Node& n = nodes[static_cast<std::size_t>(index)];
  const auto follow = [&] {  // somebody's start of frame
    n.doing = Doing::receiving;
    n.was_transmitter = false;
    n.reading = {};
    n.reading.push(true);
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
        if (must_wait || n.listens_only || n.queue.empty()) return;
        if (waves_[n.segment].origin < n.start) count_frame(n.segment, n.start, false);
        start(n, true);
      } else if (++n.done == 3) {
        const bool must_wait = n.was_transmitter && is_passive(n);
        fall_idle(n);
        if (must_wait) n.doing = Doing::suspended;
        n.was_transmitter = false;
      }
      return;
    case Doing::suspended:
      if (dominant) return follow();
      if (++n.done == 8) fall_idle(n);
      return;
    case Doing::integrating: return count_recessive(n, dominant);
    case Doing::off: return;
  }
}

}  // namespace judge
