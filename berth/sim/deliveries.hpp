/// Reports to nodes at the end of a bit in the future, while the segment is simulated bit by bit. Internal to `sim`.
#pragma once

#include <vector>

#include "berth/sim/bus_node.hpp"

namespace berth::sim {

class Deliveries final : private rt::Job {
 public:
  class Owner {
   public:
    /// The head of the node's queue was sent, at `at`.
    virtual void sent(BusNode& node, rt::Time at) noexcept = 0;

   protected:
    ~Owner() = default;
  };
  Deliveries(rt::Executor& executor, Owner& owner) noexcept : executor_(&executor), owner_(&owner) {}

  // Call these in order of time, and `schedule` after the last one.
  void received(BusNode& node, const can::Frame& frame, rt::Time at) { pending_.push_back({&node, frame, at, false}); }
  void sent(BusNode& node, rt::Time at) { pending_.push_back({&node, {}, at, true}); }
  void schedule() noexcept {
    if (!pending_.empty()) executor_->at(pending_.front().at, *this);
  }
  /// The node ends its activity: a completely sent frame is confirmed at once; its other reports are dropped.
  void settle(BusNode& node) noexcept;
  /// The node moves to another segment.
  void hand_over(const BusNode& node, Deliveries& to);

 private:
  struct Pending {
    BusNode* node;
    can::Frame frame;
    rt::Time at;
    bool sent;
  };
  void run() noexcept override;

  rt::Executor* executor_;
  Owner* owner_;
  std::vector<Pending> pending_;
};

}  // namespace berth::sim
