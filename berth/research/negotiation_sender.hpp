/// How a device sends while it negotiates (paper 2): it queues one frame at a time, the pace depends on the bus load
/// that it hears, and times are by the device's own clock.
#pragma once

#include <array>
#include <cstdint>

#include "berth/base/random.hpp"
#include "berth/research/negotiation_rules.hpp"

namespace berth::research {

/// Bits heard in the last 100 ms.
class HeardLoad {
 public:
  void count(unsigned bits, rt::Time now) noexcept;
  /// The share of `bit_rate` (bit/s), 0..1.
  [[nodiscard]] double share(std::uint32_t bit_rate, rt::Time now) noexcept;

 private:
  static constexpr unsigned buckets = 4;
  static constexpr rt::Duration bucket = std::chrono::milliseconds(25);
  void roll(rt::Time now) noexcept;

  std::array<std::uint32_t, buckets> bits_{};
  rt::Time bucket_ends_{};
  unsigned bucket_ = 0;
};

class NegotiationSender {
 public:
  /// All must outlive this.
  NegotiationSender(rt::Executor& executor, NegotiatorOwner& owner, const NegotiatorOptions& options) noexcept
      : executor_(&executor), owner_(&owner), options_(&options), random_(options.seed) {}

  /// False: not possible now.
  bool put(const can::Frame& frame) noexcept;
  /// Takes back what is queued.
  void drop() noexcept;
  void sent() noexcept { queued_ = false; }
  [[nodiscard]] bool queued() const noexcept { return queued_; }
  /// The queued frame is lost, for example because the controller was restarted.
  [[nodiscard]] bool forgotten() const noexcept { return owner_->nothing_queued(); }
  /// Frames given to the device so far.
  [[nodiscard]] std::uint32_t frames() const noexcept { return frames_; }

  /// A frame that another node sent.
  void heard(const can::Frame& frame) noexcept;
  [[nodiscard]] double load() noexcept;
  [[nodiscard]] rt::Duration frame_time() const noexcept;
  /// From the end of one byte to the next one's start.
  [[nodiscard]] rt::Duration pace() noexcept;
  /// 0 in `literal`.
  [[nodiscard]] rt::Duration random(rt::Duration most) noexcept;
  [[nodiscard]] Random& dice() noexcept { return random_; }

  [[nodiscard]] rt::Time now() const noexcept { return executor_->now(); }
  [[nodiscard]] rt::Duration in_world(rt::Duration own) const noexcept { return owner_->in_world(own); }
  [[nodiscard]] rt::Time in(rt::Duration own) const noexcept { return now() + in_world(own); }
  void after(rt::Duration own, rt::Job& job) noexcept { executor_->after(owner_->in_world(own), job); }

 private:
  rt::Executor* executor_;
  NegotiatorOwner* owner_;
  const NegotiatorOptions* options_;
  Random random_;
  HeardLoad load_;
  std::uint32_t frames_ = 0;
  bool queued_ = false;  // a frame is with the owner
};

}  // namespace berth::research
