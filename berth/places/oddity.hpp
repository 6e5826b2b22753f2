/// A problem with a device or a node-ID, and what the user can do about it.
#pragma once

#include <cstdint>
#include <string>

#include "berth/base/ids.hpp"

namespace berth::places {

enum class OddityKind : std::uint8_t {
  surplus,         ///< every slot of its type is taken
  foreign,         ///< the machine has no slot for its type
  clone,           ///< two devices answer to one LSS address
  wrong_revision,  ///< no free slot accepts its revision number
  fixed_mismatch,  ///< its fixed node-ID is not its slot's
  misplaced,       ///< its probe shows a place other than its slot's
  returned,        ///< its former slot was given to another device (found by `operate`, from the store)
  unfinished,      ///< it was to give up its node-ID, and does not answer (`operate`)
  lent,            ///< it was lent a node-ID, and does not answer (`operate`)
};
/// The word in events and in JSON: "wrong revision".
[[nodiscard]] const char* name(OddityKind kind) noexcept;

struct Oddity {
  OddityKind kind = OddityKind::surplus;
  Identity device;
  NodeId id;         ///< the device's, or the one it is about
  std::string text;  ///< what is wrong and what to do
};

}  // namespace berth::places
