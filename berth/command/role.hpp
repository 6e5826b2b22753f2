/// What a user who shares a machine with others may do (docs/security.md §Roles). Each role includes the previous
/// ones.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

namespace berth::command {

enum class Role : std::uint8_t {
  view,      ///< reads and asks: devices, bus and store stay as they were
  operate,   ///< runs the existing machine: starts, stops, replaces a device; unlocks real buses
  configure  ///< changes the machine: objects, parameters, programs, LSS
};

inline constexpr std::array all_roles{Role::view, Role::operate, Role::configure};

[[nodiscard]] std::string_view name(Role role) noexcept;  ///< "view"
/// Empty: there is no role of this name.
[[nodiscard]] std::optional<Role> parse_role(std::string_view name) noexcept;

}  // namespace berth::command
