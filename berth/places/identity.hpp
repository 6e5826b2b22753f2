/// Which device answers under a node-ID, and whether it is one device alone.
#pragma once

#include <chrono>
#include <cstdint>

#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/rt/task.hpp"

namespace berth::places {

/// An SDO answer of a second device under one node-ID comes after that of the first by no more than this.
inline constexpr rt::Duration second_answer = std::chrono::milliseconds(20);

/// Reads the identity object 1018h, sub-indices 1 to 4. What the device refuses to tell is unknown. The second one asks
/// with another patience than the client's. Errors: those of an answer that did not come.
[[nodiscard]] rt::Task<Result<Identity>> read_identity(co::SdoClient& sdo, NodeId node);
[[nodiscard]] rt::Task<Result<Identity>> read_identity(co::SdoClient& sdo, NodeId node, co::SdoOptions how);

/// Parts of a device's 1018h (bit 0 the vendor-ID) that say nothing of who it is.
struct Uncompared {
  std::uint8_t changes = 0;  ///< each reading gives another value
  std::uint8_t differs = 0;  ///< LSS tells another value

  [[nodiscard]] constexpr bool any() const noexcept { return (changes | differs) != 0; }
  /// What counts of an answer of the device.
  [[nodiscard]] Identity of(Identity who) const noexcept {
    who.unknown = static_cast<std::uint8_t>(who.unknown | changes | differs);
    return who;
  }
};

struct Identified {
  Result<Identity> who = Identity{};
  bool by_two = false;  ///< two devices answered each time that they were asked
};

/// The same. A second answer is no proof of a second device: CAN repeats a frame whose last bit is seen wrong by its
/// sender, question or answer, and receivers have it twice. So all is asked again after a second answer, and two
/// devices are believed when a second answer comes again. `listens`: so long a second answer is waited for, before the
/// last question too: a device with a receive buffer of one frame loses each question that comes right after the
/// answer of another under its node-ID.
[[nodiscard]] rt::Task<Identified> identify(co::SdoClient& sdo, NodeId node, rt::Duration listens = {});

}  // namespace berth::places
