/// Nodes that must see recessive bits before they take part. Internal to `sim`.
///
/// The bits are counted on the segment's behalf while nothing disturbs: each frame that ends well gives one run of 11
/// (ACK delimiter, end-of-frame, intermission), an idle bus one for each 11 bits.
#pragma once

#include "berth/sim/segment_nodes.hpp"

namespace berth::sim {

class Integration final : private rt::Job {
 public:
  class Owner {
   public:
    /// The last run of a node that integrates is over, by what is known.
    virtual void integration_due() noexcept = 0;
    virtual void integrated(BusNode& node) noexcept = 0;

   protected:
    ~Owner() = default;
  };
  Integration(rt::Executor& executor, const SegmentNodes& nodes, Owner& owner) noexcept
      : executor_(&executor), nodes_(&nodes), owner_(&owner) {}

  /// The bits up to `until` were recessive. Tells the owner of each node that has seen all its runs.
  void count(rt::Time until) noexcept;
  /// A bit before `at` was dominant.
  void dominant_until(rt::Time at) noexcept;
  /// On an idle bus: when the next node is through. A frame that begins at `start` is dominant then: what is left is
  /// counted when it has ended.
  void schedule(rt::Time start) noexcept;
  using rt::Job::cancel;

 private:
  void run() noexcept override { owner_->integration_due(); }

  rt::Executor* executor_;
  const SegmentNodes* nodes_;
  Owner* owner_;
};

}  // namespace berth::sim
