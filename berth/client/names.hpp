/// Objects by the names of their description.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <type_traits>
#include <unordered_map>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/od/description.hpp"

namespace berth::client {

/// Which object: index and sub-index, or a text. Texts:
/// - "Identity object.Vendor-ID": object and sub-object, as the description spells them
/// - "Vendor-ID": the name of a VAR, or of a sub-object when no other has it
/// - "1018:01", "1018h:01", "0x1018:1", "1018": index and sub-index, hexadecimal both; without sub-index: 0
/// Trivial: a text is looked at by the call that it is given to, and not kept.
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

/// All names of a description. Building it costs a table of them: share one among nodes of a type.
class Names {
 public:
  explicit Names(std::shared_ptr<const od::Description> description);

  struct Problem {
    bool ambiguous = false;
    std::string what;  ///< "no object is called "Vendor-Id"; there is "Identity object.Vendor-ID""
  };
  /// An index that a text gives need not be in the description.
  [[nodiscard]] tl::expected<ObjectRef, Problem> find(Selector selector) const;
  /// "Identity object.Vendor-ID", or "" when the description has no such object.
  [[nodiscard]] std::string name(ObjectRef ref) const;
  /// `object 1018h:01 "Identity object.Vendor-ID"`.
  [[nodiscard]] std::string label(ObjectRef ref) const;
  [[nodiscard]] const std::shared_ptr<const od::Description>& description() const noexcept { return description_; }

 private:
  [[nodiscard]] Problem problem(std::string_view text) const;
  void add(std::string_view name, ObjectRef ref);

  std::shared_ptr<const od::Description> description_;
  std::unordered_map<std::string, std::vector<ObjectRef>> objects_;
};

}  // namespace berth::client
