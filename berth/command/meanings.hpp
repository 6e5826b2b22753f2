/// Units and names of values from a description (od::Meaning).
#pragma once

#include <optional>

#include "berth/command/objects.hpp"

namespace berth::command {

/// The unit of one count: "°C", "0.1 °C".
[[nodiscard]] std::string one_count(const od::Meaning& meaning);
/// "23.5 °C"; empty if no unit is known.
[[nodiscard]] std::string quantity_text(const KnownObject& object, std::span<const std::uint8_t> bytes);
/// "Reverse"; empty if the value has no name.
[[nodiscard]] std::string value_name(const KnownObject& object, std::span<const std::uint8_t> bytes);

/// The bits of "23.5 °C" or "Reverse"; empty: neither a quantity nor a name, to be read as a number. Errors are for
/// users, with the candidates.
[[nodiscard]] std::optional<Checked<std::uint64_t>> raw_meant(const KnownObject& object, const std::string& text,
                                                              NodeId node);
/// For users: why the description does not allow this value; empty: it does.
[[nodiscard]] std::string not_allowed(const KnownObject& object, std::uint64_t raw, const std::string& text);

}  // namespace berth::command
