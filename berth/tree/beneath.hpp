/// A bus beneath a gateway on which Berth has no port (`port = "gateway"`; docs/multilevel.md): the gateway's own NMT
/// master gives the node-IDs, boots, starts and watches there, by its dictionary (CiA 302-2). This makes and keeps that
/// dictionary right, through the gateway (`ListDelivery`), finds out how the slots stand (`WatchBeneath`), and tells it
/// (`SlotsBeneath`).
///
/// `bring_up` is called before the gateway itself is started.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "berth/rt/mailbox.hpp"
#include "berth/rt/scope.hpp"
#include "berth/tree/list_delivery.hpp"
#include "berth/tree/watch_beneath.hpp"

namespace berth::tree {

class Beneath {
 public:
  /// `bus` and `routes` must stay; `routes`: of the bus at which `way` begins. `settings`: what the slots' devices
  /// shall have besides `config =`.
  Beneath(rt::Executor& executor, const design::Bus& bus, Way way, std::vector<places::SlotSpec> slots,
          const manager::SlotSettings& settings, multilevel::Routes& routes, operate::NetworkObserver observer);

  void add(Deeper deeper) { delivery_.add(std::move(deeper)); }
  /// `runs` tells whether its gateway does: one that ran before Berth began is not brought up, but watched.
  /// `operational`: called each time that this bus has become so; may be empty.
  void know_gateway(std::function<bool()> runs, std::function<void()> operational = {});
  /// `call`: a loss was told that may be of this slot, and it runs; if it is a gateway's, the loss may be beneath it.
  void on_still_runs(std::function<void(NodeId)> call) { watch_.on_still_runs(std::move(call)); }
  /// Watches: only then the slots' states are kept.
  void start();
  void stop() noexcept;

  /// Errors: no answer of the gateway, a list that it does not take, or not operational in time (`bus().startup`'s boot
  /// time, else `patience`) with a slot that is not optional.
  [[nodiscard]] rt::Task<Result<void>> bring_up();
  static constexpr rt::Duration patience = std::chrono::seconds(30);

  /// An emergency came up that may be about this node: how it stands is asked for. `lost`: it told a loss (8130h).
  void ask(NodeId node, bool lost);
  /// The same of every slot.
  void ask_all();
  /// An EMCY 8150h of this slot's node.
  void collided(NodeId node);
  /// The gateway in this slot told that a mandatory bus beneath it has failed: it stops itself.
  void stops_itself(NodeId gateway) noexcept;

  [[nodiscard]] const design::Bus& bus() const noexcept { return slots_.bus(); }
  [[nodiscard]] const Way& way() const noexcept { return way_; }
  [[nodiscard]] SlotsBeneath& slots() noexcept { return slots_; }
  [[nodiscard]] std::vector<operate::SlotReport> report() const { return slots_.report(); }
  /// Every slot that is not optional, and its gateway has the network list, as far as is known: else that is brought
  /// in later, and restarts them.
  [[nodiscard]] bool operational() const noexcept { return provided_ && slots_.operational(); }
  /// Nothing goes on here but watching.
  [[nodiscard]] bool idle() const noexcept { return !brings_up_; }
  /// A node of this bus.
  [[nodiscard]] co::SdoAccess& access(NodeId node) { return routes_.access({way_.gateways, node}); }
  /// What its master knows: the node-IDs of the network list that it has heard.
  [[nodiscard]] rt::Task<Result<std::vector<operate::Seen>>> scan() { return watch_.scan(); }

 private:
  rt::Task<void> watch();
  rt::Task<void> adopt();
  rt::Task<void> look_at_list(bool returned);
  [[nodiscard]] bool is_due_again() noexcept;
  [[nodiscard]] bool ready_beneath(NodeId gateway) const;
  void provide(bool provided) noexcept;
  void tell_operational();

  rt::Executor& executor_;
  Way way_;
  multilevel::Routes& routes_;
  SlotsBeneath slots_;
  ListDelivery delivery_;
  WatchBeneath watch_;
  std::function<bool()> gateway_runs_;
  std::function<void()> operational_call_;
  rt::Mailbox<NodeId, 256> wakes_;
  bool up_ = false;         // it was brought up, or found running
  bool brings_up_ = false;  // now
  bool provided_ = false;   // its gateway has its list, as far as is known; else it is tried again
  bool foreign_ = false;    // its gateway ran with another list when Berth began
  rt::Time again_at_{};
  bool again_early_ = false;  // and once as soon as all of it runs
  rt::Time list_at_{};        // whether its gateway still has its list is asked then, while not all of it runs
  rt::Scope scope_;
};

}  // namespace berth::tree
