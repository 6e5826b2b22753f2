#include "berth/device/program_image.hpp"

#include <algorithm>
#include <cstring>

#include "berth/base/bytes.hpp"
#include "berth/base/crc.hpp"

namespace berth::device {
namespace {

constexpr std::array<std::uint8_t, 4> magic{'B', 'P', 'R', 'G'};
constexpr std::size_t checked_bytes = ProgramHead::size - 4;

}  // namespace

Result<ProgramHead> read_program_head(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() < ProgramHead::size) return fail(Errc::invalid, "shorter than the head of a program");
  if (!std::ranges::equal(bytes.first(magic.size()), magic)) return fail(Errc::invalid, "it does not begin with BPRG");
  if (crc32(bytes.first(checked_bytes)) != load_le<std::uint32_t>(bytes.data() + checked_bytes)) {
    return fail(Errc::invalid, "the CRC of its head is wrong");
  }
  const auto number = [&](std::size_t at) { return load_le<std::uint32_t>(bytes.data() + at); };
  return ProgramHead{
      .type = {number(4), number(8)}, .date = number(12), .time = number(16), .length = number(20), .crc = number(24)};
}

std::array<std::uint8_t, ProgramHead::size> write_program_head(const ProgramHead& head) noexcept {
  std::array<std::uint8_t, ProgramHead::size> bytes{};
  std::ranges::copy(magic, bytes.begin());
  const std::array numbers{head.type.vendor, head.type.product, head.date, head.time, head.length, head.crc};
  for (std::size_t i = 0; i < numbers.size(); ++i) store_le(bytes.data() + 4 * (i + 1), numbers[i]);
  store_le(bytes.data() + checked_bytes, crc32(std::span(bytes).first(checked_bytes)));
  return bytes;
}

std::vector<std::uint8_t> make_program_image(ProgramHead head, std::span<const std::uint8_t> content) {
  head.length = static_cast<std::uint32_t>(content.size());
  head.crc = crc32(content);
  const auto first = write_program_head(head);
  std::vector<std::uint8_t> image(first.size() + content.size());
  std::ranges::copy(content, std::ranges::copy(first, image.begin()).out);
  return image;
}

}  // namespace berth::device
