/// Shared by NMT master and slave: commands, and which services run in which state (CiA 301 §7.2.8, §7.3.2).
#pragma once

#include <cstdint>
#include <optional>

#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"

namespace berth::co {

/// Command specifier of the frame on identifier 000h, DLC 2: `[command, node-ID]`, node-ID 0 = all.
enum class NmtCommand : std::uint8_t {
  start = 0x01,
  stop = 0x02,
  enter_pre_operational = 0x80,
  reset_node = 0x81,
  reset_communication = 0x82,
};
/// "start", "stop", "enter pre-operational", "reset node", "reset communication".
[[nodiscard]] const char* name(NmtCommand command) noexcept;
[[nodiscard]] std::optional<NmtCommand> nmt_command(std::uint8_t specifier) noexcept;

/// The target of a command: one node or all nodes.
struct NmtTarget {
  std::uint8_t node = 0;  ///< 1..127, or 0 = all
  constexpr NmtTarget() noexcept = default;
  constexpr NmtTarget(NodeId one) noexcept : node(one.configured() ? one.value() : std::uint8_t{0xFF}) {}
  [[nodiscard]] static constexpr NmtTarget all() noexcept { return {}; }
  [[nodiscard]] constexpr bool includes(NodeId id) const noexcept {
    return id.configured() && (node == 0 || node == id.value());
  }
  friend constexpr bool operator==(NmtTarget, NmtTarget) noexcept = default;
};

/// A command with its target.
struct NmtRequest {
  NmtCommand command = NmtCommand::start;
  NmtTarget target;
};
[[nodiscard]] can::Frame to_frame(const NmtRequest& request) noexcept;
/// The command in a frame on 000h; empty for anything else: another identifier, a remote frame, a DLC other than 2 (CiA
/// 301 fixes it), an unknown specifier, a node-ID above 127.
[[nodiscard]] std::optional<NmtRequest> parse_nmt(const can::Frame& frame) noexcept;

/// The state after a command; resets give `initialising`.
[[nodiscard]] constexpr NmtState state_after(NmtCommand command) noexcept {
  switch (command) {
    case NmtCommand::start: return NmtState::operational;
    case NmtCommand::stop: return NmtState::stopped;
    case NmtCommand::enter_pre_operational: return NmtState::pre_operational;
    default: return NmtState::initialising;
  }
}

/// The communication objects that work in a state (CiA 301 §7.3.2.2.5, table 37; docs/protocols/cia301.md §NMT). LSS
/// is not listed: it works in every state, also unconfigured (CiA 305).
struct Services {
  bool pdo = false;
  bool sdo = false;
  bool sync_time = false;
  bool emcy = false;
  bool nmt_error_control = false;  ///< NMT commands, heartbeat, guarding
  friend constexpr bool operator==(const Services&, const Services&) noexcept = default;
};
[[nodiscard]] constexpr Services services_in(NmtState state) noexcept {
  switch (state) {
    case NmtState::operational: return {true, true, true, true, true};
    case NmtState::pre_operational: return {false, true, true, true, true};
    case NmtState::stopped: return {false, false, false, false, true};
    default: return {};
  }
}

/// The NMT state in byte 0 of an error control frame, without bit 7; empty for values that no state has.
[[nodiscard]] constexpr std::optional<NmtState> nmt_state(std::uint8_t byte) noexcept {
  switch (byte & 0x7FU) {
    case 0x00: return NmtState::initialising;
    case 0x04: return NmtState::stopped;
    case 0x05: return NmtState::operational;
    case 0x7F: return NmtState::pre_operational;
    default: return std::nullopt;
  }
}

}  // namespace berth::co
