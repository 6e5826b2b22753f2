/// Network variables as symbols of IEC 61131-3: PLCopen XML (TC6, schema 2.01) and a list of global variables in
/// structured text, one of each per programmable device (paper 5 §2.1: the import into the programming system).
///
/// An input variable of the network is an output of the device's program and is at %Q; an output variable is at %I.
/// Addresses count in elements of the variable's size from the image's base (`%QW6` are bytes 12 and 13); unaligned
/// variables, and types of 24, 40, 48 and 56 bits, have no address. Index, sub-index and byte are given with each.
#pragma once

#include <string>
#include <string_view>

#include "berth/linker/plan.hpp"

namespace berth::linker {

/// Why a name is not valid for a variable of IEC 61131-3; empty if it is. Case does not matter there.
[[nodiscard]] std::string wrong_identifier(std::string_view name);
/// "NV_A040_01": the name of a variable that a link gives by its object.
[[nodiscard]] std::string symbol_of(ObjectRef object);

/// "UINT"; for types missing in IEC 61131-3 the next longer one.
[[nodiscard]] std::string_view iec_type(od::DataType type) noexcept;
/// "%QW6"; empty if there is none.
[[nodiscard]] std::string iec_address(const Variable& variable);

/// `node` has variables in `plan`.
[[nodiscard]] std::string plcopen_xml(const LinkNetwork& network, const Plan& plan, std::size_t node);
[[nodiscard]] std::string global_variables(const LinkNetwork& network, const Plan& plan, std::size_t node);

}  // namespace berth::linker
