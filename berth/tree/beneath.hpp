/// A bus beneath a gateway on which Berth has no port (`port = "gateway"`; docs/multilevel.md). There the gateway's own
/// NMT master assigns node-IDs, boots, starts and watches the nodes, by its dictionary (CiA 302-2). This class writes
/// and maintains that dictionary through the gateway (`ListDelivery`), finds out the slots' states (`WatchBeneath`),
/// and reports them (`SlotsBeneath`).
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
  /// `bus` and `routes` must outlive this; `routes`: of the bus at which `way` begins. `settings`: values for the
  /// slots' devices besides `config =`.
  Beneath(rt::Executor& executor, const design::Bus& bus, Way way, std::vector<places::SlotSpec> slots,
          const manager::SlotSettings& settings, multilevel::Routes& routes, operate::NetworkObserver observer);

  void add(Deeper deeper) { delivery_.add(std::move(deeper)); }
  /// `runs`: whether its gateway runs; one that ran before Berth began is not brought up, but watched. `operational`:
  /// called each time this bus has become operational; may be empty.
  void know_gateway(std::function<bool()> runs, std::function<void()> operational = {});
  /// `call`: a loss was reported that may be of this slot, but the slot runs; if it is a gateway, the loss may be
  /// beneath it.
  void on_still_runs(std::function<void(NodeId)> call) { watch_.on_still_runs(std::move(call)); }
  /// Watches: the slots' states are only maintained after this.
  void start();
  void stop() noexcept;

  /// Errors: no answer from the gateway; it refuses the list; a slot that is not optional is not operational in time
  /// (`bus().startup`'s boot time, else `patience`).
  [[nodiscard]] rt::Task<Result<void>> bring_up();
  static constexpr rt::Duration patience = std::chrono::seconds(30);

  /// An EMCY that may be about this node was forwarded: its state is asked. `lost`: it reported a loss (8130h).
  void ask(NodeId node, bool lost);
  /// The same for every slot.
  void ask_all();
  /// An EMCY 8150h of this slot's node.
  void collided(NodeId node);
  /// The gateway in this slot reported that a mandatory bus beneath it has failed: it stops itself.
  void stops_itself(NodeId gateway) noexcept;

  [[nodiscard]] const design::Bus& bus() const noexcept { return slots_.bus(); }
  [[nodiscard]] const Way& way() const noexcept { return way_; }
  [[nodiscard]] SlotsBeneath& slots() noexcept { return slots_; }
  [[nodiscard]] std::vector<operate::SlotReport> report() const { return slots_.report(); }
  /// Every slot that is not optional, and, as far as is known, its gateway has the network list: otherwise that is
  /// written later, which restarts them.
  [[nodiscard]] bool operational() const noexcept { return provided_ && slots_.operational(); }
  /// Nothing to do here but watch.
  [[nodiscard]] bool idle() const noexcept { return !brings_up_; }
  /// A node of this bus.
  [[nodiscard]] co::SdoAccess& access(NodeId node) { return routes_.access({way_.gateways, node}); }
  /// The nodes of the network list that its master has heard.
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
  bool provided_ = false;   // as far as is known, its gateway has its list; else it is tried again
  bool foreign_ = false;    // its gateway ran with another list when Berth began
  rt::Time again_at_{};
  bool again_early_ = false;  // and once as soon as all slots run
  rt::Time list_at_{};        // when to ask whether its gateway still has its list, while not all slots run
  rt::Scope scope_;
};

}  // namespace berth::tree
