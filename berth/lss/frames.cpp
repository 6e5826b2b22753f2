#include "berth/lss/frames.hpp"

#include <algorithm>
#include <span>

namespace berth::lss {
namespace {

constexpr std::array<std::uint32_t, 10> table{1'000'000, 800'000, 500'000, 250'000, 125'000,
                                              0,         50'000,  20'000,  10'000,  0};

can::Frame frame(std::uint32_t cob_id, Command command, std::uint8_t byte1, std::uint8_t byte2) noexcept {
  can::Frame f = can::Frame::base(cob_id, {static_cast<std::uint8_t>(command), byte1, byte2, 0, 0, 0, 0, 0});
  return f;
}

can::Frame frame32(std::uint32_t cob_id, Command command, std::uint32_t value) noexcept {
  can::Frame f = frame(cob_id, command, 0, 0);
  store_le(f.data.data() + 1, value);
  return f;
}

// The bytes of an answer that carry information.
std::uint8_t telling_bytes(Command answer) noexcept {
  switch (answer) {
    case Command::selected:
    case Command::identified:
    case Command::non_configured: return 1;
    case Command::inquire_node_id: return 2;
    case Command::inquire_vendor:
    case Command::inquire_product:
    case Command::inquire_revision:
    case Command::inquire_serial: return 5;
    case Command::configure_node_id:
    case Command::configure_bit_timing:
    case Command::store: return 3;
    default: return 8;
  }
}

Command nth(Command first, unsigned i) noexcept { return static_cast<Command>(static_cast<std::uint8_t>(first) + i); }

}  // namespace

std::optional<std::uint32_t> bit_rate(BitRateIndex index) noexcept {
  const auto i = static_cast<unsigned>(index);
  if (i >= table.size() || index == BitRateIndex::reserved) return std::nullopt;
  return table[i];
}

std::optional<BitRateIndex> bit_rate_index(std::uint32_t bits_per_second) noexcept {
  if (bits_per_second == 0) return std::nullopt;
  for (unsigned i = 0; i < table.size(); ++i) {
    if (table[i] == bits_per_second) return static_cast<BitRateIndex>(i);
  }
  return std::nullopt;
}

std::optional<Lackable> lackable(Command request) noexcept {
  const auto in = [&](Command first, Command last) { return request >= first && request <= last; };
  if (in(Command::select_vendor, Command::select_serial)) return Lackable::select;
  if (in(Command::identify_vendor, Command::identify_non_configured)) return Lackable::identify;
  if (in(Command::inquire_vendor, Command::inquire_serial)) return Lackable::inquire_identity;
  switch (request) {
    case Command::inquire_node_id: return Lackable::inquire_node_id;
    case Command::configure_bit_timing: return Lackable::bit_timing;
    case Command::activate_bit_timing: return Lackable::activate;
    default: return std::nullopt;
  }
}

// Byte 2 of the answers to 11h, 13h and 17h is a manufacturer's code, and only after error 255.
bool is_answer(const can::Frame& frame) noexcept {
  if (is_lss(frame, slave_cob_id)) return true;
  const bool classic = frame.id == slave_cob_id && !frame.extended && !frame.remote && !frame.fd;
  if (!classic || frame.size == 0 || frame.size > 8) return false;
  const std::uint8_t telling = telling_bytes(command(frame));
  return frame.size >= (telling == 3 ? 2 : telling);
}

can::Frame whole_answer(const can::Frame& answer) noexcept {
  std::array<std::uint8_t, 8> bytes{};
  std::copy_n(answer.data.begin(), std::min<std::size_t>(answer.size, bytes.size()), bytes.begin());
  return can::Frame::base(slave_cob_id, bytes);
}

can::Frame short_answer(const can::Frame& answer) noexcept {
  return can::Frame::base(slave_cob_id, std::span(answer.data).first(telling_bytes(command(answer))));
}

can::Frame request(Command command) noexcept { return frame(master_cob_id, command, 0, 0); }
can::Frame request(Command command, std::uint8_t byte1, std::uint8_t byte2) noexcept {
  return frame(master_cob_id, command, byte1, byte2);
}
can::Frame request32(Command command, std::uint32_t value) noexcept { return frame32(master_cob_id, command, value); }

can::Frame request_activate(std::uint16_t delay_ms) noexcept {
  can::Frame f = request(Command::activate_bit_timing);
  store_le(f.data.data() + 1, delay_ms);
  return f;
}
can::Frame request_select(const LssAddress& address, unsigned i) noexcept {
  return request32(nth(Command::select_vendor, i), address.part(i));
}
can::Frame request_identify(const IdentifyRanges& ranges, unsigned i) noexcept {
  return request32(nth(Command::identify_vendor, i), ranges.value(i));
}

can::Frame request_fastscan(const FastscanRequest& request) noexcept {
  can::Frame f = request32(Command::fastscan, request.id);
  f.data[5] = request.bit_checked;
  f.data[6] = request.sub;
  f.data[7] = request.next;
  return f;
}

std::optional<FastscanRequest> decode_fastscan(const can::Frame& frame) noexcept {
  if (!is_lss(frame, master_cob_id) || command(frame) != Command::fastscan) return std::nullopt;
  const FastscanRequest r{
      .id = value32(frame), .bit_checked = frame.data[5], .sub = frame.data[6], .next = frame.data[7]};
  if (r.starts() || (r.bit_checked <= 31 && r.sub <= 3)) return r;
  return std::nullopt;
}

can::Frame feedback_frame(const FeedbackValue& feedback, std::uint16_t base) noexcept {
  if (feedback.kind == Feedback::base) return can::Frame::base(base + (feedback.value & 15U), {});
  return can::Frame::ext(extended_feedback.first + (feedback.toggle ? 0x1'0000U : 0U) + feedback.value, {});
}

std::optional<FeedbackValue> decode_feedback(const can::Frame& frame, std::uint16_t base) noexcept {
  if (frame.remote || frame.fd || frame.size != 0) return std::nullopt;
  if (extended_feedback.contains(frame.key())) {
    return FeedbackValue{Feedback::extended, (frame.id & 0x1'0000U) != 0, static_cast<std::uint16_t>(frame.id)};
  }
  if (base == 0 || !base_feedback(base).contains(frame.key())) return std::nullopt;
  return FeedbackValue{Feedback::base, false, static_cast<std::uint16_t>(frame.id - base)};
}

can::Frame answer(Command command) noexcept { return frame(slave_cob_id, command, 0, 0); }
can::Frame answer(Command command, std::uint8_t byte1, std::uint8_t byte2) noexcept {
  return frame(slave_cob_id, command, byte1, byte2);
}
can::Frame answer32(Command command, std::uint32_t value) noexcept { return frame32(slave_cob_id, command, value); }

}  // namespace berth::lss
