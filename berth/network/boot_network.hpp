/// What the boot-up of a network (`network_boot.hpp`) is made of: its plan, the bus as it uses it, what error control
/// tells it, and what it tells of each slave.
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

/// One slave of the network list, and where it is. Target and source must stay as long as the plan is in use.
struct NetworkSlave {
  NodeId node;  ///< configured
  manager::SlaveRules rules = {};
  BootTarget* target = nullptr;
  BootSource* source = nullptr;
};

struct NetworkPlan {
  manager::Startup startup;          ///< 1F80h
  NodeId own;                        ///< the master's node-ID; unconfigured: it has none
  rt::Duration boot_time{};          ///< 1F89h: for all mandatory slaves together; 0: for ever
  std::vector<NetworkSlave> slaves;  ///< each node-ID once; not assigned ones and `own` are left out
  /// Another master has led this network: nothing is reset at once, and a slave that is operational is left running (L)
  /// and not started again. The others are reset one by one and booted, whatever they were in the middle of.
  bool taken_over = false;
};

struct NetworkTiming {
  rt::Duration boot_timeout = std::chrono::seconds(1);  ///< from a reset to the boot-up message; then it is asked
  rt::Duration pause = std::chrono::seconds(1);         ///< before a silent slave is asked again
  /// A halted startup goes on by itself when the mandatory slaves are ready after all. CiA 302-2 leaves that to the
  /// application (`NetworkBoot::operate`).
  bool resumes = false;
};

/// The bus, for what concerns no single slave, and the master's own device.
class BootBus {
 public:
  virtual ~BootBus() = default;
  /// When it was sent. Errc::bus: it never left. The master's own device does not hear it.
  [[nodiscard]] virtual rt::Task<Result<rt::Time>> command(co::NmtCommand command, co::NmtTarget target) = 0;
  /// Does to the master's own device what the command says. One that resets itself calls `NetworkBoot::end` at once and
  /// `begin` when it is pre-operational again.
  virtual void apply(co::NmtCommand command) noexcept = 0;
};

/// What error control hears, told to `NetworkBoot`. From the executor, never inside one of its tasks.
class ErrorControl {
 public:
  /// A boot-up message. `expected`: a reset was sent to the node, and this is the first one since.
  virtual void boot_up(NodeId node, bool expected) noexcept = 0;
  /// Heartbeat or node guarding of a supervised slave is over; once.
  virtual void lost(NodeId node) noexcept = 0;
  /// It is there again after `lost`, without a boot-up message.
  virtual void back(NodeId node) noexcept = 0;
  /// An NMT state: each time that one is heard, boot-up messages left out.
  virtual void told(NodeId node, NmtState state) noexcept = 0;
  /// An NMT command of another node. A slave that it started is not started again.
  virtual void overheard(const co::NmtRequest& request) noexcept = 0;

 protected:
  ~ErrorControl() = default;
};

/// What becomes of a slave.
enum class SlavePhase : std::uint8_t {
  idle,     ///< the network's boot-up has not come to it, or was ended
  booting,  ///< the steps of `BootSlave`
  ready,    ///< they are done; not started yet
  started,  ///< NMT start was sent, or it was operational already (L)
  failed,   ///< `SlaveStatus::result` says why; a boot-up message of it begins anew
  awaited,  ///< lost and told to reset itself; booted again on its boot-up message
};
/// "idle", "booting", ...
[[nodiscard]] std::string_view name(SlavePhase phase) noexcept;

struct SlaveStatus {
  NodeId node;
  manager::SlaveRules rules;
  SlavePhase phase = SlavePhase::idle;
  BootResult result;              ///< of its last boot-up that ended
  std::optional<NmtState> state;  ///< heard last; of a slave without error control: as it was commanded
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
    slave_rebooted,  ///< a boot-up message of a slave that ran, which nobody had reset
    stranger,        ///< a boot-up message of a node that is not assigned: A
    halted,          ///< a mandatory slave failed, or the boot time is over: the network is not started
    ready,           ///< all mandatory slaves are ready
    operational,     ///< so is the master
    all_stopped,     ///< for an error of a mandatory slave (1F80h bit 6)
    all_reset,       ///< for an error of a mandatory slave (1F80h bit 4)
    not_sent,        ///< an NMT command never left: no other node acknowledges it, or the port is down
  };
  Kind kind = Kind::begun;
  NodeId node = {};  ///< the slave, where one is concerned; `halted`: the first mandatory one that is not ready
  manager::BootStatus status = manager::BootStatus::booted;
  std::string detail = {};  ///< of `slave_failed`, `not_sent`
};
/// "slave_ready", ...
[[nodiscard]] std::string_view name(NetworkEvent::Kind kind) noexcept;
/// One line for people: "node 5: D: its vendor-ID (1018h:01) is not the expected one (1F85h): ...; plug in ...".
[[nodiscard]] std::string text(const NetworkEvent& event);

}  // namespace berth::network
