#include "berth/nodeid/rand_frames.hpp"

#include <array>

#include "berth/base/crc.hpp"

namespace berth::nodeid {
namespace {

constexpr std::uint8_t cs_rand_identify = 0x80;
constexpr std::uint8_t cs_rand_global = 0x81;
constexpr std::uint8_t cs_rand_selective = 0x82;  // and the next three
constexpr std::uint8_t cs_rand_resume = 0x86;
// Byte 1 of a selective frame: 0 is the paper's service, so that a plain frame works as in the paper.
constexpr std::uint8_t to_identified = 0;
constexpr std::uint8_t to_unknown = 1;

can::Frame masked(unsigned phase, std::uint16_t mask) noexcept {
  return can::Frame::ext(rand_request_id, {cs_rand_identify, static_cast<std::uint8_t>(phase),
                                           static_cast<std::uint8_t>(mask >> 8), static_cast<std::uint8_t>(mask)});
}

bool zero_from(const can::Frame& frame, unsigned from) noexcept {
  for (unsigned i = from; i < frame.size; ++i) {
    if (frame.data[i] != 0) return false;
  }
  return true;
}

std::optional<RandRequest> decode_selective(const can::Frame& frame) noexcept {
  const auto& d = frame.data;
  if (frame.size != 8 || d[1] > to_unknown || d[2] != 0 || d[3] != 0) return std::nullopt;
  RandRequest r{.kind = RandRequest::Kind::switch_selective};
  r.target = d[1] == to_identified ? Identification::identified : Identification::unknown;
  r.part = static_cast<std::uint8_t>(d[0] - cs_rand_selective);
  for (unsigned i = 4; i < 8; ++i) r.value = r.value << 8 | d[i];
  return r;
}

std::optional<RandRequest> decode_resume(const can::Frame& frame) noexcept {
  const auto& d = frame.data;
  if (frame.size != 8 || d[1] > direct_phase) return std::nullopt;
  RandRequest r{.kind = RandRequest::Kind::resume, .phase = d[1]};
  r.mask = static_cast<std::uint16_t>(d[2] << 8 | d[3]);
  for (unsigned i = 4; i < 8; ++i) r.value = r.value << 8 | d[i];
  if (r.phase == 0 && (r.mask != 0 || r.value != 0)) return std::nullopt;
  return r;
}

}  // namespace

const char* name(Identification state) noexcept {
  switch (state) {
    case Identification::unknown: return "unknown";
    case Identification::identified: return "identified";
    case Identification::selected: return "selected";
  }
  return "?";
}

can::Frame iurs(unsigned phase, std::uint16_t mask) noexcept { return masked(phase, phase == 0 ? 0 : mask); }
can::Frame dirs(std::uint16_t mask) noexcept { return masked(direct_phase, mask); }
can::Frame ius(std::uint16_t chunk) noexcept {
  return can::Frame::ext(ius_id | static_cast<std::uint32_t>(chunk) << 2, {});
}
can::Frame dis(std::uint16_t chunk) noexcept {
  return can::Frame::ext(dis_id | static_cast<std::uint32_t>(chunk) << 2, {});
}

can::Frame switch_identification_global(Identification state) noexcept {
  return can::Frame::ext(rand_request_id, {cs_rand_global, static_cast<std::uint8_t>(state), 0, 0});
}

can::Frame switch_identification_selective(const LssAddress& address, unsigned part, Identification target) noexcept {
  const auto value = address.part(part);
  return can::Frame::ext(rand_request_id,
                         {static_cast<std::uint8_t>(cs_rand_selective + (part & 3U)),
                          target == Identification::unknown ? to_unknown : to_identified, 0, 0,
                          static_cast<std::uint8_t>(value >> 24), static_cast<std::uint8_t>(value >> 16),
                          static_cast<std::uint8_t>(value >> 8), static_cast<std::uint8_t>(value)});
}

std::uint32_t prefix_check(const LssAddress& address, unsigned chunks) noexcept {
  std::array<std::uint8_t, 16> bytes{};
  for (unsigned i = 0; i < chunks && i < 8; ++i) {
    bytes[2 * i] = static_cast<std::uint8_t>(address.chunk(i) >> 8);
    bytes[2 * i + 1] = static_cast<std::uint8_t>(address.chunk(i));
  }
  return chunks == 0 ? 0 : crc32(std::span(bytes).first(2 * chunks));
}

can::Frame resume_request(unsigned phase, const LssAddress& address) noexcept {
  const auto mask = phase == 0 ? std::uint16_t{0} : address.chunk(phase - 1);
  const auto check = phase == 0 ? 0U : prefix_check(address, phase - 1);
  return can::Frame::ext(
      rand_request_id,
      {cs_rand_resume, static_cast<std::uint8_t>(phase), static_cast<std::uint8_t>(mask >> 8),
       static_cast<std::uint8_t>(mask), static_cast<std::uint8_t>(check >> 24), static_cast<std::uint8_t>(check >> 16),
       static_cast<std::uint8_t>(check >> 8), static_cast<std::uint8_t>(check)});
}

std::optional<RandRequest> decode_rand_request(const can::Frame& frame) noexcept {
  if (frame.key() != rand_requests.first || frame.remote || frame.fd) return std::nullopt;
  const auto& d = frame.data;
  if (frame.size == 8 && d[0] >= cs_rand_selective && d[0] < cs_rand_selective + 4) return decode_selective(frame);
  if (frame.size == 8 && d[0] == cs_rand_resume) return decode_resume(frame);
  if ((frame.size != 4 && frame.size != 8) || !zero_from(frame, 4)) return std::nullopt;
  RandRequest r;
  if (d[0] == cs_rand_identify && d[1] <= direct_phase) {
    r.kind = d[1] == direct_phase ? RandRequest::Kind::direct : RandRequest::Kind::identify;
    r.phase = d[1];
    r.mask = static_cast<std::uint16_t>(d[2] << 8 | d[3]);
    return r;
  }
  if (d[0] == cs_rand_global && d[1] <= 1 && d[2] == 0 && d[3] == 0) {
    r.kind = RandRequest::Kind::switch_global;
    r.target = static_cast<Identification>(d[1]);
    return r;
  }
  return std::nullopt;
}

std::optional<RandAnswer> decode_rand_answer(const can::Frame& frame) noexcept {
  if (!frame.extended || frame.remote || frame.fd || (frame.id & 3U) != 0) return std::nullopt;
  const auto chunk = static_cast<std::uint16_t>((frame.id >> 2) & 0xFFFFU);
  const auto prefix = frame.id & ~0x3'FFFFU;
  if (prefix == ius_id) return RandAnswer{.direct = false, .chunk = chunk};
  if (prefix == dis_id) return RandAnswer{.direct = true, .chunk = chunk};
  return std::nullopt;
}

}  // namespace berth::nodeid
