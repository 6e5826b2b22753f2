/// How late a linked object can be: from its change at the producer to the consumer that has it. The plan has these
/// bounds for its own picture of the buses; `berth analyze` takes them again with its assumptions and errors.
#pragma once

#include <optional>
#include <span>

#include "berth/linker/plan.hpp"

namespace berth::linker {

/// Of 1800h:03 (CiA 301).
inline constexpr rt::Duration inhibit_unit = std::chrono::microseconds(100);

/// Sent at a SYNC: transmission types 0 to 240 (CiA 301, object 1800h, sub-index 02h).
[[nodiscard]] bool synchronous(TransmissionType type) noexcept;

/// When a TPDO is sent.
struct Sending {
  TransmissionType transmission = at_change;
  rt::Duration inhibit{0};  ///< between two changes of one object: of an MPDO once for each of its objects
  rt::Duration sync{0};     ///< period of SYNC on its bus
};
[[nodiscard]] Sending sending_of(const Network& network, const Pdo& pdo);

/// What passes at worst before the frame is in the producer's queue, and before it counts where it was received: the
/// inhibit time; of a synchronous PDO its SYNCs and the one behind its reception.
[[nodiscard]] rt::Duration waiting(const Sending& sending);

/// What a link's deadline leaves for the frame from the queue to its end; 1 ns, which no frame keeps, where it leaves
/// nothing. A synchronous PDO has until the next SYNC, as what comes later counts at the one behind it.
[[nodiscard]] rt::Duration left_for_bus(const Sending& sending, rt::Duration deadline);

/// From the change to its arrival. `response`: of the frame on its bus, from the queue to the end (analysis::Response);
/// a synchronous PDO has it within its SYNC period, or is too late whatever it waits.
[[nodiscard]] rt::Duration worst_of(const Network& network, const Pdo& pdo, rt::Duration response);

/// Of a link across gateways: the sum over its PDOs, and the gateways' delays. `pdos`: as `Plan::pdos`, the worst of
/// each; none: no bound, and then the link has none.
[[nodiscard]] std::optional<rt::Duration> worst_of(const Network& network, const CrossingLink& crossing,
                                                   std::span<const std::optional<rt::Duration>> pdos);

}  // namespace berth::linker
