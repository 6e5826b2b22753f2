#include "berth/base/crc.hpp"

#include <zlib.h>

#include <array>
#include <cstddef>

namespace berth {
namespace {

// Table k holds the CRC of a byte with k bytes after it, so that eight bytes are one step ("slicing by 8").
constexpr std::size_t slices = 8;
constexpr auto crc16_tables = [] {
  std::array<std::array<std::uint16_t, 256>, slices> tables{};
  for (unsigned i = 0; i < 256; ++i) {
    auto crc = static_cast<std::uint16_t>(i << 8);
    for (int bit = 0; bit < 8; ++bit)
      crc = static_cast<std::uint16_t>((crc & 0x8000U) != 0 ? (crc << 1) ^ 0x1021 : crc << 1);
    tables[0][i] = crc;
  }
  for (std::size_t k = 1; k < slices; ++k) {
    for (unsigned i = 0; i < 256; ++i) {
      const auto before = tables[k - 1][i];
      tables[k][i] = static_cast<std::uint16_t>((before << 8) ^ tables[0][before >> 8]);
    }
  }
  return tables;
}();

}  // namespace

std::uint16_t crc16(std::span<const std::uint8_t> bytes, std::uint16_t crc) noexcept {
  const auto& t = crc16_tables;
  const std::uint8_t* at = bytes.data();
  std::size_t left = bytes.size();
  for (; left >= slices; left -= slices, at += slices) {
    const unsigned first = at[0] ^ (crc >> 8U);
    const unsigned second = at[1] ^ (crc & 0xFFU);
    crc = static_cast<std::uint16_t>(t[7][first] ^ t[6][second] ^ t[5][at[2]] ^ t[4][at[3]] ^ t[3][at[4]] ^
                                     t[2][at[5]] ^ t[1][at[6]] ^ t[0][at[7]]);
  }
  for (; left > 0; --left, ++at) {
    crc = static_cast<std::uint16_t>((crc << 8) ^ t[0][static_cast<std::uint8_t>((crc >> 8) ^ *at)]);
  }
  return crc;
}

std::uint32_t crc32(std::span<const std::uint8_t> bytes, std::uint32_t crc) noexcept {
  return static_cast<std::uint32_t>(::crc32_z(crc, bytes.data(), bytes.size()));
}

}  // namespace berth
