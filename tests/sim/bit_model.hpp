/// The judge: a CAN bus where every node goes bit by bit, slowly and plainly, written from Bosch CAN 2.0 part A and B
/// and docs/protocols/can-frames.md. It shares no code with berth/sim, only the type of a frame.
///
/// Each node samples its own bits, 7/8 into them, and drives its level over the whole of a bit. What happens to a node
/// at an instant comes before what is sampled at that instant. What the simulator fixes where the standard leaves a
/// choice, or where it is not exact by design, is stated here and nowhere else in the judge:
///
/// 1. *Clocks.* While a segment is not silent, the nodes of one bit rate on it have one bit clock. A start of frame
///    sets the clocks anew of every rate whose nodes are all quiet (idle, suspended, counting recessive bits, bus-off);
///    no other edge does. On a silent segment every node is quiet and there are no bits to wait for: a frame begins at
///    once, but not before the last bit that was sampled is over for every node. So a plan has no edge upon a sample
///    point, nor between it and the end of a bit that a quiet node counts: its instants are multiples of 1 µs, its bits
///    1, 2 and 4 µs. Who leaves, comes back or changes its bit rate amid several rates is not compared: they still
///    differ in about one such plan of 200 (docs/limits.md).
/// 2. *Contending.* With a first sender contends who is ready before the sample point of the fastest node's start of
///    frame. While a segment is not silent, a node begins at the beginning of one of its bits; where all are of one bit
///    rate, before the bit's sample point.
/// 3. *FD frames* are not played beyond FDF. One that began on a silent segment, that no planned disturbance concerns,
///    whose senders (one, or several of one and the same frame) are heard by a node that acknowledges, passes whole and
///    takes its exact time. Any other is destroyed at FDF: its senders have an error that counts like a missing
///    acknowledgement. The judge has FD frames on segments of one bit rate only, and nothing happens to nodes there.
/// 4. *Who leaves.* A node that loses power, is started again or gets another bit rate is not told of a frame received
///    that ends at that instant or later; of one that it has sent whole only without power.
/// 5. *Disturbances* last as long as the segment is not silent and no other frame begins.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <vector>

#include "berth/can/frame.hpp"

namespace judge {

using berth::can::Frame;
using Time = std::int64_t;  // ns

/// A frame as it goes over the wire: 'r' and 'd' for recessive and dominant bits. An FD frame ends with FDF.
struct Wire {
  std::vector<char> dominant;
  std::vector<char> part;  ///< 'S' start, 'A' arbitration, 's' stuff bit before RTR, 'K' ACK slot, 'F' FDF, '.' other
};
Wire encode(const Frame& frame);

/// The bits of an FD frame with its three of intermission, by the rate that they have when it switches.
struct FdLength {
  unsigned nominal = 0;
  unsigned fast = 0;
};
FdLength fd_length(const Frame& frame);

/// What a receiver makes of the bits since start of frame, one after the other.
class Reading {
 public:
  void push(bool dominant);
  bool stuff_error = false;
  std::size_t count = 0;                 ///< bits pushed
  std::optional<std::size_t> delimiter;  ///< where the CRC delimiter stands, once that is known
  bool crc_right = false;
  Frame frame;

 private:
  void finish();
  std::vector<char> plain_;
  int same_ = 0;
  bool last_ = false;
  std::size_t length_ = 0;
};

struct Event {
  Time end;  ///< of the frame's last bit
  int node;
  bool sent;  ///< else received
  Frame frame;
  friend bool operator==(const Event&, const Event&) = default;
};

enum class Doing {
  idle,
  transmitting,
  receiving,
  flag,
  passive_flag,
  overload_flag,
  waiting,
  delimiting,
  intermission,
  suspended,
  integrating,  ///< counts runs of 11 recessive bits
  off           ///< bus-off, or no power
};

struct Node {
  unsigned tec = 0;
  unsigned rec = 0;
  bool by_priority = false;
  bool listens_only = false;
  bool powered = true;
  bool bus_off = false;
  Time bit = 1000;
  int segment = 0;
  std::deque<Frame> queue;

