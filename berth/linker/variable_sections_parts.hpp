/// Network variables as objects of a device description (CiA 306 §5.3.3.3: in their own sections, with values not in
/// compact form). Internal to room `linker`.
#pragma once

#include <string>
#include <tl/expected.hpp>

#include "berth/linker/plan.hpp"

namespace berth::linker {

/// The node's description as an EDS or DCF with its text, including its network variables. The error is for users.
[[nodiscard]] tl::expected<eds::File, std::string> with_variables(const LinkNetwork& network, const Plan& plan,
                                                                  std::size_t node);

}  // namespace berth::linker
