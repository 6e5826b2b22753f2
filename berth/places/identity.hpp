/// Identifies the device under a node-ID, and whether it is only one device.
#pragma once

#include <chrono>
#include <cstdint>

#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/rt/task.hpp"

namespace berth::places {

/// The longest time between the SDO answers of two devices under one node-ID.
inline constexpr rt::Duration second_answer = std::chrono::milliseconds(20);

/// Reads the identity object 1018h, sub-indices 1 to 4. A part that the device refuses is unknown. The second overload
/// has its own time-out and retries. Errors: those of a missing answer.
[[nodiscard]] rt::Task<Result<Identity>> read_identity(co::SdoClient& sdo, NodeId node);
[[nodiscard]] rt::Task<Result<Identity>> read_identity(co::SdoClient& sdo, NodeId node, co::SdoOptions how);

/// Parts of a device's 1018h (bit 0 the vendor-ID) that do not identify it.
struct Uncompared {
  std::uint8_t changes = 0;  ///< each reading gives another value
  std::uint8_t differs = 0;  ///< LSS tells another value

  [[nodiscard]] constexpr bool any() const noexcept { return (changes | differs) != 0; }
  /// The usable part of the device's answer.
  [[nodiscard]] Identity of(Identity who) const noexcept {
    who.unknown = static_cast<std::uint8_t>(who.unknown | changes | differs);
    return who;
  }
};

struct Identified {
  Result<Identity> who = Identity{};
  bool by_two = false;  ///< two devices answered each time
};

/// Reads the identity. A second answer does not prove a second device: CAN repeats a frame, question or answer, if its
/// sender sees the last bit wrong, and receivers then have it twice. So after a second answer everything is asked
/// again, and two devices are reported only if a second answer comes again. `listens`: how long to wait for a second
/// answer, also before the last question: a device with a receive buffer of one frame loses each question that comes
/// right after the answer of another under its node-ID.
[[nodiscard]] rt::Task<Identified> identify(co::SdoClient& sdo, NodeId node, rt::Duration listens = {});

}  // namespace berth::places
