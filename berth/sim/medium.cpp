#include "berth/sim/medium.hpp"

#include <bit>

namespace berth::sim {

Medium::Medium(Bus& b) noexcept : bus(b), executor(b.executor()), statistics(b.statistics_) {}

void Medium::begin_frame(const can::Frame& frame, int sender) {
  faults.clear();
  if (bus.faults().any()) faults.draw(bus, frame, sof, sender, nodes);
  contenders.count_start();
  bus.faults().count_start();
  ++statistics.starts;
}

void Medium::begin_attempt(BusNode& node) noexcept {
  node.statistics.arbitration_losses += contenders.begin(node.slot);
  node.transmit.begin();
  ++node.statistics.attempts;
  if (node.transmit.head().tried) ++node.statistics.retransmissions;
}

void Medium::contend(BusNode& node) noexcept {
  if (node.offers()) {
    contenders.put(node.slot, node.transmit.head().arbitration);
  } else {
    withdraw(node);
  }
}

void Medium::withdraw(BusNode& node) noexcept { node.statistics.arbitration_losses += contenders.remove(node.slot); }

void Medium::deliver(const can::Frame& frame, rt::Time at) noexcept {
  const std::uint64_t* hearing = filters.find(frame.key());
  for (std::size_t word = 0; word < filters.words(); ++word) {
    for (std::uint64_t rest = hearing[word]; rest != 0; rest &= rest - 1) {
      BusNode& node = nodes.at(static_cast<std::uint32_t>(word * 64 + static_cast<unsigned>(std::countr_zero(rest))));
      if (node.transmit.sending() || !node.participates()) continue;
      if (faults.loses(*node.controller)) {
        ++node.statistics.overruns;
      } else {
        node.deliver(frame, at);
      }
    }
  }
}

void Medium::count_good(const can::Frame& frame, unsigned bits, rt::Time at, int sender) noexcept {
  statistics.bits += bits;
  bus.good_frame(frame, at, sender);
}

}  // namespace berth::sim
