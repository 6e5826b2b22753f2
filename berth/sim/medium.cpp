#include "berth/sim/medium.hpp"

#include <bit>

namespace berth::sim {
namespace {

// The slot of the lowest bit that is set.
std::uint32_t slot_of(std::size_t word, std::uint64_t bits) noexcept {
  return static_cast<std::uint32_t>(word * 64 + static_cast<unsigned>(std::countr_zero(bits)));
}

// With thousands of nodes, none is in the processor's caches: the next one is fetched while this one is handled.
void fetch(const BusNode& node) noexcept {
  const char* const at = reinterpret_cast<const char*>(&node);
  for (std::size_t line = 0; line < sizeof(BusNode); line += 64) __builtin_prefetch(at + line);
}

}  // namespace

Medium::Medium(Bus& b) noexcept : bus(b), executor(b.executor()), statistics(b.statistics_) {}

void Medium::deliver(const can::Frame& frame, rt::Time at) noexcept {
  const std::uint64_t* hearing = filters.find(frame.key());
  for (std::size_t word = 0; word < filters.words(); ++word) {
    for (std::uint64_t rest = hearing[word]; rest != 0; rest &= rest - 1) {
      BusNode& node = nodes.at(slot_of(word, rest));
      if (const std::uint64_t later = rest & (rest - 1); later != 0) fetch(nodes.at(slot_of(word, later)));
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
