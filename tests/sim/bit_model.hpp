/// The judge: a CAN bus where every node goes bit by bit, slowly and plainly, written from Bosch CAN 2.0 part A and B
/// and facts page G. It shares no code with berth/sim, only the type of a frame.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <vector>

#include "berth/can/frame.hpp"

namespace judge {

using berth::can::Frame;

/// A frame as it goes over the wire: 'r' and 'd' for recessive and dominant bits.
struct Wire {
  std::vector<char> dominant;
  std::vector<char> part;  ///< 'S' start, 'A' arbitration, 's' stuff bit before RTR, 'K' ACK slot, '.' any other
};
Wire encode(const Frame& frame);

/// What a receiver makes of the bits since start of frame.
struct Reading {
  bool stuff_error = false;
  std::optional<std::size_t> delimiter;  ///< where the CRC delimiter stands, once that is known
  bool crc_right = false;
  Frame frame;
};
Reading read(const std::vector<char>& dominant);

struct Event {
  std::int64_t end;  ///< bit that follows the frame's last one
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
  off
};

struct Node {
  unsigned tec = 0;
  unsigned rec = 0;
  bool by_priority = false;
  bool listens_only = false;
  struct Queued {
    Frame frame;
    std::int64_t ready;
  };
  std::deque<Queued> queue;
  Doing doing = Doing::idle;
  unsigned done = 0;             // bits of what it is doing
  bool was_transmitter = false;  // of the frame that this belongs to
  Wire wire;                     // what it transmits
  std::size_t at = 0;
  std::size_t chosen = 0;     // of the queue
  std::vector<char> history;  // bits since start of frame, as it saw them
  Reading reading;
  bool after_error = false;  // else after an overload flag
  unsigned dominant_after = 0;
  bool ack_error_pending = false;
  bool last_level = false;
};

class Bus {
 public:
  explicit Bus(std::size_t count) : nodes(count) {}
  /// Node `node` sees bit `bit` of frame number `frame` (each start of transmission counts) turned round; twice is
  /// not at all.
  void flip(std::uint64_t frame, int bit, int node) {
    if (const std::tuple place{frame, bit, node}; !flips_.insert(place).second) flips_.erase(place);
  }
  void run(std::int64_t bits) {
    while (now < bits) step();
  }
  std::vector<Node> nodes;
  std::vector<Event> events;
  std::int64_t now = 0;
  std::uint64_t frames = 0;  ///< started
  std::uint64_t errors = 0;  ///< error flags begun

 private:
  void step();
  bool wants(const Node& n) const;
  void start(Node& n, bool behind_start_bit);
  bool level(const Node& n) const;
  void hear(int index, bool dominant);
  void transmit_bit(int index, bool dominant);
  void receive_bit(int index, bool dominant);
  void error(Node& n, char kind);
  void overload(Node& n);
  void punish(Node& n, unsigned points);
  void count_frame();

  std::set<std::tuple<std::uint64_t, int, int>> flips_;
  std::int64_t origin_ = -1;
  bool flips_live_ = false;
};

}  // namespace judge
