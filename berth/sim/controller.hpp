/// One node's CAN controller on a simulated bus.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "berth/can/packed_frame.hpp"
#include "berth/can/port.hpp"
#include "berth/rt/executor.hpp"

namespace berth::sim {

class Bus;
class Segment;

/// Which queued frame the controller offers to the bus.
enum class TxOrder : std::uint8_t {
  in_order,  ///< the oldest: a low priority frame holds up what stands behind it (priority inversion)
  priority,  ///< the one that would win arbitration; among equals the oldest
};

struct ControllerOptions {
  std::string name{};
  TxOrder queue = TxOrder::in_order;
  unsigned queue_depth = 32;   ///< frames that can wait to be sent; `send` says `full` beyond
  unsigned rx_depth = 64;      ///< frames that can wait for the host; 1 = single-slot receive buffer
  rt::Duration rx_service{0};  ///< time the host needs to take one frame out of the buffer; 0 = never overruns
  std::uint32_t bit_rate = 0;  ///< bit/s; 0 = the bus's
  bool powered = true;
  bool listen_only = false;
  bool fd = false;  ///< an FD controller: the only kind that an FD bus takes (`Bus::attach`)
};

/// Counters since attachment or `reset_statistics`.
struct NodeStatistics {
  std::uint64_t sent = 0;                ///< frames sent and acknowledged
  std::uint64_t sent_bits = 0;           ///< their bits, three of intermission included
  std::uint64_t received = 0;            ///< frames that passed the filter and reached the receive buffer
  std::uint64_t overruns = 0;            ///< frames that the receive buffer lost: full, deaf or `Fault::Kind::overrun`
  std::uint64_t arbitration_losses = 0;  ///< times another frame went first
  std::uint64_t attempts = 0;            ///< frames begun and not lost in arbitration
  std::uint64_t retransmissions = 0;     ///< attempts that repeat one that failed
  std::uint64_t transmit_errors = 0;     ///< errors detected as transmitter
  std::uint64_t receive_errors = 0;      ///< errors detected as receiver
  std::uint64_t bus_offs = 0;
};

/// What a bit does to the node, for a close look at a controller (see scenarios.hpp).
enum class ErrorState : std::uint8_t { active, passive, bus_off };

/// A `can::Port` whose TEC, REC and `sent` are exact. Made by `Bus::attach`, owned by the caller, to be destroyed
/// before its `World`; destroying it takes the node off the bus at that instant.
///
/// `Listener` calls come each in a job of its own; `received` and `sent` both come at the end of the frame's last bit.
/// FD frames are refused (`Queued::closed`) on a bus that is not an FD bus, and so are frames of a size that their
/// format does not have. An FD frame goes out with ESI recessive while its sender is error-passive; the identifier is
/// no mark of the format: a listener looks at `can::Frame::fd`.
class Controller final : public can::Port, private rt::Job {
 public:
  ~Controller() override;
  Controller(const Controller&) = delete;
  Controller& operator=(const Controller&) = delete;

  // can::Port
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override;
  void withdraw(std::uint32_t tag) noexcept override;
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override;
  [[nodiscard]] can::Status status() const noexcept override;
  /// Queue dropped, counters zero, then 11 recessive bits until the node takes part; after bus-off 128 times 11
  /// (Bosch CAN 2.0 §8 rule 12). False for bit rate 0, without power.
  bool restart(std::uint32_t bit_rate) noexcept override;

  // What happens to a node
  /// Off: at once silent, queue, receive buffer and counters lost. On: takes part after 11 recessive bits.
  void power(bool on) noexcept;
  /// Out: the node is alone on its stub: it notices only that no node acknowledges. Also see `Bus::split`.
  void cable(bool in) noexcept;
  /// As `restart`, but keeps the queue: a node at another bit rate than the rest destroys their frames until it is
  /// error-passive, and they its. It hard-synchronises on start of frame and does not resynchronise within a frame.
  void set_bit_rate(std::uint32_t bit_rate) noexcept;
  /// On: hears, but neither acknowledges nor signals errors nor sends; counters stand still. The queue is dropped.
  void listen_only(bool on) noexcept;
  /// On: the controller acknowledges, but its host reads nothing: received frames are lost (overruns).
  void deaf(bool on) noexcept { deaf_ = on; }
  /// On: queued frames are not offered to the bus; the node still hears and acknowledges.
  void silent(bool on) noexcept;

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// 0, 1, ... in the order of attachment to the bus; never used again.
  [[nodiscard]] int number() const noexcept { return number_; }
  [[nodiscard]] Bus& bus() const noexcept { return *bus_; }
  [[nodiscard]] std::uint16_t tec() const noexcept { return tec_; }
  [[nodiscard]] std::uint16_t rec() const noexcept { return rec_; }
  [[nodiscard]] ErrorState error_state() const noexcept {
    if (bus_off_) return ErrorState::bus_off;
    return tec_ > 127 || rec_ > 127 ? ErrorState::passive : ErrorState::active;
  }
  [[nodiscard]] bool powered() const noexcept { return powered_; }
  [[nodiscard]] bool cable_in() const noexcept { return cable_; }
  [[nodiscard]] std::uint32_t bit_rate() const noexcept { return bit_rate_; }
  [[nodiscard]] const NodeStatistics& statistics() const noexcept;
  void reset_statistics() noexcept { statistics_ = {}; }
  /// For tests: sets the counters as if errors had happened (TEC up to 255).
  void preset_counters(std::uint16_t tec, std::uint16_t rec) noexcept;

