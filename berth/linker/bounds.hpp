/// The longest delay of a linked object: from its change at the producer until the consumer has it. The plan has these
/// bounds for its own assumptions about the buses; `berth analyze` computes them again with its assumptions and errors.
#pragma once

#include <optional>
#include <span>

#include "berth/linker/plan.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::linker {

/// Of 1800h:03 (CiA 301).
inline constexpr rt::Duration inhibit_unit = std::chrono::microseconds(100);

using od::synchronous;

/// Least time between two frames of a TPDO: for one sent at a change its inhibit time, or the interval that its sender
/// is said to keep; for a synchronous one its number of SYNCs. 0: there is none, or it is never sent.
[[nodiscard]] rt::Duration least_interval(TransmissionType type, rt::Duration inhibit, rt::Duration sync,
                                          rt::Duration said);

/// Why a TPDO of this type sends no frame by itself, so that it has no bound. `sync`: the period of SYNC on its bus, 0
/// if nothing produces it.
enum class Unsent : std::uint8_t { no, on_remote_frames, waits_for_sync };
[[nodiscard]] Unsent unsent(TransmissionType type, rt::Duration sync) noexcept;

/// When a TPDO is sent.
struct Sending {
  TransmissionType transmission = at_change;
  rt::Duration inhibit{0};  ///< between two changes of one object; for an MPDO once for each of its objects
  unsigned objects = 1;     ///< of an MPDO
  rt::Duration sync{0};     ///< period of SYNC on its bus
  std::uint32_t sync_key = default_sync_key;
};
[[nodiscard]] Sending sending_of(const LinkNetwork& network, const Pdo& pdo);

/// The longest wait on a free bus: the inhibit time; for a synchronous PDO its SYNCs and the one after its reception.
[[nodiscard]] rt::Duration waiting(const Sending& sending);

/// Sets up the message of a TPDO, for `berth link` and `berth analyze`. A synchronous one follows SYNC. `linked`: it
/// carries a link, so its time runs from the change to the arrival: a change waits for the inhibit time or for its
/// SYNCs, and a value sent after a SYNC takes effect at the next.
void set_sending(analysis::Message& message, const Sending& sending, bool linked,
                 const std::optional<rt::Duration>& deadline);

/// The bound of a link across gateways: the sum over its PDOs, plus the gateways' delays. `pdos`: the worst case of
/// each, as in `Plan::pdos`; without one the link has none.
[[nodiscard]] std::optional<rt::Duration> worst_of(const LinkNetwork& network, const CrossingLink& crossing,
                                                   std::span<const std::optional<rt::Duration>> pdos);

}  // namespace berth::linker
