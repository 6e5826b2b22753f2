/// Finds out the states of the slots of a bus beneath a gateway: reads 1F82h of the gateway's NMT master, one slot
/// after the other, and at once for those that an EMCY is about. Only an answer about the slot itself changes its
/// state, never an EMCY alone: the message names no port of a gateway, may have lost its deepest node-IDs, and a device
/// also sends 8130h when it misses another node's heartbeat.
#pragma once

#include <bitset>
#include <functional>
#include <optional>
#include <vector>

#include "berth/multilevel/gateway_access.hpp"
#include "berth/operate/seen.hpp"
#include "berth/tree/gateway_master.hpp"
#include "berth/tree/list_trouble.hpp"
#include "berth/tree/slots_beneath.hpp"
#include "berth/tree/way.hpp"

namespace berth::tree {

class WatchBeneath {
 public:
  /// All must outlive this; `routes`: of the bus at which `way` begins.
  WatchBeneath(SlotsBeneath& slots, const Way& way, multilevel::Routes& routes);

  /// Whether the gateway runs, as the bus above knows. True: it runs and did not before.
  bool set_gateway_runs(bool runs) noexcept;
  /// `ready`: whether all buses beneath the gateway in this slot run, so that the gateway may be started again after it
  /// stopped itself.
  void set_ready(std::function<bool(NodeId gateway)> ready) { ready_ = std::move(ready); }
  /// A loss was reported that may be of this slot, but the slot runs.
  void on_still_runs(std::function<void(NodeId)> call) { still_runs_ = std::move(call); }
  /// The bus is brought up, and its gateway waits: the devices' identities are read later.
  void set_hurried(bool hurried) noexcept { hurries_ = hurried; }
  /// A node that does not start is reset, because its master has Berth's list.
  void set_provided(bool provided) noexcept { provided_ = provided; }

  /// An EMCY came that may be about this slot: its state is asked. `lost`: it reported a loss (8130h), and earlier
  /// answers do not count. False: there is no such slot.
  bool ask(NodeId node, bool lost);

  /// An EMCY 8150h came from this slot's node: another device uses its identifiers. Two at once come from two devices
  /// under one node-ID, since each receives the other's frames; then the slot is `duplicate` until its node restarts or
  /// the error is gone (1001h).
  void collided(PlaceBeneath& place);

  /// Asks all nodes that do not run, until all mandatory ones run or `deadline` is over. Errors: Errc::mismatch with
  /// the node that does not run.
  [[nodiscard]] rt::Task<Result<void>> await_operational(rt::Time deadline);
  /// Asks the nodes of which something was heard; else the next one, and all that do not run or are unknown. The
  /// devices' identities are read when nothing else waits for the gateways.
  [[nodiscard]] rt::Task<void> look_around();
  /// Only the nodes of which something was heard.
  [[nodiscard]] rt::Task<void> look_at_asked();
  /// Its gateway does not answer: nothing is known of the slots any more.
  void gateway_is_silent(const Error& error);
  /// The nodes that its master hears.
  [[nodiscard]] rt::Task<Result<std::vector<operate::Seen>>> scan();

 private:
  using Answer = Result<std::optional<std::uint8_t>>;
  rt::Task<Answer> state_of(PlaceBeneath& place);
  rt::Task<bool> look_at_all(std::vector<NodeId> nodes);
  rt::Task<Result<void>> look_at(PlaceBeneath& place, bool settled);
  rt::Task<Result<void>> look_at_stopped(PlaceBeneath& place);
  rt::Task<Result<void>> look_at_waiting(PlaceBeneath& place);
  rt::Task<void> look_at_missing(PlaceBeneath& place);
  rt::Task<Result<void>> look_at_running(PlaceBeneath& place);
  rt::Task<bool> is_doubled(PlaceBeneath& place);
  rt::Task<bool> identify(PlaceBeneath& place);
  [[nodiscard]] std::vector<NodeId> take_asked();
  [[nodiscard]] co::SdoAccess& access(NodeId node) { return routes_.access({way_.gateways, node}); }

  SlotsBeneath& slots_;
  const Way& way_;
  multilevel::Routes& routes_;
  GatewayMaster master_;
  ListTrouble trouble_;  // what its master tells of node-IDs
  std::function<bool(NodeId)> ready_;
  std::function<void(NodeId)> still_runs_;
  std::bitset<128> asked_;
  std::bitset<128> told_lost_;  // those of `asked_` with 8130h
  std::size_t next_ = 0;        // the slot to look at next
  struct Silence {
    unsigned failures = 0;  // failed looks in a row
    rt::Time rest_until{};  // its gateway did not answer: no look before this time, unless it runs again
    bool ran = false;       // the gateway ran, as the bus above knows it
  };
  Silence silence_;
  bool provided_ = false;
  bool hurries_ = false;
};

}  // namespace berth::tree