  Doing doing = Doing::idle;
  unsigned done = 0;             // bits of what it is doing
  unsigned runs = 0;             // integrating: to come
  Time start = 0;                // of the bit that it samples next
  Time free_from = 0;            // idle: when it may begin
  bool before = false;           // the level that it drove in the last bit
  bool was_transmitter = false;  // of the frame that this belongs to
  Wire wire;                     // what it transmits
  std::size_t at = 0;
  std::size_t chosen = 0;  // of the queue
  Reading reading;
  bool after_error = false;  // else after an overload flag
  unsigned dominant_after = 0;
  bool ack_error_pending = false;
  bool last_level = false;
};

class Bus {
 public:
  /// `fast_bit`: of an FD bus's data phase.
  explicit Bus(std::size_t count, Time fast_bit = 0) : nodes(count), fast_bit_(fast_bit) {}
  /// Node `node` sees bit `bit` of the first frame that starts on its segment at `from` or later turned round; twice is
  /// not at all.
  void flip(Time from, int bit, int node) { planned_.push_back({from, bit, node}); }
  /// To be done to the nodes at `when`, by the functions below.
  void at(Time when, std::function<void(Bus&)> act) { acts_.emplace(when, std::move(act)); }
  void run(Time until);

  void send(int node, const Frame& frame);
  void power(int node, bool on);
  /// Queue and counters lost; after bus-off 128 runs of 11 recessive bits, else one.
  void restart(int node);
  void set_bit(int node, Time bit);
  /// Other segments than 0 are what was cut off; the node goes on with what it is doing.
  void move(int node, int segment);

  std::vector<Node> nodes;
  std::vector<Event> events;
  Time now = 0;
  std::uint64_t frames = 0;  ///< started
  std::uint64_t errors = 0;  ///< error flags begun
  std::uint64_t whole_fd = 0;
  std::uint64_t recovered = 0;  ///< nodes back from bus-off
  unsigned runs_to_recover = 128;

 private:
  struct Flip {
    Time from;
    int bit;
    int node;
  };
  struct Wave {  // one segment
    Time origin = -1;
    Time open_until = -1;  // who is ready by then contends
    bool from_silence = false;
    bool live = false;    // disturbances
    bool of_fd = false;   // the frame that they wait in is an FD frame
    bool passes = false;  // it may pass whole
    std::set<std::pair<int, int>> flips;
    bool struck = false;    // there are any, or were before they struck each other out
    Time whole_until = -1;  // an FD frame passes
    Frame whole;
    std::vector<int> whole_senders;
  };
  Time next() const;
  void begin_frames();
  void begin_on_silent(int segment);
  void begin_at_edges(int segment);
  void sample();
  void end_whole();
  bool passes_whole(int segment) const;

  bool silent(int segment) const;
  bool one_rate(int segment) const;
  std::vector<int> on(int segment) const;
  static bool wants(const Node& n);
  void start(Node& n, bool behind_start_bit);
  void count_frame(int segment, Time when, bool from_silence);
  bool level(const Node& n) const;
  bool wire(int segment) const;
  void hear(int index, bool dominant);
  void transmit_bit(int index, bool dominant);
  void receive_bit(int index, bool dominant);
  void count_recessive(Node& n, bool dominant);
  void error(Node& n, char kind);
  void overload(Node& n);
  void punish(Node& n, unsigned points);
  void fall_idle(Node& n);
  void leave(int index, bool loses_power);
  void integrate(Node& n, unsigned runs);
  void fall_silent(int segment);

  Time fast_bit_;
  std::vector<Flip> planned_;
  std::multimap<Time, std::function<void(Bus&)>> acts_;
  std::map<int, Wave> waves_;
};

}  // namespace judge
