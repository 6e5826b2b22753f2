/// The place of an object in a file, for findings about its meaning. Internal to room `eds`.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/eds/document.hpp"

namespace berth::eds {

class Places {
 public:
  struct Place {
    std::uint32_t line = 0;  ///< 0 = not found
    std::uint32_t column = 0;
    std::string_view key;  ///< the key that was found; "" = the section or element
  };

  /// Both must stay. `xml`: the text of an XDD; then `document` is empty.
  Places(const Document& document, std::string_view xml);

  /// The first of `keys` ("ParameterValue|DefaultValue") that the object's section has, else the section, else the
  /// object's own section. `whole`: the object with all of its sub-objects.
  [[nodiscard]] Place of(ObjectRef ref, bool whole, std::string_view keys) const;
  /// A key of [DeviceInfo] or [DeviceComissioning], or an attribute of that name.
  [[nodiscard]] Place of_device(std::string_view key) const;
  /// "[1400sub1] DefaultValue" or "1400:01 defaultValue".
  [[nodiscard]] std::string key(ObjectRef ref, bool whole, std::string_view key) const;

 private:
  [[nodiscard]] Place in_section(const Section& section, std::string_view keys) const;
  [[nodiscard]] Place in_tag(std::size_t at, std::string_view keys) const;
  [[nodiscard]] Place place(std::size_t at, std::string_view key) const;

  const Document& document_;
  std::string_view xml_;
  std::map<std::uint32_t, const Section*> sections_;  ///< by index, and sub-index + 1 or 0 for the object
  std::vector<std::size_t> lines_;                    ///< where each line of `xml_` begins
  std::map<std::uint32_t, std::size_t> tags_;         ///< where the element's tag begins
};

}  // namespace berth::eds
