/// What the parts of the machine file's reader share (read_machine.cpp, read_bus.cpp). Inside of room `design`.
#pragma once

#include <array>
#include <string>
#include <string_view>

#include "berth/design/machine.hpp"
#include "berth/text/toml.hpp"

namespace berth::design {

inline constexpr text::Limits node_ids{1, 127};

template <class Enum, std::size_t N>
void read_word(text::Table& table, std::string_view key, const std::array<std::string_view, N>& words, Enum& into) {
  if (const auto index = table.word(key, words)) into = static_cast<Enum>(*index);
}

/// A name that a person gives: shown in tables and used in paths like "left sensor/Position".
[[nodiscard]] bool good_name(std::string_view name) noexcept;
inline constexpr const char* name_fix = "use 1 to 100 characters without '/', control characters and outer spaces";

/// The keys of `[timing]` beneath `parent`, over what `timing` has.
void read_timing(text::Table& parent, Timing& timing);
/// One `[bus.NAME]`; its timing begins with `timing`.
[[nodiscard]] Bus read_bus(const std::string& name, text::Table& table, const Timing& timing);

}  // namespace berth::design
