#include "berth/research/claim_frames.hpp"

#include <array>

namespace berth::research {

can::Frame claim(const Claim& claim) noexcept {
  std::array<std::uint8_t, 8> data{};
  for (unsigned i = 0; i < 8; ++i) data[i] = static_cast<std::uint8_t>(claim.name >> (8 * i));
  return can::Frame::ext(claim_id | claim.id, data);
}

can::Frame claim_request(std::uint8_t to, std::uint8_t from) noexcept {
  return can::Frame::ext(claim_request_id | static_cast<std::uint32_t>(to) << 8 | from, {0x00, 0xEE, 0x00});
}

std::optional<Claim> decode_claim(const can::Frame& frame) noexcept {
  if (!claims.contains(frame.key()) || frame.remote || frame.fd || frame.size != 8) return std::nullopt;
  Claim c{.id = static_cast<std::uint8_t>(frame.id)};
  if (c.id == 0 || (c.id > 127 && c.id != claim_nobody)) return std::nullopt;
  for (unsigned i = 8; i-- > 0;) c.name = c.name << 8 | frame.data[i];
  return c;
}

std::optional<std::uint8_t> decode_claim_request(const can::Frame& frame) noexcept {
  if (!claim_requests.contains(frame.key()) || frame.remote || frame.fd || frame.size != 3) return std::nullopt;
  if (frame.data[0] != 0x00 || frame.data[1] != 0xEE || frame.data[2] != 0x00) return std::nullopt;
  return static_cast<std::uint8_t>(frame.id >> 8);
}

}  // namespace berth::research
