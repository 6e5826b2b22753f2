/// The meaning of values of a device's objects, for users; implemented above this room (berth/command/notes.hpp).
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "berth/base/ids.hpp"
#include "berth/od/data_type.hpp"

namespace berth::decode {

class ValueWords {
 public:
  ValueWords() = default;
  ValueWords(const ValueWords&) = default;
  ValueWords& operator=(const ValueWords&) = default;
  virtual ~ValueWords() = default;
  /// It knows the meaning of the object's values.
  [[nodiscard]] virtual bool knows(ObjectRef object) const = 0;
  /// "23.5 °C", "fault, remote"; empty: unknown for this one.
  [[nodiscard]] virtual std::string words(ObjectRef object, od::DataType type,
                                          std::span<const std::uint8_t> bytes) const = 0;
};

}  // namespace berth::decode
