/// Counters of what happened on a bus: the error statistics and the EMCY history of its manager (paper 5 §4, by
/// Etschberger and Schlegel, "diagnosis and error interface"). Plain data: supervision and configuration fill it, the
/// manager's objects and the metrics show it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>

#include "berth/base/ids.hpp"
#include "berth/co/emcy.hpp"
#include "berth/rt/executor.hpp"

namespace berth::operate {

struct BusStatistics {
  struct Emergency {
    NodeId node;
    co::Emcy message;
    rt::Time at{};
  };
  struct Tally {
    std::uint64_t emergencies = 0;  ///< that reported an error
    std::uint64_t losses = 0;       ///< how often its heartbeat stopped
    std::uint64_t boots = 0;        ///< boot-up messages
    std::uint64_t differences = 0;  ///< values of its configuration that were not as wanted when they were compared
    bool differs = false;           ///< some were not as wanted at the last comparison, and Berth did not correct them
  };
  static constexpr std::size_t most_emergencies = 64;

  std::deque<Emergency> emergencies;  ///< newest first; "error reset" is in it too
  std::array<Tally, 128> tallies{};   ///< by node-ID
  std::uint64_t bus_offs = 0;         ///< how often Berth's port went bus-off

  void told(NodeId node, const co::Emcy& message, rt::Time at) {
    emergencies.push_front({node, message, at});
    if (emergencies.size() > most_emergencies) emergencies.pop_back();
    if ((message.code >> 8U) != 0) ++tallies[node.value()].emergencies;
  }
  void lost(NodeId node) noexcept { ++tallies[node.value()].losses; }
  void booted(NodeId node) noexcept { ++tallies[node.value()].boots; }
  /// Its configuration was compared. `corrected`: what was different has been written.
  void compared(NodeId node, std::size_t differences, bool corrected) noexcept {
    Tally& tally = tallies[node.value()];
    tally.differences += differences;
    tally.differs = differences > 0 && !corrected;
  }
  [[nodiscard]] Tally sum() const noexcept {
    Tally all;
    for (const auto& each : tallies) {
      all.emergencies += each.emergencies;
      all.losses += each.losses;
      all.boots += each.boots;
      all.differences += each.differences;
      all.differs = all.differs || each.differs;
    }
    return all;
  }
};

}  // namespace berth::operate