 private:
  friend class Bus;
  friend class Segment;
  struct Waiting {  // a frame that waits to be sent
    can::PackedFrame frame;
    std::uint32_t arbitration = 0;
    std::uint32_t tag = 0;
    bool tried = false;
  };
  enum class What : std::uint8_t { received, sent, changed };
  struct Event {  // what the host is yet to be told
    can::PackedFrame frame;
    rt::Time at{};
    std::uint32_t tag = 0;
    What what = What::received;
  };
  static constexpr std::uint32_t nothing = 0xFFFF'FFFFU;

  Controller(Bus& bus, int number, const ControllerOptions& options);
  void run() noexcept override;
  Event& push_event(What what, rt::Time at) noexcept;
  void deliver(const can::Frame& frame, rt::Time at) noexcept;
  void confirm(rt::Time at) noexcept;
  void announce() noexcept;
  void choose_head() noexcept;
  void attempt_failed() noexcept;
  void clear_queue() noexcept;
  void forget_events() noexcept;
  void schedule_host() noexcept;
  void tell_if_changed() noexcept;
  void set_counters(std::uint16_t tec, std::uint16_t rec) noexcept;
  [[nodiscard]] const Waiting& head() const noexcept { return slots_[head_]; }
  /// As it goes out now.
  [[nodiscard]] can::Frame head_frame() const noexcept {
    return head().frame.fd() ? head_fd_frame() : head().frame.unpacked();
  }
  [[nodiscard, gnu::cold]] can::Frame head_fd_frame() const noexcept;
  [[gnu::cold]] void keep_fd(const can::Frame& frame);
  [[gnu::cold]] void receive_fd(rt::Time at) noexcept;
  [[nodiscard, gnu::cold]] bool sends_fd(const can::Frame& frame) const noexcept;
  /// Takes part in traffic: has power, is not bus-off and has seen the recessive bits it must see.
  [[nodiscard]] bool participates() const noexcept { return powered_ && runs_left_ == 0; }
  [[nodiscard]] bool offers() const noexcept {
    return head_ != nothing && runs_left_ == 0 && powered_ && !silent_ && !listen_only_;
  }

  Bus* bus_;
  Segment* segment_ = nullptr;
  can::Listener* listener_ = nullptr;
  std::vector<can::IdRange> accept_;
  std::uint32_t bit_rate_;
  std::uint32_t head_ = nothing;      // slot of the frame offered
  std::uint32_t slot_ = nothing;      // place on the segment
  std::uint32_t heap_at_ = nothing;   // place among the segment's contenders
  std::uint32_t runs_left_ = 0;       // runs of 11 recessive bits until the node takes part
  rt::Time recessive_since_{};        // where the run that counts began, while runs_left_ > 0
  rt::Time not_before_{};             // suspend transmission
  std::uint64_t contends_since_ = 0;  // segment's count of frames when the head began to contend
  std::uint16_t tec_ = 0;
  std::uint16_t rec_ = 0;
  int number_;
  TxOrder order_kind_;
  bool powered_;
  bool cable_ = true;
  bool listen_only_;
  bool deaf_ = false;
  bool silent_ = false;
  bool bus_off_ = false;
  bool sending_ = false;    // the head is on the wire
  bool abandoned_ = false;  // ... and was withdrawn meanwhile: it is not repeated
  bool suspends_ = false;   // not_before_ means something
  std::uint8_t told_ = 0;   // level last announced: 0 active, 1 warning, 2 passive, 3 bus-off
  unsigned rx_depth_;
  unsigned rx_waiting_ = 0;  // received frames among events_
  rt::Duration rx_service_;
  std::vector<Waiting> slots_;
  std::vector<std::uint32_t> order_;  // slots in use, oldest first
  std::vector<std::uint32_t> free_;
  std::vector<can::Frame> fd_queue_;    // by slot; of an FD frame `Waiting::frame` is only the beginning
  std::deque<can::Frame> fd_received_;  // the FD frames among events_
  std::vector<Event> events_;           // ring, its size a power of two
  std::size_t first_event_ = 0;
  std::size_t event_count_ = 0;
  mutable NodeStatistics statistics_;
  std::string name_;
};

}  // namespace berth::sim
