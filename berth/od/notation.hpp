/// Objects of a dictionary as people write them: the one reader of commands, files and filters. Names of objects are
/// looked up in a description: berth/od/names.hpp.
///
///     1018h       0x1018                             an object
///     1018h:04    0x1018:4    1018h/4    1018sub4    one of its sub-indices
///
/// Index and sub-index are hexadecimal, in either case; the sub-index may have its own "h" or "0x". A bare "1018" is
/// none: CANopen reads 1018h, C and spreadsheets 03FAh.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "berth/base/ids.hpp"

namespace berth::od {

/// An object as it was written.
struct ObjectWord {
  std::uint16_t index = 0;
  std::optional<std::uint8_t> sub;  ///< empty: none was written
  [[nodiscard]] ObjectRef ref() const noexcept { return {index, sub.value_or(0)}; }
  friend bool operator==(const ObjectWord&, const ObjectWord&) = default;
};

/// Why a word is no object.
struct NoObject {
  enum class Kind : std::uint8_t {
    other,     ///< it may be a name
    unmarked,  ///< hexadecimal digits with a letter among them: it may be a name ("Feed")
    bare,      ///< digits alone: an index of which it is not said how to read it. No name is like that
    several,   ///< the name of several objects (`find_object` only)
  };
  Kind kind = Kind::other;
  std::string why;  ///< for people: what, and what to write
};

/// Reads an object in numbers.
[[nodiscard]] tl::expected<ObjectWord, NoObject> read_object(std::string_view word);
/// The same where nothing more is to be said; no sub-index is sub-index 0.
[[nodiscard]] std::optional<ObjectRef> parse_object(std::string_view word);
/// A sub-index by itself: "4", "0x1F", "1Fh". Bare digits that mean two things ("10": 0Ah or 10h) are refused.
[[nodiscard]] tl::expected<std::uint8_t, std::string> read_sub_index(std::string_view word);

/// "1018h:04"; `read_object` gives it back.
[[nodiscard]] std::string write_object(ObjectRef object);

}  // namespace berth::od
