/// Finds out how the slots of a bus beneath a gateway stand: asks 1F82h of the gateway's NMT master, one slot after the
/// other, and at once those about which an emergency came up. A slot's state changes by an answer that is its own,
/// never by an emergency alone: the message names no port of a gateway, may have lost its deepest node-IDs, and 8130h
/// is also what a device tells that misses somebody else's heartbeat.
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
  /// All must stay; `routes`: of the bus at which `way` begins.
  WatchBeneath(SlotsBeneath& slots, const Way& way, multilevel::Routes& routes);

  /// What the bus above knows of the gateway: it runs. True: and did not before.
  bool set_gateway_runs(bool runs) noexcept;
  /// A bus beneath the gateway in this slot of this bus fails or recovers; true: all of them run, and the gateway may
  /// be started again when it has stopped itself.
  void set_ready(std::function<bool(NodeId gateway)> ready) { ready_ = std::move(ready); }
  /// A loss was told that may be of this slot, and it runs.
  void on_still_runs(std::function<void(NodeId)> call) { still_runs_ = std::move(call); }
  /// It is brought up, and its gateway waits: who the devices are is asked later.
  void set_hurried(bool hurried) noexcept { hurries_ = hurried; }
  /// A node that does not start is reset: its master has the list that Berth made.
  void set_provided(bool provided) noexcept { provided_ = provided; }

  /// An emergency came that may be about this slot: its state is asked for. `lost`: it told a loss (8130h), and what
  /// was asked before it counts for nothing. False: there is no such slot.
  bool ask(NodeId node, bool lost);

  /// An EMCY 8150h came of this slot's node: another device uses its identifiers. Two at once come of two devices under
  /// one node-ID, since each hears the other's; then the slot is `duplicate` until its node restarts or has the error
  /// no more (1001h).
  void collided(PlaceBeneath& place);

  /// Asks of all that do not run, until all run that have to or `deadline` is over. Errors: Errc::mismatch with the
  /// node that does not.
  [[nodiscard]] rt::Task<Result<void>> await_operational(rt::Time deadline);
  /// Those of which something was heard; else the next one, and all that do not run or are not known. What of the
  /// devices is known is asked for when nothing else waits for the gateways.
  [[nodiscard]] rt::Task<void> look_around();
  /// Only those of which something was heard.
  [[nodiscard]] rt::Task<void> look_at_asked();
  /// Its gateway does not answer: nothing is known of the slots any more.
  void gateway_is_silent(const Error& error);
  /// What its master knows: the nodes that it hears.
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
  std::bitset<128> told_lost_;  // of `asked_`: by 8130h
  std::size_t next_ = 0;        // slot that is looked at next
  struct Silence {
    unsigned failures = 0;  // looks in a row that failed
    rt::Time rest_until{};  // its gateway did not answer: no look before, unless it runs again
    bool ran = false;       // the gateway, as the bus above knows it
  };
  Silence silence_;
  bool provided_ = false;
  bool hurries_ = false;
};

}  // namespace berth::tree
