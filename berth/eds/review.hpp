/// What an engineer checks in a device description beyond its form: is this a device that works?
#pragma once

#include <string_view>

#include "berth/eds/file.hpp"

namespace berth::eds {

/// Findings about what the description says, where the reader's are about how it is written:
/// - identity: 1018h against [DeviceInfo], the vendor-ID given at all
/// - mandatory objects' types and access (CiA 301 §7.5.2), heartbeat or guarding there
/// - sub-index 0 of arrays and records: its type, its value against the highest sub-index
/// - COB-IDs: restricted CAN-IDs, the same CAN-ID for two purposes, COB-IDs that are not relative to the node-ID
/// - PDOs: communication and mapping parameter in pairs; mapping entries that name no object, no mappable one, one of
///   the wrong direction or length; more than 64 bits
/// - counts: NrOfRXPDO, NrOfTXPDO; bit rates; LSS and what it needs
/// `file_name` is only for the findings; `xml`: the text of an XDD, so that findings get its lines.
[[nodiscard]] Findings review(const File& file, std::string_view file_name, std::string_view xml = {});

}  // namespace berth::eds
