/// Indices of CiA 301 objects that several rooms use; those of PDOs are in pdo_objects.hpp.
#pragma once

#include <cstdint>

namespace berth::od {

[[nodiscard]] constexpr bool within(std::uint16_t index, std::uint16_t first, std::uint16_t last) noexcept {
  return index >= first && index <= last;
}

namespace cia301 {

/// @name SDO parameters (§7.5.2.33, §7.5.2.34).
/// @{
inline constexpr std::uint16_t default_server = 0x1200;
inline constexpr std::uint16_t first_server = 0x1201;  ///< of the additional servers
inline constexpr std::uint16_t last_server = 0x127F;
inline constexpr std::uint16_t first_client = 0x1280;
inline constexpr std::uint16_t last_client = 0x12FF;
[[nodiscard]] constexpr bool is_server(std::uint16_t index) noexcept {
  return within(index, default_server, last_server);
}
/// True for a server except the default one, or a client.
[[nodiscard]] constexpr bool is_additional_channel(std::uint16_t index) noexcept {
  return within(index, first_server, last_client);
}
/// @}

/// @name Lists of MPDOs (§7.5.2.41, §7.5.2.42).
/// @{
inline constexpr std::uint16_t first_scanner_list = 0x1FA0;
inline constexpr std::uint16_t first_dispatching_list = 0x1FD0;
inline constexpr unsigned most_mpdo_lists = 0x30;  ///< of each
[[nodiscard]] constexpr bool is_scanner_list(std::uint16_t index) noexcept {
  return index >= first_scanner_list && index < first_scanner_list + most_mpdo_lists;
}
/// @}

}  // namespace cia301
}  // namespace berth::od
