/// How late a linked object can be: from its change at the producer to the consumer that has it. The plan has these
/// bounds for its own picture of the buses; `berth analyze` takes them again with its assumptions and errors.
#pragma once

#include <optional>
#include <span>

#include "berth/linker/plan.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::linker {

/// Of 1800h:03 (CiA 301).
inline constexpr rt::Duration inhibit_unit = std::chrono::microseconds(100);

using od::synchronous;

/// Least time between two frames of a TPDO: of one at a change its inhibit time, or what its sender is said to keep; of
/// a synchronous one so many SYNCs. 0: there is none, or it is never sent.
[[nodiscard]] rt::Duration least_interval(TransmissionType type, rt::Duration inhibit, rt::Duration sync,
                                          rt::Duration said);

/// Why a TPDO of this type sends no frame by itself, so that nothing bounds it. `sync`: the period of SYNC on its bus,
/// 0 where nothing produces it.
enum class Unsent : std::uint8_t { no, on_remote_frames, waits_for_sync };
[[nodiscard]] Unsent unsent(TransmissionType type, rt::Duration sync) noexcept;

/// When a TPDO is sent.
struct Sending {
  TransmissionType transmission = at_change;
  rt::Duration inhibit{0};  ///< between two changes of one object: of an MPDO once for each of its objects
  unsigned objects = 1;     ///< of an MPDO
  rt::Duration sync{0};     ///< period of SYNC on its bus
  std::uint32_t sync_key = default_sync_key;
};
[[nodiscard]] Sending sending_of(const LinkNetwork& network, const Pdo& pdo);

/// What passes at worst although the bus is free: the inhibit time; of a synchronous PDO its SYNCs and the one after
/// its reception.
[[nodiscard]] rt::Duration waiting(const Sending& sending);

/// What the message of a TPDO is: `berth link` and `berth analyze` both have it from here. A synchronous one comes
/// after SYNC. `linked`: it carries a link, and so counts from the change to its arrival: a change waits for the
/// inhibit time or for its SYNCs, and what comes after a SYNC counts at the next.
void set_sending(analysis::Message& message, const Sending& sending, bool linked,
                 const std::optional<rt::Duration>& deadline);

/// Of a link across gateways: the sum over its PDOs, and the gateways' delays. `pdos`: as `Plan::pdos`, the worst of
/// each; none: no bound, and then the link has none.
[[nodiscard]] std::optional<rt::Duration> worst_of(const LinkNetwork& network, const CrossingLink& crossing,
                                                   std::span<const std::optional<rt::Duration>> pdos);

}  // namespace berth::linker
