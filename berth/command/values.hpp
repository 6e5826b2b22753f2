/// Values of objects as users write and read them: by type, with a unit if known, as bytes if nothing is known.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "berth/command/arguments.hpp"
#include "berth/command/objects.hpp"

namespace berth::command {

/// The bytes of a text as a value of this object. A number is in C notation. It may have the unit in which the object
/// counts, or a larger or smaller one ("0.5 s" for 1017h), or the description's ("23.5 °C"). If the description names
/// values, a name or the beginning of one is accepted, too. If the type is only described, hex bytes ("F4 01", or none
/// at all) are accepted instead. Refused: a value that does not fit the type, other units and names, and, unless
/// `anyway`, values that the description does not allow. `node`: for values with $NODEID.
[[nodiscard]] Checked<std::vector<std::uint8_t>> value_bytes(const KnownObject& object, const std::string& text,
                                                             NodeId node, bool anyway = false);

/// For users: "500 (0x01F4) = 500 ms", "235 (0x00EB) = 23.5 °C", "2 (0x02) = Reverse", "Pump", "01 00  = 1 (0x1)".
[[nodiscard]] std::string value_text(const KnownObject& object, std::span<const std::uint8_t> bytes);
/// Adds "bytes", and if the type is known "type" and "value"; for an object that counts time also "time": the value
/// with its unit, "500 ms"; if the description has them, "unit" (of one count: "0.1 °C"), "quantity" ("23.5 °C") and
/// "meaning" (the value's name).
void put_value(nlohmann::ordered_json& json, const KnownObject& object, std::span<const std::uint8_t> bytes);

/// "500 ms", for a communication object that counts time; else empty.
[[nodiscard]] std::string unit_text(const KnownObject& object, std::span<const std::uint8_t> bytes);

/// "F4 01".
[[nodiscard]] std::string hex_bytes(std::span<const std::uint8_t> bytes);
/// The type can have these bytes.
[[nodiscard]] bool fits(od::DataType type, std::span<const std::uint8_t> bytes) noexcept;

}  // namespace berth::command
