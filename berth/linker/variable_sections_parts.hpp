/// Network variables as objects of a device description (CiA 306 §5.3.3.3: sections of their own, with values not in
/// compact form). Between the sources of room `linker`.
#pragma once

#include <string>
#include <tl/expected.hpp>

#include "berth/linker/plan.hpp"

namespace berth::linker {

/// The node's description as an EDS or DCF with a text, its network variables in it. The error is for people.
[[nodiscard]] tl::expected<eds::File, std::string> with_variables(const LinkNetwork& network, const Plan& plan,
                                                                  std::size_t node);

}  // namespace berth::linker
