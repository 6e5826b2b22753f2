/// A controller without the `can::Port` around it: its parts, for the wire. Internal to `sim`.
#pragma once

#include <cstdint>
#include <vector>

#include "berth/sim/error_counters.hpp"
#include "berth/sim/host_queue.hpp"
#include "berth/sim/participation.hpp"
#include "berth/sim/transmit_queue.hpp"

namespace berth::sim {

class Controller;
class Segment;
class SegmentNodes;

/// Counters since attachment or `reset_statistics`.
struct NodeStatistics {
  std::uint64_t sent = 0;                ///< frames sent and acknowledged
  std::uint64_t sent_bits = 0;           ///< their bits, three of intermission included
  std::uint64_t received = 0;            ///< frames that passed the filter and reached the receive buffer
  std::uint64_t overruns = 0;            ///< received frames lost from the receive buffer: full, deaf or
                                         ///< `Fault::Kind::overrun`
  std::uint64_t arbitration_losses = 0;  ///< times another frame went first
  std::uint64_t attempts = 0;            ///< frames begun and not lost in arbitration
  std::uint64_t retransmissions = 0;     ///< attempts that repeat a failed one
  std::uint64_t transmit_errors = 0;     ///< errors detected as transmitter
  std::uint64_t receive_errors = 0;      ///< errors detected as receiver
  std::uint64_t bus_offs = 0;
};

struct BusNode {
  static constexpr std::uint32_t no_slot = 0xFFFF'FFFFU;

  /// Takes part in traffic: has power, is not bus-off and has seen the required recessive bits.
  [[nodiscard]] bool participates() const noexcept { return powered && access.takes_part(); }
  [[nodiscard]] bool acknowledges() const noexcept { return participates() && !listen_only; }
  [[nodiscard]] bool offers() const noexcept {
    return transmit.has_head() && access.takes_part() && powered && !silent && !listen_only;
  }
  /// The head of its queue, as it is sent.
  [[nodiscard]] can::Frame head_frame() const noexcept { return transmit.head_frame(errors.passive()); }

  void deliver(const can::Frame& frame, rt::Time at) noexcept {
    ++(host.received(frame, at) ? statistics.received : statistics.overruns);
  }
  /// The head was sent.
  void confirm(rt::Time at) noexcept {
    ++statistics.sent;
    host.sent(transmit.sent(), at);
  }
  void set_counters(std::uint16_t tec, std::uint16_t rec) noexcept;
  void tell_if_changed() noexcept {
    if (errors.level_changed()) host.changed();
  }

  const Controller* controller;  ///< its name in faults
  int number;                    ///< of the controller on its bus
  Segment* segment = nullptr;
  SegmentNodes* peers = nullptr;  ///< the nodes of the segment, including this one
  std::uint32_t slot = no_slot;   ///< its slot there
  std::uint32_t bit_rate;
  bool powered;
  bool listen_only;
  bool silent = false;
  Participation access{};
  ErrorCounters errors{};
  TransmitQueue transmit;
  HostQueue host;
  NodeStatistics statistics{};
  std::vector<can::IdRange> accept{};
};

}  // namespace berth::sim
