/// One stretch of wire and the nodes on it: what a `Bus` is made of. Internal to `sim`.
///
/// A frame with which nothing is wrong costs two jobs: `arbitrate` at the sample point of its start-of-frame bit and
/// `finish` at the end of its end-of-frame. Whatever else happens is played bit by bit (`BitwisePlay`) until every node
/// is idle again. The segment says which of the two it is; what its parts share is the `Medium`.
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

  /// A node joins, with what it has seen of recessive bits and the frames that it offers.
  void join(BusNode& node);
  void leave(BusNode& node) noexcept;
  /// The node begins to count recessive bits anew.
  void integrate(BusNode& node, std::uint32_t runs) noexcept;
  /// What the node offers may have changed.
  void offer(BusNode& node) noexcept;
  /// Power, bit rate or listen-only are about to change: the node no longer does what it did.
  void disturb(BusNode& node) noexcept;
  /// ... and have changed.
  void refresh() noexcept;
  /// The node's counters were set from outside.
  void counters_preset(BusNode& node) { play_.preset_counters(node); }
  /// The node goes over to another segment with whatever it is doing.
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
  rt::Duration frame_time_{};      // of them
  bool unanswered_ = false;        // busy with the frame of a passive node that no node acknowledges
  std::vector<BusNode*> senders_;  // of it
  Integration integration_;
  Deliveries deliveries_;
  BitwisePlay play_;
};

}  // namespace berth::sim
