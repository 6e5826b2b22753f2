/// Waiting for the main job, which binds, configures and starts a slot's device.
#pragma once

#include <optional>
#include <string>

#include "berth/operate/network.hpp"
#include "berth/rt/task.hpp"

namespace berth::command {

/// The slot as it is now; empty: there is none of this name.
[[nodiscard]] std::optional<operate::SlotReport> slot_report(const operate::Network& network, const std::string& name);

/// How long a device that is there may take until its slot is settled; also, for a device that is put in now.
[[nodiscard]] rt::Duration longest_wait(const operate::Network& network) noexcept;

/// Waits until the slot is operational, or in a state that it does not leave by itself; at most `longest_wait`. If no
/// device comes, the slot stays empty.
[[nodiscard]] rt::Task<void> await_slot(operate::Network& network, const std::string& name);

/// The same after the slot's device was reset: also waits for its boot-up, and as long as it is configured.
[[nodiscard]] rt::Task<void> await_restart(operate::Network& network, const std::string& name, std::uint64_t boot_ups);

}  // namespace berth::command
