/// Forms and names shared by the XDD reader and writer. Internal to room `eds`.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace berth::eds::xml {

/// `fileCreationDate` is mandatory; this value means "not known".
inline constexpr std::string_view no_date = "0001-01-01";

/// "2024-07-31" to "07-31-2024" and back; "" for anything else.
[[nodiscard]] std::string eds_date(std::string_view xml);
[[nodiscard]] std::string xml_date(std::string_view eds);
/// "18:55:18.0+02:00" to "06:55PM", "06:55PM" to "18:55:00"; "" for anything else.
[[nodiscard]] std::string eds_time(std::string_view xml);
[[nodiscard]] std::string xml_time(std::string_view eds);
/// "250 Kbps", "250" → 250.
[[nodiscard]] std::optional<std::uint16_t> kilobits(std::string_view text);

/// Names of characteristics for facts of an EDS that have no place in CiA 311.
inline constexpr std::string_view file_revision = "EDS file revision";
inline constexpr std::string_view eds_version = "EDS version";
inline constexpr std::string_view last_eds = "EDS of this configuration";
inline constexpr std::string_view comments = "EDS comments";
inline constexpr std::string_view revision_number = "Revision number";
inline constexpr std::string_view compact_pdo = "EDS CompactPDO";
inline constexpr std::string_view lss_serial_number = "LSS serial number";
inline constexpr std::string_view node_refd = "Node reference designation";
inline constexpr std::string_view written_by = "Written by";
inline constexpr std::string_view net_refd = "Network reference designation";

}  // namespace berth::eds::xml
