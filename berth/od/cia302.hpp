/// Objects of CiA 302 that several rooms use: parts 2 (NMT master), 3 (configuration manager, programs), 5 (SDO
/// manager).
#pragma once

#include <cstdint>

namespace berth::od::cia302 {

/// @name Configuration manager; the sub-index is a node-ID.
/// @{
inline constexpr std::uint16_t store_dcf = 0x1F20;
inline constexpr std::uint16_t dcf_format = 0x1F21;
inline constexpr std::uint16_t concise_dcf = 0x1F22;
inline constexpr std::uint16_t store_eds = 0x1F23;
inline constexpr std::uint16_t eds_format = 0x1F24;
inline constexpr std::uint16_t request_configuration = 0x1F25;
inline constexpr std::uint16_t configuration_date = 0x1F26;  ///< expected, as 1020h:01 of the slave
inline constexpr std::uint16_t configuration_time = 0x1F27;  ///< expected, as 1020h:02
/// @}

/// @name Programs of a device; the sub-index is a program's number.
/// @{
inline constexpr std::uint16_t program_data = 0x1F50;
inline constexpr std::uint16_t program_control = 0x1F51;
inline constexpr std::uint16_t program_date = 0x1F52;  ///< sub-index 1: days since 1984-01-01; 2: milliseconds
inline constexpr std::uint16_t program_identification = 0x1F56;
inline constexpr std::uint16_t flash_status = 0x1F57;
/// @}

/// @name Programs that an NMT master expects and downloads; the sub-index is a node-ID.
/// @{
inline constexpr std::uint16_t expected_program_date = 0x1F53;
inline constexpr std::uint16_t expected_program_time = 0x1F54;
inline constexpr std::uint16_t expected_program = 0x1F55;  ///< the identification, as 1F56h of the slave
inline constexpr std::uint16_t program_of_slave = 0x1F58;
/// @}

/// @name NMT master; the sub-index is a node-ID, except for 1F80h and 1F89h.
/// @{
inline constexpr std::uint16_t nmt_startup = 0x1F80;
inline constexpr std::uint16_t slave_assignment = 0x1F81;
inline constexpr std::uint16_t request_nmt = 0x1F82;
inline constexpr std::uint16_t request_guarding = 0x1F83;
inline constexpr std::uint16_t expected_type = 0x1F84;
inline constexpr std::uint16_t expected_vendor = 0x1F85;
inline constexpr std::uint16_t expected_product = 0x1F86;
inline constexpr std::uint16_t expected_revision = 0x1F87;
inline constexpr std::uint16_t expected_serial = 0x1F88;
inline constexpr std::uint16_t boot_time = 0x1F89;
inline constexpr std::uint16_t restore_configuration = 0x1F8A;
/// @}

/// @name SDO manager (part 5); the sub-index of 1F10h is the client's node-ID.
/// @{
inline constexpr std::uint16_t request_sdo = 0x1F00;
inline constexpr std::uint16_t release_sdo = 0x1F01;
inline constexpr std::uint16_t connection_state = 0x1F10;
/// @}

/// Sub-index of 1F25h, 1F82h and 1F83h for all nodes.
inline constexpr std::uint8_t all_nodes = 0x80;

}  // namespace berth::od::cia302
