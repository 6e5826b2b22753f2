/// A bus beneath a gateway on which Berth has no port (`port = "gateway"`; docs/multilevel.md): the gateway's
/// own NMT master gives the node-IDs, boots, starts and watches there, by its dictionary (CiA 302-2), and this makes
/// and keeps that dictionary right, through the gateway, and tells what becomes of the slots.
///
/// `bring_up` is called before the gateway itself is started. The network list is compared by its date (1020h of the
/// gateway's node beneath) and written when it is another; then that node is reset, and boots its bus. Where there are
/// further gateways on it, they are in the list and not booted yet: its other devices boot while the buses beneath them
/// are brought up, and then they are let in one by one (bit 2 of 1F81h, and 1F82h).
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "berth/co/nmt.hpp"
#include "berth/multilevel/event_log.hpp"
#include "berth/multilevel/gateway_access.hpp"
#include "berth/operate/events.hpp"
#include "berth/operate/list_trouble.hpp"
#include "berth/operate/network_list.hpp"
#include "berth/operate/seen.hpp"
#include "berth/rt/mailbox.hpp"
#include "berth/rt/scope.hpp"

namespace berth::operate {

/// How a bus of a machine is reached.
struct Way {
  std::string bus;                             ///< on which Berth has a port
  std::vector<multilevel::Hop> gateways = {};  ///< from there down, topmost first
  friend bool operator==(const Way&, const Way&) = default;
};
[[nodiscard]] Way way_to(const design::Machine& machine, const std::string& bus);
/// The bus to which a way leads, whether Berth has a port there or not; null: the machine has none there.
[[nodiscard]] const design::Bus* bus_at(const design::Machine& machine, const Way& way) noexcept;

class Beneath {
 public:
  /// `bus` and `routes` must stay; `routes`: of the bus at which `way` begins. `settings`: what the slots' devices
  /// shall have besides `config =`.
  Beneath(rt::Executor& executor, const design::Bus& bus, Way way, std::vector<places::SlotSpec> slots,
          const SlotSettings& settings, multilevel::Routes& routes, NetworkObserver observer);

  /// A bus beneath this one, and what makes it run (`bring_up`; a port of Berth's: what waits for that).
  struct Deeper {
    design::Gateway gateway;
    std::function<rt::Task<Result<void>>()> bring_up;
  };
  void add(Deeper deeper) { deeper_.push_back(std::move(deeper)); }
  /// `runs` tells whether its gateway does: one that ran before Berth began is not brought up, but watched.
  /// `operational`: called each time that this bus has become so; may be empty.
  void know_gateway(std::function<bool()> runs, std::function<void()> operational = {}) {
    gateway_runs_ = std::move(runs);
    operational_call_ = std::move(operational);
  }
  /// Watches: only then the slots' states are kept.
  void start();
  void stop() noexcept;

  /// Errors: no answer of the gateway, a list that it does not take, or not operational in time (`bus().startup`'s boot
  /// time, else `patience`) with a slot that is not optional.
  [[nodiscard]] rt::Task<Result<void>> bring_up();
  static constexpr rt::Duration patience = std::chrono::seconds(30);

  /// An emergency of this bus came up: `node` has sent it.
  void heard(NodeId node, const multilevel::LoggedEmcy& entry);

  [[nodiscard]] const design::Bus& bus() const noexcept { return bus_; }
  [[nodiscard]] const Way& way() const noexcept { return way_; }
  [[nodiscard]] std::vector<SlotReport> report() const;
  /// Every slot that is not optional.
  [[nodiscard]] bool operational() const noexcept;
  [[nodiscard]] bool idle() const noexcept { return !brings_up_; }
  /// A node of this bus.
  [[nodiscard]] co::SdoAccess& access(NodeId node) { return routes_.access({way_.gateways, node}); }
  /// What its master knows: the node-IDs of the network list that it has heard.
  [[nodiscard]] rt::Task<Result<std::vector<Seen>>> scan();

 private:
  struct Place {
    places::SlotSpec spec;
    SlotReport now;
    bool identified = false;  // since it became operational
    rt::Time booted_again{};  // the last time
    unsigned losses = 0;      // told by the gateway

    // Its boot-up has failed, by lost frames say: a master need not try again by itself.
    [[nodiscard]] bool left_lying(rt::Time at) const noexcept {
      constexpr rt::Duration long_enough = std::chrono::seconds(15);
      return at - std::max(now.since, booted_again) > long_enough;
    }
  };
  /// `nodes`: those that its master must know when it uses the list.
  rt::Task<Result<void>> put_list(const manager::Wanted& list, std::vector<NodeId> nodes);
  rt::Task<Result<void>> with_deeper(const manager::Wanted& whole);
  rt::Task<Result<void>> await_operational();
  rt::Task<void> watch();
  rt::Task<bool> look_around(std::optional<NodeId> told);
  rt::Task<void> adopt();
  /// `settled`: who is missing now is told; else it may come yet.
  rt::Task<Result<void>> look_at(Place& place, bool settled);
  rt::Task<bool> identify(Place& place);
  rt::Task<void> tell_missing(Place& place);
  /// `held_back`: these are not booted.
  [[nodiscard]] manager::Wanted list(std::span<const NodeId> held_back = {});
  void set_state(Place& place, places::SlotState state, std::string reason = {});
  void gateway_is_silent(const Error& error);
  [[nodiscard]] Place* at(NodeId node) noexcept;

  rt::Executor& executor_;
  const design::Bus& bus_;
  Way way_;
  SlotSettings settings_;
  multilevel::Routes& routes_;
  Events events_;
  std::vector<Place> places_;  // ascending by node-ID
  std::vector<Deeper> deeper_;
  std::function<void()> operational_call_;
  std::function<bool()> gateway_runs_;
  rt::Mailbox<NodeId, 256> wakes_;  // slots to be looked at now
  std::size_t next_ = 0;            // slot that is looked at next
  struct Silence {
    unsigned failures = 0;  // looks in a row that failed
    rt::Time rest_until{};  // its gateway did not answer: no look before, unless it runs again
    bool ran = false;       // the gateway, as the bus above knows it
  };
  Silence silence_;
  bool up_ = false;  // it was brought up
  bool was_operational_ = false;
  bool brings_up_ = false;
  bool has_list_ = false;  // its gateway, as far as is known; one that could not get it in time is tried again
  rt::Time again_at_{};
  bool was_reset_ = false;  // its gateway, because it missed nodes of a list that it had
  ListTrouble trouble_;     // what its master tells of node-IDs
  rt::Scope scope_;
};

}  // namespace berth::operate
