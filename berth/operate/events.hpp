/// What one bus's run reports to its owner: events, recurring ones only once, and milestones.
#pragma once

#include <array>
#include <bitset>
#include <functional>
#include <string>
#include <vector>

#include "berth/base/result.hpp"
#include "berth/co/emcy.hpp"
#include "berth/operate/report.hpp"
#include "berth/places/binding.hpp"
#include "berth/rt/executor.hpp"
#include "berth/rt/task.hpp"

namespace berth::operate {

/// The slots that are gateways: the buses beneath them are brought up first (paper 3).
struct BeneathFirst {
  std::bitset<128> gateways = {};  ///< node-IDs
  /// Called before this gateway is started. Returns when the buses beneath it are operational, or need not be. An
  /// error: the gateway is not started. May be empty.
  std::function<rt::Task<Result<void>>(NodeId gateway)> bring_up = {};
  /// Whether this EMCY of a gateway on this bus is about a node beneath it: then the part that manages the buses
  /// beneath reports it. May be empty.
  std::function<bool(NodeId gateway, const co::Emcy& message)> hands_on = {};
  [[nodiscard]] bool of(NodeId node) const noexcept { return bring_up && gateways[node.value()]; }
};

/// What a network reports to its owner. Called from the executor; must not destroy the network.
struct NetworkObserver {
  std::function<void(const Event&)> event = {};
  /// Each milestone once.
  std::function<void(Milestone)> milestone = {};
  /// Called before each step of a binding: for displays and fault plans. May be empty.
  std::function<void(const places::Binding&)> before_step = {};
  /// A command came by SDO (1023h of the master's device). Call `confirm` once, now or later, but not after the network
  /// is gone. False: nothing executes commands. May be empty.
  using Confirm = std::function<void(bool good, std::string reply)>;
  std::function<bool(std::string text, Confirm confirm)> command = {};
  BeneathFirst beneath = {};
};

class Events {
 public:
  Events(const rt::Executor& executor, std::string bus, NetworkObserver observer);

  void tell(EventKind kind, std::string slot, std::string text);
  /// Not again with the same words until `tell_again`.
  void tell_once(EventKind kind, const std::string& text);
  void tell_once(const Event& event);
  void tell_again() noexcept { told_.clear(); }
  /// Once: what failed and why. If no device acknowledges, the text is always the same, whatever was tried.
  void tell_failure(const std::string& what, const Error& error);
  /// A milestone, once.
  void reach(Milestone milestone);
  [[nodiscard]] const BeneathFirst& beneath() const noexcept { return observer_.beneath; }
  [[nodiscard]] const std::function<void(const places::Binding&)>& before_step() const noexcept {
    return observer_.before_step;
  }

 private:
  const rt::Executor& executor_;
  std::string bus_;
  NetworkObserver observer_;
  std::vector<std::string> told_;  // reported by `tell_once`
  std::array<bool, milestones> reached_{};
};

}  // namespace berth::operate
