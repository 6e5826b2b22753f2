/// The rules and the configuration of a network from an object dictionary (CiA 302-2, 302-3): any device whose
/// dictionary has these objects can be its network's master.
///
///     1016h            heartbeat consumer: the entry of a slave is its heartbeat time
///     102Ah            NMT inhibit time, in 100 us
///     1F20h, 1F21h     a slave's DCF, and its format: 0 the text as it is, 128 compressed (stored_dcf.hpp)
///     1F22h            a slave's concise DCF; it counts where there is one, else 1F20h
///     1F26h, 1F27h     expected configuration date and time
///     1F53h, 1F54h     expected date and time of the software, where 1F55h has nothing
///     1F55h            expected software
///     1F58h            a slave's program; it is brought into its program 1
///     1F80h            NMT startup
///     1F81h            slave assignment
///     1F84h to 1F88h   expected identity
///     1F89h            boot time, in ms
///     1F8Ah            sub-index of the slave's 1011h that restores its factory settings
///     1F90h            flying master timing
///     5F02h            expected hardware version (paper 3; docs/multilevel.md)
///     5F05h            node-IDs that are their devices' own (docs/multilevel.md); a bit each, not a sub-index
/// The sub-index of the arrays is the slave's node-ID. A missing object or sub-index counts as 0.
#pragma once

#include "berth/manager/boot_rules.hpp"
#include "berth/manager/configuration.hpp"
#include "berth/manager/flying_negotiation.hpp"
#include "berth/od/values.hpp"

namespace berth::manager {

/// Errc::invalid: a reserved bit is set.
[[nodiscard]] Result<Startup> startup_of(const od::Values& values) noexcept;
[[nodiscard]] SlaveRules slave_rules_of(const od::Values& values, NodeId node) noexcept;
/// By 5F05h: the node-ID is set by the device itself, and is not assigned.
[[nodiscard]] bool has_fixed_node_id(const od::Values& values, NodeId node) noexcept;
[[nodiscard]] rt::Duration boot_time_of(const od::Values& values) noexcept;
[[nodiscard]] rt::Duration nmt_inhibit_time_of(const od::Values& values) noexcept;
/// 1F90h, and whether a cold start resets all nodes: it does not if an assigned slave is keep-alive.
[[nodiscard]] FlyingOptions flying_options_of(const od::Values& values, NodeId own) noexcept;
/// How long another master may be silent: its entry in 1016h, else twice this master's own 1017h; 0: not supervised.
[[nodiscard]] rt::Duration master_heartbeat_of(const od::Values& values, NodeId master) noexcept;

/// The wanted configuration of a slave. Without a DCF: no entries. Its date is 1F26h and 1F27h if both are not 0.
/// Errors: Errc::invalid, with the object: the stream or text is no DCF, or a value of it cannot be computed;
/// Errc::unsupported: unknown format in 1F21h.
[[nodiscard]] Result<Wanted> wanted_of(const od::Values& values, NodeId node);

/// Applies the concise DCF in 1F22h for the master's own node-ID to its own dictionary, by the network's access rules
/// and in its order, and removes it from 1F22h. `not_stored`: 1F22h has none that can be read; else the reason why an
/// entry was refused: those before it were written. Nested 1F25h: `general`.
[[nodiscard]] od::AbortCode configure_itself(od::Values& values, NodeId own);

}  // namespace berth::manager
