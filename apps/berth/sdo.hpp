/// Shared by the files of `berth sdo`.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "options.hpp"
#include "verb.hpp"

namespace berth::cli {

/// Bytes from "F4 01" or "F401" of a reply.
[[nodiscard]] std::vector<std::uint8_t> bytes_of(const std::string& hex);
/// `berth sdo dump` (sdo_dump.cpp).
void add_dump(const Verb& sdo, Options& options);

}  // namespace berth::cli
