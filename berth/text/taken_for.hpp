/// Recognises a wrong kind of file: a device description or a plant file where a machine file was expected.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "berth/base/finding.hpp"

namespace berth::text {

enum class FileKind : std::uint8_t { machine, plant };

/// The kind of a text that is not of the kind `wanted`, and what to do with it instead; reported before any of its
/// lines is called wrong. Empty: it may be of that kind, or its kind is unknown.
[[nodiscard]] std::optional<Finding> taken_for(FileKind wanted, std::string_view text, const std::string& file);

}  // namespace berth::text
