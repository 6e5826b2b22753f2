/// A session's buses beneath gateways (docs/multilevel.md): those on which Berth has no port, the way to each, and what
/// must run before a gateway is started.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "berth/multilevel/event_log.hpp"
#include "berth/operate/network.hpp"
#include "berth/tree/beneath.hpp"
#include "berth/tree/emcy_origins.hpp"

namespace berth::tree {

class Tree {
 public:
  using Networks = std::vector<std::unique_ptr<operate::Network>>;

  /// All must outlive this. `networks` may be filled later.
  Tree(rt::Executor& executor, const design::Machine& machine, const Networks& networks) noexcept
      : executor_(&executor), machine_(&machine), networks_(&networks), resets_(executor) {}

  /// The data that a network of this bus needs before it is made.
  [[nodiscard]] operate::BeneathFirst first_of(const std::string& bus);
  /// Call once, when all networks are there. `settings`: of slots on any bus. Errors: `invalid`, the topmost bus above
  /// a bus beneath gateways is missing.
  Result<void> open(const std::function<void(const operate::Event&)>& events,
                    const manager::SlotSettings& settings = {});
  void start();
  void stop() noexcept;
  /// Call it before the networks are destroyed.
  void clear() noexcept;

  [[nodiscard]] const std::vector<std::unique_ptr<Beneath>>& buses() const noexcept { return buses_; }
  /// Null: there is none of this name.
  [[nodiscard]] Beneath* bus(std::string_view name) const noexcept;
  /// All nodes reachable through a bus with a port, by their paths: the one client of its gateways. Lives as long as
  /// this.
  [[nodiscard]] multilevel::Routes& routes(operate::Network& network);
  /// Every bus without which its gateway does not start.
  [[nodiscard]] bool operational() const noexcept;
  [[nodiscard]] bool idle() const noexcept;

 private:
  struct Root {
    Root(operate::Network& network, const multilevel::GatewayTimes& gateways)
        : routes(network.services().sdo, network.services().sdo.options(), gateways) {}
    multilevel::Routes routes;
    std::unique_ptr<multilevel::EventLog> log;
  };
  rt::Task<Result<void>> bring_up(std::string bus, NodeId gateway);
  void heard(const std::string& bus, const multilevel::LoggedEmcy& entry);
  void note_stopping(const std::string& top, const multilevel::EmcyReading& reading, const EmcyOrigins& origins);
  rt::Task<void> reset_stopped(operate::Network& network, NodeId gateway);
  void tell(const std::string& bus, const multilevel::LoggedEmcy& entry, const EmcyOrigins& origins);
  void still_runs(const Beneath& above, NodeId gateway);
  [[nodiscard]] std::string path_of(const design::Slot& slot) const;
  [[nodiscard]] operate::Network* network(std::string_view bus) const noexcept;

  rt::Executor* executor_;
  const design::Machine* machine_;
  const Networks* networks_;
  std::function<void(const operate::Event&)> events_;
  std::map<const operate::Network*, std::unique_ptr<Root>> roots_;
  std::vector<std::unique_ptr<Beneath>> buses_;  // each above those beneath it
  rt::Scope resets_;
};

}  // namespace berth::tree
