/// One segment while something is wrong: simulates every node bit by bit, with nodes in the same state together, until
/// all are idle again. Internal to `sim`.
#pragma once

#include <memory>
#include <vector>

#include "berth/sim/bits.hpp"
#include "berth/sim/deliveries.hpp"
#include "berth/sim/medium.hpp"

namespace berth::sim {

/// Nodes that see and do the same.
struct BitGroup {
  BitNode bits;
  std::vector<BusNode*> members;
  bool open = false;   ///< others in the same state may still join
  bool sees = false;   ///< the level of the bit
  bool drove = false;  ///< sent dominant in the bit before
};

class BitwisePlay {
 public:
  class Owner {
   public:
    /// All nodes are idle and the bitwise simulation is over, since `Medium::free_at`. No bit is under way.
    virtual void play_over() noexcept = 0;

   protected:
    ~Owner() = default;
  };
  BitwisePlay(Medium& medium, Deliveries& deliveries, Owner& owner) noexcept;
  ~BitwisePlay();

  /// Takes over all nodes at the beginning of the bit at `start`; `sending`: the contending nodes send their start of
  /// frame in it.
  void begin(rt::Time start, bool sending);
  /// Simulates the time since then, in which no node begins a frame.
  void catch_up();

  /// Adds a node that has arrived, or begins to count recessive bits. `pauses`: `start` lies in an intermission.
  void put(BusNode& node, rt::Time start, bool sending = false, bool pauses = false);
  void put(std::unique_ptr<BitGroup> group, std::uint32_t bit_rate, rt::Time start);
  /// Removes the node and returns its state; null when it is not simulated here.
  std::unique_ptr<BitGroup> take_out(BusNode& node);
  /// The bit grid of this rate: the beginning of one bit.
  [[nodiscard]] rt::Time grid(std::uint32_t bit_rate);
  /// The node's counters were set from outside.
  void preset_counters(BusNode& node);

 private:
  struct Domain;
  void end() noexcept;
  void edge(Domain& domain);
  void tick(Domain& domain, bool again);
  void begin_frames(Domain& domain);
  void join_started(Domain& domain, BitGroup& group);
  void frame_begun(Domain& domain, BusNode& node);
  void note(Domain& domain, BitGroup& group, const BitNode::Outcome& outcome);
  void note_failed(const Domain& domain, BitGroup& group, const BitNode::Outcome& outcome);
  void note_counters(BitGroup& group);
  void note_accepted(Domain& domain, BitGroup& group);
  void note_sent(Domain& domain, BusNode& node);
  void attempt_over(BusNode& node) noexcept;
  [[nodiscard]] bool seen(const Domain& domain, const BitGroup& group, bool dominant) const noexcept;
  [[nodiscard]] bool level_of_others(const Domain& domain, rt::Time at) const noexcept;
  [[nodiscard]] bool one_rate() const noexcept;
  void synchronise_others(const Domain& domain) noexcept;
  Domain& domain_of(std::uint32_t bit_rate, rt::Time start);
  void single_out_victims();

  Medium* medium_;
  Deliveries* deliveries_;
  Owner* owner_;
  std::vector<std::unique_ptr<Domain>> domains_;
  rt::Time since_{};
  rt::Time overload_at_{};  // when the last overload flag began
};

}  // namespace berth::sim
