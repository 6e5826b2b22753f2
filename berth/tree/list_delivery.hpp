/// Brings the network list of a bus into its gateway's NMT master and into use: compares it by its date, writes it,
/// restarts the master, and lets further gateways in when the buses beneath them run.
///
/// Where there are further gateways on the bus, they are in its first list and not booted yet (bit 2 of 1F81h): its
/// other devices boot while the buses beneath those gateways are brought up. Then the gateways are let in one by one.
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

/// A bus beneath a gateway on this one, and what makes it run (without a port `bring_up`; with one of Berth's: what
/// waits for its network).
struct Deeper {
  design::Gateway gateway;
  std::function<rt::Task<Result<void>>()> bring_up;
  std::function<bool()> operational;
};

class ListDelivery {
 public:
  /// All must stay; `routes`: of the bus at which `way` begins. `settings`: what the slots' devices shall have besides
  /// `config =`.
  ListDelivery(rt::Executor& executor, SlotsBeneath& slots, const Way& way, manager::SlotSettings settings,
               multilevel::Routes& routes);
  void add(Deeper deeper) { deeper_.push_back(std::move(deeper)); }
  [[nodiscard]] const std::vector<Deeper>& deeper() const noexcept { return deeper_; }

  /// The list is there and in use, or its master restarts with it. Errors: as `GatewayMaster::bring`. `was_there`: it
  /// had the whole list already, and the buses beneath are not brought up yet.
  [[nodiscard]] rt::Task<Result<void>> deliver(bool& was_there);
  /// All of them. Errors: of the first of those that are mandatory.
  [[nodiscard]] rt::Task<Result<void>> bring_up_deeper();

  /// How its gateway, which ran before Berth began, is provided.
  enum class Found : std::uint8_t {
    in_use,      ///< with this list
    unused,      ///< with this list, of which its master has no node: an earlier Berth ended before the restart
    unfinished,  ///< with the first list, without the gateways on the bus; or with none that anybody finished
    another      ///< with any other list
  };
  [[nodiscard]] rt::Task<Found> look();
  /// The list that was brought in is there no more: the master lost its power before it was saved, or is another one.
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
  bool restarted_ = false;                             // the master, because it missed nodes of a list that it had
  std::optional<manager::ConfigurationDate> undated_;  // the list that was there, and is to be saved anew
};

}  // namespace berth::tree
