/// Objects by the names in their description.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <type_traits>
#include <unordered_map>

#include "berth/base/ids.hpp"
#include "berth/od/description.hpp"
#include "berth/od/notation.hpp"

namespace berth::client {

/// Selects an object: by index and sub-index, or by a text as in every command of Berth (berth/od/notation.hpp,
/// berth/od/names.hpp):
/// - "Identity object/Vendor-ID", "Vendor-ID", "ident/vendor": names, or beginnings of names, that only one object has
/// - "1018h:01", "0x1018:1", "1018sub1", "1018h": index and sub-index, hexadecimal both; without sub-index: 0
/// Trivial: the call that gets a text only reads it and does not keep it.
class Selector {
 public:
  constexpr Selector(ObjectRef ref) noexcept : ref_(ref) {}
  constexpr Selector(std::string_view text) noexcept : text_(text), by_text_(true) {}
  constexpr Selector(const char* text) noexcept : Selector(std::string_view(text)) {}
  Selector(const std::string& text) noexcept : Selector(std::string_view(text)) {}
  [[nodiscard]] constexpr bool by_text() const noexcept { return by_text_; }
  [[nodiscard]] constexpr std::string_view text() const noexcept { return text_; }
  [[nodiscard]] constexpr ObjectRef ref() const noexcept { return ref_; }

 private:
  std::string_view text_;
  ObjectRef ref_;
  bool by_text_ = false;
};
static_assert(std::is_trivially_copyable_v<Selector> && std::is_trivially_destructible_v<Selector>);

/// All names of a description. It builds a table of them for finding whole names at once; the beginning of a name is
/// searched for at each call. Share one among nodes of a type.
class Names {
 public:
  explicit Names(std::shared_ptr<const od::Description> description);

  /// See `od::find_object`. An index in a text need not be in the description.
  [[nodiscard]] tl::expected<ObjectRef, od::NoObject> find(Selector selector) const;
  /// "Identity object/Vendor-ID", or "" when the description has no such object.
  [[nodiscard]] std::string name(ObjectRef ref) const;
  /// `object 1018h:01 "Identity object/Vendor-ID"`.
  [[nodiscard]] std::string label(ObjectRef ref) const;
  [[nodiscard]] const std::shared_ptr<const od::Description>& description() const noexcept { return description_; }

 private:
  struct Hash {
    using is_transparent = void;
    std::size_t operator()(std::string_view text) const noexcept { return std::hash<std::string_view>()(text); }
  };
  void add(std::string name, ObjectRef ref);

  std::shared_ptr<const od::Description> description_;
  std::unordered_map<std::string, std::optional<ObjectRef>, Hash, std::equal_to<>> objects_;
};

}  // namespace berth::client
