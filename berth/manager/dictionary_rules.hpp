/// The rules and the configuration of a network from an object dictionary (CiA 302-2, 302-3): so any device whose
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
/// Of the arrays the sub-index is the slave's node-ID. An object or sub-index that is not there counts as 0.
#pragma once

#include "berth/manager/boot_rules.hpp"
#include "berth/manager/configuration.hpp"
#include "berth/manager/flying_negotiation.hpp"
#include "berth/od/values.hpp"

namespace berth::manager {

/// Errc::invalid: a reserved bit is set.
[[nodiscard]] Result<Startup> startup_of(const od::Values& values) noexcept;
[[nodiscard]] SlaveRules slave_rules_of(const od::Values& values, NodeId node) noexcept;
/// By 5F05h: the node-ID is its device's own, and nobody is given it.
[[nodiscard]] bool has_fixed_node_id(const od::Values& values, NodeId node) noexcept;
[[nodiscard]] rt::Duration boot_time_of(const od::Values& values) noexcept;
[[nodiscard]] rt::Duration nmt_inhibit_time_of(const od::Values& values) noexcept;
/// 1F90h, and whether a cold start resets all nodes: not when an assigned slave is keep-alive.
[[nodiscard]] FlyingOptions flying_options_of(const od::Values& values, NodeId own) noexcept;
/// How long another master may be silent: its entry of 1016h, else twice the own 1017h; 0: not supervised.
[[nodiscard]] rt::Duration master_heartbeat_of(const od::Values& values, NodeId master) noexcept;

/// What a slave's configuration shall be. Without a DCF: no entries. Its date is 1F26h and 1F27h where both are not 0.
/// Errors: Errc::invalid, with the object, when the stream or the text is none, or a value of it cannot be had;
/// Errc::unsupported: a format of 1F21h that is not known.
[[nodiscard]] Result<Wanted> wanted_of(const od::Values& values, NodeId node);

/// What 1F22h has for the master's own node-ID (a concise DCF) goes into its own dictionary, by the network's rules of
/// access and in the order in which it stands, and out of 1F22h. `not_stored`: 1F22h has none that can be read; else
/// what refused an entry: those before it were written. Nested 1F25h: `general`.
[[nodiscard]] od::AbortCode configure_itself(od::Values& values, NodeId own);

}  // namespace berth::manager
