/// Objects as people write them: the only parser for commands, files and filters. berth/od/names.hpp looks up names of
/// objects in a description.
///
///     1018h       0x1018                             an object
///     1018h:04    0x1018:4    1018h/4    1018sub4    one of its sub-indices
///
/// Index and sub-index are hexadecimal, in either case; the sub-index may have its own "h" or "0x". A bare "1018" is
/// refused: CANopen reads it as 1018h, C and spreadsheets as 03FAh.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "berth/base/ids.hpp"

namespace berth::od {

/// An object as written.
struct ObjectWord {
  std::uint16_t index = 0;
  std::optional<std::uint8_t> sub;  ///< empty: not written
  [[nodiscard]] ObjectRef ref() const noexcept { return {index, sub.value_or(0)}; }
  friend bool operator==(const ObjectWord&, const ObjectWord&) = default;
};

/// Why a word is not an object.
struct NoObject {
  enum class Kind : std::uint8_t {
    other,     ///< it may be a name
    unmarked,  ///< hexadecimal digits with a letter among them: it may be a name ("Feed")
    bare,      ///< only digits: an index in an unknown base. No name has this form
    several,   ///< several objects have this name (`find_object` only)
  };
  Kind kind = Kind::other;
  std::string why;  ///< for users: the problem, and what to write
};

/// Parses an object in numbers.
[[nodiscard]] tl::expected<ObjectWord, NoObject> read_object(std::string_view word);
/// The same without a reason for failure; no sub-index means sub-index 0.
[[nodiscard]] std::optional<ObjectRef> parse_object(std::string_view word);
/// A sub-index alone: "4", "0x1F", "1Fh". Ambiguous bare digits ("10": 0Ah or 10h) are refused.
[[nodiscard]] tl::expected<std::uint8_t, std::string> read_sub_index(std::string_view word);

/// "1018h:04"; `read_object` parses it.
[[nodiscard]] std::string write_object(ObjectRef object);

}  // namespace berth::od
