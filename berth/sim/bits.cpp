#include "berth/sim/bits.hpp"

#include <algorithm>

#include "berth/can/length.hpp"

namespace berth::sim {
namespace {

constexpr unsigned max_rec = 255;
constexpr unsigned base_rtr = 12;  // number of the RTR bit without stuffing, start of frame = 0
constexpr unsigned extended_rtr = 32;

struct Writer {
  Layout layout;
  unsigned raw = 0;
  unsigned run = 0;
  bool last = true;
  unsigned rtr;
  void plain(bool recessive) noexcept { layout.bits[layout.size++] = recessive ? Layout::recessive : std::uint8_t{0}; }
  void stuffed(std::uint32_t value, unsigned count) noexcept {
    while (count-- > 0) {
      const bool bit = ((value >> count) & 1U) != 0;
      const bool gives_way = raw > 0 && raw <= rtr;
      layout.bits[layout.size++] =
          static_cast<std::uint8_t>((bit ? Layout::recessive : 0U) | (gives_way ? Layout::arbitration : 0U));
      run = bit == last ? run + 1 : 1;
      last = bit;
      if (run == 5) {
        layout.bits[layout.size++] = static_cast<std::uint8_t>((bit ? 0U : Layout::recessive) | Layout::stuff |
                                                               (raw < rtr ? Layout::arbitration : 0U));
        run = 1;
        last = !bit;
      }
      ++raw;
    }
  }
};

// RRS is dominant, in the place of RTR.
Layout lay_out_fd(const can::Frame& frame) noexcept {
  Writer w{.layout = {}, .rtr = frame.extended ? extended_rtr : base_rtr};
  w.stuffed(0, 1);
  if (frame.extended) {
    w.stuffed(frame.id >> 18U, 11);
    w.stuffed(3, 2);
    w.stuffed(frame.id & 0x3FFFFU, 18);
    w.stuffed(0, 1);
  } else {
    w.stuffed(frame.id, 11);
    w.stuffed(0, 2);
  }
  w.plain(true);
  w.layout.bits[w.layout.size - 1] |= Layout::fd_format;
  return w.layout;
}

}  // namespace

Layout lay_out(const can::Frame& frame) noexcept {
  if (frame.fd) return lay_out_fd(frame);
  Writer w{.layout = {}, .rtr = frame.extended ? extended_rtr : base_rtr};
  w.stuffed(0, 1);
  if (frame.extended) {
    w.stuffed(frame.id >> 18U, 11);
    w.stuffed(3, 2);
    w.stuffed(frame.id & 0x3FFFFU, 18);
    w.stuffed(frame.remote ? 1 : 0, 1);
    w.stuffed(0, 2);
  } else {
    w.stuffed(frame.id, 11);
    w.stuffed(frame.remote ? 1 : 0, 1);
    w.stuffed(0, 2);
  }
  w.stuffed(frame.size, 4);
  for (const auto byte : frame.bytes()) w.stuffed(byte, 8);
  w.stuffed(can::crc15(frame), 15);
  for (int i = 0; i < 10; ++i) w.plain(true);  // CRC delimiter, ACK slot and delimiter, end-of-frame
  return w.layout;
}

void Decoder::begin() noexcept {
  count_ = end_ = run_ = 0;
  crc_ = 0;
  last_ = true;
  push(false);
}

Decoder::Outcome Decoder::push(bool recessive) noexcept {
  if (run_ == 5) {
    if (recessive == last_) return Outcome::stuff_error;
    run_ = 1;
    last_ = recessive;
  } else {
    run_ = recessive == last_ ? run_ + 1 : 1;
    last_ = recessive;
    raw(recessive);
  }
  return end_ != 0 && count_ == end_ && run_ < 5 ? Outcome::complete : Outcome::more;
}

void Decoder::raw(bool recessive) noexcept {
  raw_[count_++] = recessive ? 1 : 0;
  const bool top = ((crc_ & 0x4000U) != 0) != recessive;  // dividing by the CRC itself leaves 0
  crc_ = static_cast<std::uint16_t>(((crc_ << 1U) & 0x7FFFU) ^ (top ? 0x4599U : 0U));
  const bool extended = count_ > 13 && raw_[13] != 0;
  const unsigned dlc_at = extended ? 35 : 15;
  if (count_ != dlc_at + 4) return;
  const bool remote = raw_[extended ? extended_rtr : base_rtr] != 0;
  const unsigned bytes = remote ? 0 : std::min(field(dlc_at, 4), 8U);
  end_ = count_ + 8 * bytes + 15;
}

// The bit's number does not count stuff bits; start of frame = 0.
can::ErrorPlace Decoder::place() const noexcept {
  using can::ErrorPlace;
  const unsigned bit = count_;
  if (bit == 0) return ErrorPlace::start;
  if (bit <= 8) return ErrorPlace::id28_21;
  if (bit <= 11) return ErrorPlace::id20_18;
  if (bit == base_rtr) return ErrorPlace::srr;
  if (bit == 13) return ErrorPlace::ide;
  const bool extended = raw_[13] != 0;
  const unsigned dlc_at = extended ? 35 : 15;
  if (extended && bit <= 18) return ErrorPlace::id17_13;
  if (extended && bit <= 26) return ErrorPlace::id12_5;
  if (extended && bit <= 31) return ErrorPlace::id4_0;
  if (extended && bit == extended_rtr) return ErrorPlace::rtr;
  if (extended && bit == 33) return ErrorPlace::reserved1;
  if (bit < dlc_at) return ErrorPlace::reserved0;
  if (bit < dlc_at + 4) return ErrorPlace::dlc;
  return bit + 15 < end_ ? ErrorPlace::data : ErrorPlace::crc;
}

std::uint32_t Decoder::field(unsigned from, unsigned count) const noexcept {
  std::uint32_t value = 0;
  for (unsigned i = 0; i < count; ++i) value = (value << 1U) | raw_[from + i];
  return value;
}

can::Frame Decoder::frame() const noexcept {
  can::Frame f;
  f.extended = raw_[13] != 0;
  f.id = f.extended ? (field(1, 11) << 18U) | field(14, 18) : field(1, 11);
  f.remote = raw_[f.extended ? extended_rtr : base_rtr] != 0;
  const unsigned dlc_at = f.extended ? 35 : 15;
  f.size = static_cast<std::uint8_t>(std::min(field(dlc_at, 4), 8U));
  for (unsigned i = 0; i < f.bytes().size(); ++i) f.data[i] = static_cast<std::uint8_t>(field(dlc_at + 4 + 8 * i, 8));
  return f;
}

void BitNode::integrate(unsigned runs_to_see) noexcept {
  enter(Activity::integrating);
  runs = runs_to_see;
  transmitter = false;
}

void BitNode::begin_receiving() noexcept {
  enter(Activity::frame);
  transmitter = false;
  decoder_.begin();
}

void BitNode::begin_sending(const can::Frame& frame, bool behind_start) noexcept {
  layout_ = lay_out(frame);
  enter(Activity::frame);
  transmitter = true;
  position_ = behind_start ? 1 : 0;
  if (behind_start) decoder_.begin();
}

bool BitNode::drives() const noexcept {
  switch (activity) {
    case Activity::frame: return transmitter && (layout_.bits[position_] & Layout::recessive) == 0;
    case Activity::tail: return !transmitter && count == 1 && !crc_bad_ && !listen_only;
    case Activity::active_flag:
    case Activity::overload_flag: return true;
    default: return false;
  }
}

BitNode::Outcome BitNode::sample(bool dominant) noexcept {
  Outcome outcome;
  switch (activity) {
    case Activity::idle:
      if (dominant) begin_receiving();
      break;
    case Activity::frame: in_frame(dominant, outcome); break;
    case Activity::tail: in_tail(dominant, outcome); break;
    case Activity::active_flag:
    case Activity::overload_flag: in_flag(dominant, outcome); break;
    case Activity::passive_flag: in_passive_flag(dominant, outcome); break;
    case Activity::after_flag: after_flag(dominant, outcome); break;
    case Activity::delimiter: in_delimiter(dominant, outcome); break;
    case Activity::intermission: in_intermission(dominant, outcome); break;
    case Activity::suspend:
      if (dominant) {
        begin_receiving();
      } else if (++count == 8) {
        enter(Activity::idle);
      }
      break;
    case Activity::integrating:
      count = dominant ? 0 : count + 1;
      if (count == 11) {
        count = 0;
        if (--runs > 0) break;
        enter(Activity::idle);
        outcome.took_part = true;
        outcome.counters = bus_off;
        if (bus_off) tec = rec = 0;
        bus_off = false;
      }
      break;
    case Activity::off: break;
  }
  return outcome;
}

void BitNode::in_frame(bool dominant, Outcome& outcome) noexcept {
  if (transmitter) {
    const auto bit = layout_.bits[position_];
    const bool sends_dominant = (bit & Layout::recessive) == 0;
    if (sends_dominant != dominant) {
      const bool gives_way = !sends_dominant && (bit & Layout::arbitration) != 0;
      if (!gives_way || (bit & Layout::stuff) != 0) {
        const auto bit_error = sends_dominant ? can::ErrorKind::dominant : can::ErrorKind::recessive;
        return fail(outcome, gives_way ? can::ErrorKind::stuff : bit_error,
                    gives_way ? Cause::stuff_in_arbitration : Cause::other);
      }
      transmitter = false;
      outcome.lost = true;
    } else if ((bit & Layout::fd_format) != 0) {
      outcome.fd_destroyed = true;
      return fail(outcome, can::ErrorKind::other, Cause::no_acknowledge);
    }
    if (position_++ == 0) {
      decoder_.begin();
      return;
    }
  }
  const auto progress = decoder_.push(!dominant);
  if (progress == Decoder::Outcome::stuff_error) return fail(outcome, can::ErrorKind::stuff);
  if (progress == Decoder::Outcome::complete) {
    crc_bad_ = !decoder_.crc_matches();
    enter(Activity::tail);
  }
}

// Bit 0 CRC delimiter, 1 ACK slot, 2 ACK delimiter, 3 to 9 end-of-frame.
void BitNode::in_tail(bool dominant, Outcome& outcome) noexcept {
  const unsigned bit = count++;
  if (bit == 1) {
    if (transmitter) {
      if (!dominant) fail(outcome, can::ErrorKind::other, Cause::no_acknowledge);
    } else if (!crc_bad_ && !listen_only) {
      if (!dominant) return fail(outcome, can::ErrorKind::dominant);
      if (rec == 0) return;
      rec = rec > 127 ? std::uint16_t{127} : static_cast<std::uint16_t>(rec - 1);
      outcome.counters = true;
    }
    return;
  }
  if (dominant && (transmitter || bit < 9)) return fail(outcome, can::ErrorKind::form);
  if (bit == 2 && !transmitter && crc_bad_) return fail(outcome, can::ErrorKind::other);
  if (bit == 8) outcome.accepted = !transmitter;
  if (bit < 9) return;
  if (dominant) return begin_overload(outcome);
  if (transmitter) {
    outcome.sent = true;
    outcome.counters = tec > 0;
    if (tec > 0) --tec;
  }
  enter(Activity::intermission);
}

void BitNode::more_errors(unsigned by, Outcome& outcome) noexcept {
  if (listen_only) return;
  outcome.counters = true;
  if (!transmitter) {
    rec = static_cast<std::uint16_t>(std::min(max_rec, rec + by));
    return;
  }
  tec = static_cast<std::uint16_t>(tec + by);
  if (tec <= 255) return;
  bus_off = true;
  transmitter = false;
  enter(Activity::off);
}

// Rules 1 and 3. The condition that makes the node passive is still signalled actively.
void BitNode::fail(Outcome& outcome, can::ErrorKind kind, Cause cause) noexcept {
  const bool was_passive = passive() || listen_only;
  outcome.failed = true;
  outcome.unacknowledged = cause == Cause::no_acknowledge;
  outcome.kind = kind;
  outcome.place = place();
  outcome.as_transmitter = transmitter;
  error_ = true;
  unacknowledged_ = transmitter && was_passive && cause == Cause::no_acknowledge;
  enter(was_passive ? Activity::passive_flag : Activity::active_flag);
  const bool exempt = unacknowledged_ || (transmitter && cause == Cause::stuff_in_arbitration);
  if (!exempt) more_errors(transmitter ? 8 : 1, outcome);
}

// The place of the bit that was just sampled. A wrong CRC is signalled after the ACK delimiter.
can::ErrorPlace BitNode::place() const noexcept {
  using can::ErrorPlace;
  if (activity == Activity::frame) return transmitter && position_ == 0 ? ErrorPlace::start : decoder_.place();
  if (activity != Activity::tail) return ErrorPlace::unknown;
  const unsigned bit = count - 1;
  if (bit == 0) return ErrorPlace::crc_delimiter;
  if (bit == 1) return ErrorPlace::acknowledge;
  if (bit == 2) return crc_bad_ ? ErrorPlace::crc : ErrorPlace::acknowledge_delimiter;
  return ErrorPlace::end_of_frame;
}

void BitNode::begin_overload(Outcome& outcome) noexcept {
  outcome.overload = true;
  error_ = false;
  unacknowledged_ = false;
  enter(listen_only ? Activity::passive_flag : Activity::overload_flag);
}

void BitNode::in_flag(bool dominant, Outcome& outcome) noexcept {
  if (!dominant) {  // rules 4 and 5: a bit error within the flag
    const bool was_passive = passive();
    outcome.failed = true;
    outcome.as_transmitter = transmitter;
    error_ = true;
    enter(was_passive ? Activity::passive_flag : Activity::active_flag);
    return more_errors(8, outcome);
  }
  if (++count < 6) return;
  enter(Activity::after_flag);
  after_ = 0;
}

// Complete after six equal bits in a row, whatever the others do meanwhile.
void BitNode::in_passive_flag(bool dominant, Outcome& outcome) noexcept {
  if (dominant && unacknowledged_) {
    unacknowledged_ = false;
    more_errors(8, outcome);
    if (activity == Activity::off) return;
  }
  count = count > 0 && run_level_ == dominant ? count + 1 : 1;
  run_level_ = dominant;
  if (count < 6) return;
  unacknowledged_ = false;
  enter(Activity::after_flag);
  after_ = 0;
}

void BitNode::after_flag(bool dominant, Outcome& outcome) noexcept {
  if (!dominant) {
    enter(Activity::delimiter);
    count = 1;
    return;
  }
  ++after_;
  if (after_ == 1 && error_ && !transmitter) more_errors(8, outcome);  // rule 2
  if (after_ % 8 == 0) more_errors(8, outcome);                        // rule 6
}

void BitNode::in_delimiter(bool dominant, Outcome& outcome) noexcept {
  if (dominant) return count == 7 ? begin_overload(outcome) : fail(outcome, can::ErrorKind::form);
  if (++count == 8) enter(Activity::intermission);
}

void BitNode::in_intermission(bool dominant, Outcome& outcome) noexcept {
  const bool suspends = transmitter && passive();
  if (dominant && count < 2) return begin_overload(outcome);
  if (dominant) {
    begin_receiving();
    outcome.start = !suspends;
  } else if (++count == 3) {
    enter(suspends ? Activity::suspend : Activity::idle);
    transmitter = false;
  }
}

}  // namespace berth::sim
