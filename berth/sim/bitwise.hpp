/// One segment while something is wrong: every node bit by bit, nodes in one state together, until all are idle again.
/// Internal to `sim`.
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
  bool drove = false;  ///< dominant in the bit before
};

class BitwisePlay {
 public:
  class Owner {
   public:
    /// All nodes are idle; the play is over, and `Medium::free_at` says since when. No bit of it is under way.
    virtual void play_over() noexcept = 0;

   protected:
    ~Owner() = default;
  };
  BitwisePlay(Medium& medium, Deliveries& deliveries, Owner& owner) noexcept;
  ~BitwisePlay();

  /// All nodes as they are at the beginning of the bit at `start`; `sending`: those that contend send their start of
  /// frame in it.
  void begin(rt::Time start, bool sending);
  /// What has happened since then is played again, and no node begins a frame in it.
  void catch_up();

  /// A node that has come, or begins to count recessive bits. `pauses`: `start` lies in an intermission.
  void put(BusNode& node, rt::Time start, bool sending = false, bool pauses = false);
  void put(std::unique_ptr<BitGroup> group, std::uint32_t bit_rate, rt::Time start);
  /// The node alone, as it is; null when it does not play.
  std::unique_ptr<BitGroup> take_out(BusNode& node);
  /// Where the bits of this rate lie: the beginning of one.
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
