/// Values in makers' description files that CiA 306 does not allow. Internal to room `eds`.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "berth/od/data_type.hpp"

namespace berth::eds {

/// The evident meaning of a text that `od::parse` refuses, in CiA 306's form: `0x12ULL` (C's suffixes), `08` (no octal
/// number), `TRUE` and `FALSE` of a BOOLEAN, `1.0` of an integer, `$NODEID+0x180+1`. Empty: there is none.
[[nodiscard]] std::optional<std::string> plain_sense(od::DataType type, std::string_view text);

/// A value from `od::parse`, or from its evident meaning.
struct Understood {
  tl::expected<od::Parsed, od::TextError> parsed;
  std::optional<std::string> plain{};  ///< the text in the form that was used instead; empty: the text is correct, or
                                       ///< has no meaning
};
[[nodiscard]] Understood understand(od::DataType type, std::string_view text);

}  // namespace berth::eds
