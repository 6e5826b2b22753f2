/// The wire of one segment, shared by its parts: the nodes, the contending frames, the current errors, and when the
/// current frame began. Internal to `sim`. Each part has a reference to it and owns its other state.
#pragma once

#include "berth/sim/bus.hpp"
#include "berth/sim/contenders.hpp"
#include "berth/sim/filters.hpp"
#include "berth/sim/frame_faults.hpp"
#include "berth/sim/segment_nodes.hpp"

namespace berth::sim {

struct Medium {
  explicit Medium(Bus& b) noexcept;

  /// A frame begins at `sof`: faults are drawn for it, and it is counted.
  void begin_frame(const can::Frame& frame, int sender) {
    faults.clear();
    if (bus.faults().any()) [[unlikely]]
      faults.draw(bus, frame, sof, sender, nodes);
    contenders.count_start();
    bus.faults().count_start();
    ++statistics.starts;
  }
  /// The node sends its head, beginning with the newest start. It stays among the contenders meanwhile.
  void begin_attempt(BusNode& node) noexcept {
    node.statistics.arbitration_losses += contenders.begin(node.slot);
    node.transmit.begin();
    ++node.statistics.attempts;
    if (node.transmit.head().tried) ++node.statistics.retransmissions;
  }
  /// The node's offer may have changed: true if it contends.
  bool contend(BusNode& node) noexcept {
    const bool offers = node.offers();
    if (offers) {
      contenders.put(node.slot, node.transmit.head().arbitration);
    } else {
      withdraw(node);
    }
    return offers;
  }
  void withdraw(BusNode& node) noexcept { node.statistics.arbitration_losses += contenders.remove(node.slot); }
  /// Delivers to every node that listens and does not send.
  void deliver(const can::Frame& frame, rt::Time at) noexcept;
  /// `frame` ended without error: counts it and its bits, and shows it to the bus's taps.
  void count_good(const can::Frame& frame, unsigned bits, rt::Time at, int sender) noexcept {
    statistics.bits += bits;
    bus.good_frame(frame, at, sender);
  }
  /// An error ended the current frame: counts it, and shows it to the bus's taps.
  void count_error(const can::BusError& error, rt::Time at) noexcept {
    ++statistics.error_frames;
    for (std::size_t i = 0; i < bus.taps_.size(); ++i) bus.taps_[i]->error(error, at);
  }

  Bus& bus;
  rt::Executor& executor;
  BusStatistics& statistics;
  SegmentNodes nodes;
  Contenders contenders;
  Filters filters;
  FrameFaults faults;  ///< of the current frame
  rt::Time sof{};      ///< start of the current or next frame
  rt::Time free_at{};  ///< end of the last intermission
};

}  // namespace berth::sim
