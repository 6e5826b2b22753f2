/// Checks whether a device description describes a device that works, beyond its form.
#pragma once

#include <string_view>

#include "berth/eds/file.hpp"

namespace berth::eds {

/// Findings about the content of the description; those of the reader are about its form:
/// - identity: 1018h against [DeviceInfo], whether the vendor-ID is given
/// - mandatory objects' types and access (CiA 301 §7.5.2), presence of heartbeat or guarding
/// - sub-index 0 of arrays and records: its type, its value against the highest sub-index
/// - COB-IDs: restricted CAN-IDs, the same CAN-ID for two purposes, COB-IDs that are not relative to the node-ID
/// - PDOs: communication and mapping parameter in pairs; mapping entries that name no object, no mappable one, one of
///   the wrong direction or length; more than 64 bits
/// - counts: NrOfRXPDO, NrOfTXPDO; bit rates; LSS and its requirements
/// `file_name` is only for the findings; `xml`: the text of an XDD, so that findings get its lines.
[[nodiscard]] Findings review(const File& file, std::string_view file_name, std::string_view xml = {});

}  // namespace berth::eds
