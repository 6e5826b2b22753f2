/// A file that was given in place of another: a device description or a plant file where a machine file was asked for.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "berth/base/finding.hpp"

namespace berth::text {

enum class FileKind : std::uint8_t { machine, plant };

/// What a text is that is not of the kind `wanted`, with what is done with it instead: told before any line of it is
/// called wrong. Empty: it may be of that kind, or is nothing that is known here.
[[nodiscard]] std::optional<Finding> taken_for(FileKind wanted, std::string_view text, const std::string& file);

}  // namespace berth::text
