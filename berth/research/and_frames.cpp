#include "berth/research/and_frames.hpp"

#include <array>

namespace berth::research {
namespace {

constexpr std::uint8_t cs_and_identify = 0x80;
constexpr std::uint8_t cs_and_global = 0x81;
constexpr std::uint8_t cs_and_selective = 0x82;
constexpr std::uint8_t cs_and_inquire = 0x83;

constexpr std::array<std::uint8_t, 8> no_bytes{};

can::Frame request(std::uint8_t command, std::uint8_t second, AndAddress address = {}) noexcept {
  std::array<std::uint8_t, 8> data{command, second};
  for (unsigned i = 0; i < 6; ++i) data[2 + i] = static_cast<std::uint8_t>(address.value() >> (40 - 8 * i));
  return can::Frame::base(and_request_id, data);
}

constexpr void put_be(std::array<std::uint8_t, 8>& data, unsigned at, std::uint32_t value) noexcept {
  for (unsigned i = 0; i < 4; ++i) data[at + i] = static_cast<std::uint8_t>(value >> (24 - 8 * i));
}
constexpr std::uint32_t get_be(const can::Frame& frame, unsigned at) noexcept {
  std::uint32_t value = 0;
  for (unsigned i = 0; i < 4; ++i) value = value << 8 | frame.data[at + i];
  return value;
}

bool plain(const can::Frame& frame) noexcept {
  return !frame.extended && !frame.remote && !frame.fd && frame.size == 8;
}

}  // namespace

can::Frame and_iurs(unsigned phase, AndAddress prefix) noexcept {
  return request(cs_and_identify, static_cast<std::uint8_t>(phase), prefix.prefix(phase));
}
can::Frame and_dirs(AndAddress address) noexcept { return request(cs_and_identify, and_direct_phase, address); }
can::Frame and_switch_global(nodeid::Identification state) noexcept {
  return request(cs_and_global, static_cast<std::uint8_t>(state));
}
can::Frame and_switch_selective(AndAddress address, nodeid::Identification target) noexcept {
  return request(cs_and_selective, static_cast<std::uint8_t>(target), address);
}
can::Frame and_inquire(unsigned part) noexcept { return request(cs_and_inquire, static_cast<std::uint8_t>(part)); }

can::Frame and_ius(std::uint8_t nibble) noexcept { return can::Frame::base(and_ius_id + (nibble & 15U), no_bytes); }
can::Frame and_dis(std::uint8_t nibble) noexcept { return can::Frame::base(and_dis_id + (nibble & 15U), no_bytes); }
can::Frame and_address(const LssAddress& address, unsigned part) noexcept {
  std::array<std::uint8_t, 8> data{};
  put_be(data, 0, part == 0 ? address.vendor : address.revision);
  put_be(data, 4, part == 0 ? address.product : address.serial);
  return can::Frame::base(and_address_id + (part & 1U), data);
}

std::optional<AndRequest> decode_and_request(const can::Frame& frame) noexcept {
  if (frame.id != and_request_id || !plain(frame)) return std::nullopt;
  std::uint64_t value = 0;
  for (unsigned i = 2; i < 8; ++i) value = value << 8 | frame.data[i];
  const auto second = frame.data[1];
  AndRequest r{.phase = second, .address = AndAddress(value)};
  using Kind = AndRequest::Kind;
  switch (frame.data[0]) {
    case cs_and_identify:
      r.kind = second == and_direct_phase ? Kind::direct : Kind::identify;
      if (second > and_direct_phase || r.address.prefix(second) != r.address) return std::nullopt;
      return r;
    case cs_and_global:
    case cs_and_selective:
      r.kind = frame.data[0] == cs_and_global ? Kind::switch_global : Kind::switch_selective;
      if (second > 1 || (r.kind == Kind::switch_global && value != 0)) return std::nullopt;
      r.target = static_cast<nodeid::Identification>(second);
      return r;
    case cs_and_inquire:
      r.kind = Kind::inquire;
      if (second > 1 || value != 0) return std::nullopt;
      return r;
    default: return std::nullopt;
  }
}

std::optional<AndAnswer> decode_and_answer(const can::Frame& frame) noexcept {
  if (!plain(frame)) return std::nullopt;
  const auto nibble = static_cast<std::uint8_t>(frame.id & 15U);
  if ((frame.id & ~1U) == and_address_id) {
    return AndAnswer{
        .kind = AndAnswer::Kind::address, .nibble = nibble, .first = get_be(frame, 0), .second = get_be(frame, 4)};
  }
  if ((frame.id & ~15U) == and_ius_id) return AndAnswer{.kind = AndAnswer::Kind::ius, .nibble = nibble};
  if ((frame.id & ~15U) == and_dis_id) return AndAnswer{.kind = AndAnswer::Kind::dis, .nibble = nibble};
  return std::nullopt;
}

}  // namespace berth::research
