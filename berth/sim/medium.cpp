#include "berth/sim/medium.hpp"

#include <bit>

namespace berth::sim {

Medium::Medium(Bus& b) noexcept : bus(b), executor(b.executor()), statistics(b.statistics_) {}

void Medium::deliver(const can::Frame& frame, rt::Time at) noexcept {
  const std::uint64_t* hearing = filters.find(frame.key());
  for (std::size_t word = 0; word < filters.words(); ++word) {
    for (std::uint64_t rest = hearing[word]; rest != 0; rest &= rest - 1) {
      BusNode& node = nodes.at(static_cast<std::uint32_t>(word * 64 + static_cast<unsigned>(std::countr_zero(rest))));
      if (node.transmit.sending() || !node.participates()) continue;
      if (faults.loses(*node.controller)) [[unlikely]] {
        ++node.statistics.overruns;
      } else {
        node.deliver(frame, at);
      }
    }
  }
}

}  // namespace berth::sim
