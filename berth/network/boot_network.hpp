/// Parts of the boot-up of a network (`network_boot.hpp`): its plan, the bus interface, the events of error control,
/// and its reports about each slave.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/co/nmt.hpp"
#include "berth/manager/boot_rules.hpp"
#include "berth/network/boot_slave.hpp"

namespace berth::network {

/// One slave of the network list and its location. Target and source must stay as long as the plan is in use.
struct NetworkSlave {
  NodeId node;  ///< configured
  manager::SlaveRules rules = {};
  BootTarget* target = nullptr;
  BootSource* source = nullptr;
};

struct NetworkPlan {
  manager::Startup startup;          ///< 1F80h
  NodeId own;                        ///< the master's node-ID; unconfigured: it has none
  rt::Duration boot_time{};          ///< 1F89h: for all mandatory slaves together; 0: unlimited
  std::vector<NetworkSlave> slaves;  ///< each node-ID once; without unassigned ones and `own`
  /// Another master has led this network: nothing is reset at once, and an operational slave is left running (L) and
  /// not started again. The others are reset one by one and booted, whatever their boot-up stage was.
  bool taken_over = false;
};

struct NetworkTiming {
  rt::Duration boot_timeout = std::chrono::seconds(1);  ///< from a reset to the boot-up message; then the slave is
                                                        ///< asked
  rt::Duration pause = std::chrono::seconds(1);         ///< before a silent slave is asked again
  /// A halted startup resumes by itself when all mandatory slaves are ready. CiA 302-2 leaves that to the application
  /// (`NetworkBoot::operate`).
  bool resumes = false;
};

/// Bus operations that concern no single slave, and the master's own device.
class BootBus {
 public:
  virtual ~BootBus() = default;
  /// Returns when it was sent. Errc::bus: it was never sent. The master's own device does not hear it.
  [[nodiscard]] virtual rt::Task<Result<rt::Time>> command(co::NmtCommand command, co::NmtTarget target) = 0;
  /// Applies the command to the master's own device. One that resets itself calls `NetworkBoot::end` at once and
  /// `begin` when it is pre-operational again.
  virtual void apply(co::NmtCommand command) noexcept = 0;
};

/// Events of error control for `NetworkBoot`. Called from the executor, never inside one of its tasks.
class ErrorControl {
 public:
  /// A boot-up message. `expected`: a reset was sent to the node, and this is the first boot-up message since.
  virtual void boot_up(NodeId node, bool expected) noexcept = 0;
  /// Heartbeat or node guarding of a supervised slave was lost; called once.
  virtual void lost(NodeId node) noexcept = 0;
  /// The slave is back after `lost`, without a boot-up message.
  virtual void back(NodeId node) noexcept = 0;
  /// The NMT state in each received message except boot-up messages.
  virtual void told(NodeId node, NmtState state) noexcept = 0;
  /// An NMT command from another node. A slave that it started is not started again.
  virtual void overheard(const co::NmtRequest& request) noexcept = 0;

 protected:
  ~ErrorControl() = default;
};

/// The state of a slave in the boot-up.
enum class SlavePhase : std::uint8_t {
  idle,     ///< the network's boot-up has not reached it, or was ended
  booting,  ///< in the steps of `BootSlave`
  ready,    ///< the steps are done; not started yet
  started,  ///< NMT start was sent, or it was operational already (L)
  failed,   ///< `SlaveStatus::result` has the reason; its boot-up message starts again
  awaited,  ///< lost and commanded to reset; booted again after its boot-up message
};
/// "idle", "booting", ...
[[nodiscard]] std::string_view name(SlavePhase phase) noexcept;

struct SlaveStatus {
  NodeId node;
  manager::SlaveRules rules;
  SlavePhase phase = SlavePhase::idle;
  BootResult result;              ///< of its last finished boot-up
  std::optional<NmtState> state;  ///< last received; without error control: as commanded
  bool supervised = false;        ///< by heartbeat or node guarding

  [[nodiscard]] bool ready() const noexcept { return phase == SlavePhase::ready || phase == SlavePhase::started; }
};

struct NetworkEvent {
  enum class Kind : std::uint8_t {
    begun,           ///< the slaves are reset and booted
    slave_ready,     ///< its boot-up is done; `status` may be L
    slave_started,   ///< NMT start was sent to it
    slave_failed,    ///< its boot-up ended with `status`
    slave_lost,      ///< error control lost it
    slave_back,      ///< heard again without a boot-up message
    slave_rebooted,  ///< a boot-up message of a running slave that was not reset
    stranger,        ///< a boot-up message of an unassigned node: A
    halted,          ///< a mandatory slave failed, or the boot time is over: the network is not started
    ready,           ///< all mandatory slaves are ready
    operational,     ///< the master is operational
    all_stopped,     ///< for an error of a mandatory slave (1F80h bit 6)
    all_reset,       ///< for an error of a mandatory slave (1F80h bit 4)
    not_sent,        ///< an NMT command was never sent: no other node acknowledges it, or the port is down
  };
  Kind kind = Kind::begun;
  NodeId node = {};  ///< the slave concerned, if any; `halted`: the first mandatory one that is not ready
  manager::BootStatus status = manager::BootStatus::booted;
  std::string detail = {};  ///< of `slave_failed`, `not_sent`
};
/// "slave_ready", ...
[[nodiscard]] std::string_view name(NetworkEvent::Kind kind) noexcept;
/// One line for users: "node 5: D: its vendor-ID (1018h:01) is not the expected one (1F85h): ...; plug in ...".
[[nodiscard]] std::string text(const NetworkEvent& event);

}  // namespace berth::network
