/// Something about a device or a node-ID that is not as it should be, and what the user can do about it.
#pragma once

#include <cstdint>
#include <string>

#include "berth/base/ids.hpp"

namespace berth::places {

enum class OddityKind : std::uint8_t {
  surplus,         ///< every slot of its type is taken
  foreign,         ///< the machine has no slot for its type
  clone,           ///< two devices answer to one LSS address
  wrong_revision,  ///< no free slot accepts its revision
  fixed_mismatch,  ///< its fixed node-ID is not its slot's
  misplaced,       ///< its probe tells a place that is not its slot's
  returned,        ///< it sat in a slot that was given to another device (found by `operate`, from the store)
  unfinished,      ///< it was to give up its node-ID and does not answer (`operate`)
  lent,            ///< it was lent a node-ID and does not answer (`operate`)
};
/// The word in events and in JSON: "wrong revision".
[[nodiscard]] const char* name(OddityKind kind) noexcept;

struct Oddity {
  OddityKind kind = OddityKind::surplus;
  Identity device;
  NodeId id;         ///< its own, or the one that it is about
  std::string text;  ///< what is wrong and what to do
};

}  // namespace berth::places
