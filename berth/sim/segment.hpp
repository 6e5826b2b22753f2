/// One piece of wire and the nodes on it: a part of a `Bus`. Internal to `sim`.
///
/// A frame without errors costs two jobs: `arbitrate` at the sample point of its start-of-frame bit and `finish` at the
/// end of its end-of-frame. Everything else is simulated bit by bit (`BitwisePlay`) until every node is idle again. The
/// segment decides which of the two applies; its parts share the `Medium`.
#pragma once

#include <vector>

#include "berth/sim/bitwise.hpp"
#include "berth/sim/deliveries.hpp"
#include "berth/sim/integration.hpp"
#include "berth/sim/medium.hpp"

namespace berth::sim {

class Segment final : private rt::Job,
                      private Integration::Owner,
                      private Deliveries::Owner,
                      private BitwisePlay::Owner {
 public:
  explicit Segment(Bus& bus) noexcept;

  /// A node joins, with its count of recessive bits and its offered frames.
  void join(BusNode& node);
  void leave(BusNode& node) noexcept;
  /// The node starts counting recessive bits again.
  void integrate(BusNode& node, std::uint32_t runs) noexcept;
  /// The node's offer may have changed.
  void offer(BusNode& node) noexcept;
  /// Power, bit rate or listen-only are about to change: the node ends its activity.
  void disturb(BusNode& node) noexcept;
  /// ... and have changed.
  void refresh() noexcept;
  /// The node's counters were set from outside.
  void counters_preset(BusNode& node) { play_.preset_counters(node); }
  /// The node moves to another segment and keeps its activity.
  void hand_over(BusNode& node, Segment& to);

  [[nodiscard]] bool idle() const noexcept { return state_ == State::quiet || state_ == State::starting; }
  [[nodiscard]] Medium& medium() noexcept { return medium_; }

 private:
  enum class State : std::uint8_t { quiet, starting, busy, bitwise };

  void run() noexcept override;
  void integration_due() noexcept override;
  void integrated(BusNode& node) noexcept override;
  void sent(BusNode& node, rt::Time at) noexcept override;
  void play_over() noexcept override;

  void schedule_start() noexcept;
  void schedule_integration() noexcept;
  void arbitrate() noexcept;
  [[nodiscard]] bool pick_senders() noexcept;
  [[nodiscard]] bool pick_among_several() noexcept;
  void finish() noexcept;
  void give_up() noexcept;
  void detach(BusNode& node) noexcept;
  void play(rt::Time start, bool sending);
  void replay();

  Medium medium_;
  State state_ = State::quiet;
  can::Frame frame_;  // under way
  unsigned frame_bits_ = 0;
  rt::Duration frame_time_{};      // of the senders
  bool unanswered_ = false;        // busy with the unacknowledged frame of a passive node
  std::vector<BusNode*> senders_;  // of the current frame
  Integration integration_;
  Deliveries deliveries_;
  BitwisePlay play_;
};

}  // namespace berth::sim
