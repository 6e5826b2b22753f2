/// Nodes that must see recessive bits before they take part. Internal to `sim`.
///
/// The segment counts the bits while nothing disturbs: each frame without error gives one run of 11 (ACK delimiter,
/// end-of-frame, intermission), an idle bus one for each 11 bits.
#pragma once

#include "berth/sim/segment_nodes.hpp"

namespace berth::sim {

class Integration final : private rt::Job {
 public:
  class Owner {
   public:
    /// The last run of an integrating node is expected to be over.
    virtual void integration_due() noexcept = 0;
    virtual void integrated(BusNode& node) noexcept = 0;

   protected:
    ~Owner() = default;
  };
  Integration(rt::Executor& executor, const SegmentNodes& nodes, Owner& owner) noexcept
      : executor_(&executor), nodes_(&nodes), owner_(&owner) {}

  /// The bits up to `until` were recessive. Reports each node that has seen all its runs to the owner.
  void count(rt::Time until) noexcept;
  /// A bit before `at` was dominant.
  void dominant_until(rt::Time at) noexcept;
  /// On an idle bus: schedules the time when the next node is ready. A frame that begins at `start` makes the bus
  /// dominant: the rest is counted when it has ended.
  void schedule(rt::Time start) noexcept;
  using rt::Job::cancel;

 private:
  void run() noexcept override { owner_->integration_due(); }

  rt::Executor* executor_;
  const SegmentNodes* nodes_;
  Owner* owner_;
};

}  // namespace berth::sim
