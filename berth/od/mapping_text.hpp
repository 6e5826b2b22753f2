/// The entry of a PDO mapping as text.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "berth/base/bytes.hpp"
#include "berth/od/notation.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::od {

/// The object that a mapping entry (1600h to 17FFh and 1A00h to 1BFFh from sub-index 1 on) maps. Empty for any other
/// object, for a value that is not four bytes long, and for 0, which maps nothing.
[[nodiscard]] inline std::optional<ObjectRef> mapped_object(ObjectRef object, std::span<const std::uint8_t> value) {
  const bool entry = is_pdo_mapping(object.index) && object.sub > 0 && object.sub <= most_pdo_entries;
  if (!entry || value.size() != 4) return std::nullopt;
  const auto raw = load_le<std::uint32_t>(value.data());
  if (raw == 0) return std::nullopt;
  return PdoEntry::of(raw).object;
}

/// The text of such a value: "6010h:00, 16 bit"; empty if it maps no object.
[[nodiscard]] inline std::string mapping_text(ObjectRef object, std::span<const std::uint8_t> value) {
  const auto mapped = mapped_object(object, value);
  return mapped ? fmt::format("{}, {} bit", write_object(*mapped), value[0]) : std::string();
}

}  // namespace berth::od
