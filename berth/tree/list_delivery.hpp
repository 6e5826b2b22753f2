/// Writes the network list of a bus into its gateway's NMT master and activates it: compares it by its date, writes it,
/// restarts the master, and adds further gateways when the buses beneath them run.
///
/// If there are further gateways on the bus, its first list has them but does not boot them (bit 2 of 1F81h): the other
/// devices boot while the buses beneath those gateways are brought up. Then the gateways are let in one by one.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "berth/multilevel/gateway_access.hpp"
#include "berth/tree/gateway_master.hpp"
#include "berth/tree/network_list.hpp"
#include "berth/tree/slots_beneath.hpp"
#include "berth/tree/way.hpp"

namespace berth::tree {

/// A bus beneath a gateway on this one, and the function that brings it up (without a port `bring_up`; with a port of
/// Berth's it waits for the bus's network).
struct Deeper {
  design::Gateway gateway;
  std::function<rt::Task<Result<void>>()> bring_up;
  std::function<bool()> operational;
};

class ListDelivery {
 public:
  /// All must outlive this; `routes`: of the bus at which `way` begins. `settings`: values for the slots' devices
  /// besides `config =`.
  ListDelivery(rt::Executor& executor, SlotsBeneath& slots, const Way& way, manager::SlotSettings settings,
               multilevel::Routes& routes);
  void add(Deeper deeper) { deeper_.push_back(std::move(deeper)); }
  [[nodiscard]] const std::vector<Deeper>& deeper() const noexcept { return deeper_; }

  /// Returns when the list is in the master and in use, or the master restarts with it. Errors: as in
  /// `GatewayMaster::bring`. `was_there`: the master already had the whole list, and the buses beneath are not brought
  /// up yet.
  [[nodiscard]] rt::Task<Result<void>> deliver(bool& was_there);
  /// Brings up all of them. Errors: that of the first mandatory one.
  [[nodiscard]] rt::Task<Result<void>> bring_up_deeper();

  /// The list of a gateway that ran before Berth began.
  enum class Found : std::uint8_t {
    in_use,      ///< with this list
    unused,      ///< this list, but its master has no node of it: an earlier Berth ended before the restart
    unfinished,  ///< the first list, without the gateways on the bus; or an unfinished one
    another      ///< with any other list
  };
  [[nodiscard]] rt::Task<Found> look();
  /// The written list is lost: the master lost its power before saving it, or was replaced.
  [[nodiscard]] rt::Task<bool> is_lost();

 private:
  rt::Task<Result<void>> bring(const manager::Wanted& list, bool& changed);
  rt::Task<void> tell_progress();
  rt::Task<Result<void>> put(const manager::Wanted& list, std::vector<NodeId> nodes);
  rt::Task<Result<void>> put_in_steps(const manager::Wanted& whole);
  rt::Task<Result<void>> let_in(const manager::Wanted& first, const manager::Wanted& whole);
  rt::Task<void> await_heard(NodeId node);
  [[nodiscard]] manager::Wanted list(std::span<const NodeId> held_back = {});
  [[nodiscard]] std::vector<NodeId> gateways() const;
  [[nodiscard]] co::SdoAccess& access(NodeId node) { return routes_.access({way_.gateways, node}); }

  rt::Executor& executor_;
  SlotsBeneath& slots_;
  const Way& way_;
  manager::SlotSettings settings_;
  multilevel::Routes& routes_;
  GatewayMaster master_;
  std::vector<Deeper> deeper_;
  manager::Progress progress_;
  bool restarted_ = false;                             // the master was, because it missed nodes of a list that it had
  std::optional<manager::ConfigurationDate> undated_;  // the list that was there, and is to be saved anew
};

}  // namespace berth::tree
