/// What values of a device's objects mean, for people: who knows it is above this room (berth/command/notes.hpp).
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
  /// There is something to say of its values.
  [[nodiscard]] virtual bool knows(ObjectRef object) const = 0;
  /// "23.5 °C", "fault, remote"; empty: nothing is known of this one.
  [[nodiscard]] virtual std::string words(ObjectRef object, od::DataType type,
                                          std::span<const std::uint8_t> bytes) const = 0;
};

}  // namespace berth::decode
