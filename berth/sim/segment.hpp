/// One stretch of wire and the nodes on it: what a `Bus` is made of. Internal to `sim`.
///
/// A frame with which nothing is wrong costs two jobs: `arbitrate` at the sample point of its start-of-frame bit and
/// `finish` at the end of its end-of-frame. Whatever else happens is played bit by bit (bitwise.cpp) until every node
/// is idle again.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "berth/sim/bits.hpp"
#include "berth/sim/bus.hpp"
#include "berth/sim/frame_faults.hpp"

namespace berth::sim {

/// The arbitration field as a number: the lower wins. Base and extended, data and remote compare as on the wire: the
/// bits are ID 28..18, RTR or SRR, IDE, ID 17..0, RTR.
[[nodiscard]] inline std::uint32_t arbitration_field(const can::Frame& f) noexcept {
  const std::uint32_t rtr = f.remote ? 1U : 0U;
  if (!f.extended) return (f.id << 21U) | (rtr << 20U);
  return ((f.id >> 18U) << 21U) | (3U << 19U) | ((f.id & 0x3FFFFU) << 1U) | rtr;
}

[[nodiscard]] inline rt::Duration bit_time_of(std::uint32_t bit_rate) noexcept {
  return rt::Duration((1'000'000'000LL + bit_rate / 2) / bit_rate);
}
[[nodiscard]] inline rt::Duration sample_point(rt::Duration bit) noexcept { return bit * 7 / 8; }

/// Which nodes of a segment hear a key: one bit per node, so that a frame costs nothing for those that do not listen.
class Filters {
 public:
  /// Node `slot` now hears `accept` instead of what it heard.
  void set(std::uint32_t slot, const std::vector<can::IdRange>& before, const std::vector<can::IdRange>& accept);
  /// The nodes that hear `key`: `words()` words.
  [[nodiscard]] const std::uint64_t* find(std::uint32_t key) noexcept;
  [[nodiscard]] std::size_t words() const noexcept { return words_; }
  void grow(std::size_t slots);

 private:
  struct Cached {
    std::uint32_t key = 0;  // extended keys are never 0
    std::vector<std::uint64_t> nodes;
  };
  struct Extended {
    std::uint32_t slot;
    std::vector<can::IdRange> ranges;
  };
  void toggle(std::uint32_t slot, can::IdRange range) noexcept;
  std::size_t words_ = 0;
  std::vector<std::uint64_t> base_;  // 2048 rows
  std::vector<Extended> extended_;   // nodes that hear extended keys
  std::vector<Cached> cache_ = std::vector<Cached>(64);
};

class Segment final : private rt::Job {
 public:
  explicit Segment(Bus& bus) noexcept;
  ~Segment();

  /// A node joins; it must see `runs` runs of recessive bits before it takes part.
  void join(Controller& node);
  void leave(Controller& node) noexcept;
  /// The node begins to count recessive bits anew.
  void integrate(Controller& node, std::uint32_t runs) noexcept;
  /// What the node offers may have changed.
  void offer(Controller& node) noexcept;
  /// Power, bit rate or listen-only are about to change: the node no longer does what it did.
  void disturb(Controller& node) noexcept;
  /// ... and have changed.
  void refresh() noexcept;
  void counters_changed(bool was_clean, bool is_clean) noexcept;
  /// The node's counters were set from outside.
  void counters_preset(Controller& node);
  void set_filter(Controller& node, const std::vector<can::IdRange>& before);

  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  [[nodiscard]] bool idle() const noexcept { return state_ == State::quiet || state_ == State::starting; }
  [[nodiscard]] std::uint64_t starts() const noexcept { return starts_; }
  [[nodiscard]] const std::vector<Controller*>& nodes() const noexcept { return nodes_; }
  /// The node goes over to another segment with whatever it is doing.
  void hand_over(Controller& node, Segment& to);

 private:
  friend class Bus;
  enum class State : std::uint8_t { quiet, starting, busy, bitwise };
  /// Arbitration field and slot as one number, so that one comparison orders them.
  struct Contender {
    std::uint64_t order = 0;
    [[nodiscard]] std::uint32_t arbitration() const noexcept { return static_cast<std::uint32_t>(order >> 32U); }
    [[nodiscard]] std::uint32_t slot() const noexcept { return static_cast<std::uint32_t>(order); }
  };
  /// The nodes of one bit rate while the segment is played bit by bit.
  struct Group;
  struct Domain;
  /// Ends of runs of recessive bits on an idle bus.
  class Integrator final : public rt::Job {
   public:
    explicit Integrator(Segment& segment) noexcept : segment_(segment) {}
    void run() noexcept override { segment_.integration_due(); }

   private:
    Segment& segment_;
  };

  void run() noexcept override;
  void schedule_start() noexcept;
  void arbitrate() noexcept;
  void finish() noexcept;
  void give_up() noexcept;
  void detach(Controller& node) noexcept;
  bool pick_senders() noexcept;
  void settle_counters(rt::Time free) noexcept;
  void deliver(const can::Frame& frame, rt::Time at) noexcept;
  [[nodiscard, gnu::cold]] bool fd_alike() const noexcept;
  [[nodiscard]] rt::Time earliest(const Controller& node) const noexcept;
  void apply_faults(const can::Frame& frame, int sender);

  void heap_put(Controller& node) noexcept;
  void heap_remove(Controller& node) noexcept;
  void heap_place(std::size_t at, Contender contender) noexcept;
  void heap_move(std::size_t at) noexcept;

  void count_recessive(rt::Time dominant_at) noexcept;
  void integration_due() noexcept;
  void schedule_integration() noexcept;
  void integrated(Controller& node) noexcept;

  // Bit by bit (bitwise.cpp)
  struct Pending {  // told at the end of the bit
    Controller* node;
    can::Frame frame;
    rt::Time at;
    bool sent;
  };
  class Deliverer final : public rt::Job {
   public:
    explicit Deliverer(Segment& segment) noexcept : segment_(segment) {}
    void run() noexcept override { segment_.deliver_pending(); }

   private:
    Segment& segment_;
  };
  void note_start(const can::Frame& frame, int sender);
  [[nodiscard, gnu::cold]] rt::Duration place(const can::Frame& frame, int bit) const noexcept;
  void start_bitwise();
  void play_from(rt::Time start, bool sending);
  void replay();
  void end_bitwise() noexcept;
  void edge(Domain& domain);
  void tick(Domain& domain, bool again);
  void begin_frames(Domain& domain);
  void join_started(Domain& domain, Group& group);
  void frame_begun(Domain& domain, Controller& node);
  void begin_attempt(Controller& node) noexcept;
  void attempt_over(Controller& node) noexcept;
  void note(Domain& domain, Group& group, const BitNode::Outcome& outcome);
  void note_counters(Group& group);
  void note_sent(Domain& domain, Controller& node);
  [[nodiscard]] bool seen(const Domain& domain, const Group& group, bool dominant) const noexcept;
  [[nodiscard]] bool level_of_others(const Domain& domain, rt::Time at) const noexcept;
  [[nodiscard]] bool one_rate() const noexcept;
  void synchronise_others(const Domain& domain) noexcept;
  Domain& domain_of(std::uint32_t bit_rate, rt::Time start);
  void put_in_group(Controller& node, rt::Time start, bool sending, bool pauses);
  std::unique_ptr<Group> take_out(Controller& node);
  Group& alone(Domain& domain, Controller& node);
  Group& split(Domain& domain, Group& group, Controller& node);
  void single_out_victims();
  void deliver_pending() noexcept;

  Bus* bus_;
  rt::Executor* executor_;
  State state_ = State::quiet;
  bool mixed_ = false;  // nodes of several bit rates
  rt::Duration bit_{};  // of the nodes, when not mixed
  rt::Time sof_{};      // start of the frame under way or to come
  rt::Time free_at_{};  // end of the last intermission
  can::Frame frame_;
  unsigned frame_bits_ = 0;
  rt::Duration frame_time_{};  // of them
  std::uint64_t starts_ = 0;
  unsigned count_ = 0;                 // nodes
  unsigned ackers_ = 0;                // nodes that would acknowledge
  unsigned present_ = 0;               // nodes that have power and are not bus-off
  bool unanswered_ = false;            // busy with the frame of a passive node that no node acknowledges
  unsigned noisy_ = 0;                 // nodes with TEC or REC not zero
  unsigned suspended_ = 0;             // nodes with suspends_
  unsigned integrating_ = 0;           // nodes with runs_left_ > 0 and power
  std::vector<Controller*> nodes_;     // by slot, null where none is
  std::vector<Contender> contenders_;  // heap
  std::vector<Controller*> senders_;
  FrameFaults faults_;  // of the frame under way
  std::vector<std::unique_ptr<Domain>> domains_;
  Filters filters_;
  Integrator integrator_{*this};
  rt::Time played_since_{};
  rt::Time overload_at_{};  // when the last overload flag began
  bool failed_ = false;     // the frame under way has met an error
  bool good_ = false;       // ... has been counted as good
  std::vector<Pending> pending_;
  Deliverer deliverer_{*this};
};

}  // namespace berth::sim
