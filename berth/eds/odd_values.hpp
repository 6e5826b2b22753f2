/// Values as makers' description files have them, which CiA 306 does not know. Inside of room `eds`.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "berth/od/data_type.hpp"

namespace berth::eds {

/// The plain sense of a text that `od::parse` refuses, written as CiA 306 has it: `0x12ULL` (C's suffixes), `08` (no
/// octal number), `TRUE` and `FALSE` of a BOOLEAN, `1.0` of an integer, `$NODEID+0x180+1`. Empty: there is none.
[[nodiscard]] std::optional<std::string> plain_sense(od::DataType type, std::string_view text);

/// A value as `od::parse` has it, or in its plain sense.
struct Understood {
  tl::expected<od::Parsed, od::TextError> parsed;
  std::optional<std::string> plain{};  ///< what the text was taken as; empty: it is as it should be, or none
};
[[nodiscard]] Understood understand(od::DataType type, std::string_view text);

}  // namespace berth::eds
