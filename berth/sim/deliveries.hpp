/// What nodes are told at the end of a bit that is yet to come, while the segment is played bit by bit. Internal to
/// `sim`.
#pragma once

#include <vector>

#include "berth/sim/bus_node.hpp"

namespace berth::sim {

class Deliveries final : private rt::Job {
 public:
  class Owner {
   public:
    /// The head of the node's queue went out, at `at`.
    virtual void sent(BusNode& node, rt::Time at) noexcept = 0;

   protected:
    ~Owner() = default;
  };
  Deliveries(rt::Executor& executor, Owner& owner) noexcept : executor_(&executor), owner_(&owner) {}

  // Times never go back from one to the next; `schedule` after the last one.
  void received(BusNode& node, const can::Frame& frame, rt::Time at) { pending_.push_back({&node, frame, at, false}); }
  void sent(BusNode& node, rt::Time at) { pending_.push_back({&node, {}, at, true}); }
  void schedule() noexcept {
    if (!pending_.empty()) executor_->at(pending_.front().at, *this);
  }
  /// The node no longer does what it did: a frame that it sent is on the wire whole and is confirmed now; the rest
  /// goes.
  void settle(BusNode& node) noexcept;
  /// The node goes over to another segment.
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
