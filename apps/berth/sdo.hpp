/// `berth sdo`: what its files share.
#pragma once

#include <string>

#include "options.hpp"
#include "verb.hpp"

namespace berth::cli {

/// "F4 01" of a reply, as bytes.
[[nodiscard]] std::string bytes_of(const std::string& hex);
/// `berth sdo dump` (sdo_dump.cpp).
void add_dump(const Verb& sdo, Options& options);

}  // namespace berth::cli
