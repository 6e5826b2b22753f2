#include "berth/command/role.hpp"

#include <algorithm>

namespace berth::command {

std::string_view name(Role role) noexcept {
  switch (role) {
    case Role::view: return "view";
    case Role::operate: return "operate";
    default: return "configure";
  }
}

std::optional<Role> parse_role(std::string_view wanted) noexcept {
  const auto* const it = std::ranges::find(all_roles, wanted, [](Role role) { return name(role); });
  return it == all_roles.end() ? std::nullopt : std::optional(*it);
}

}  // namespace berth::command
