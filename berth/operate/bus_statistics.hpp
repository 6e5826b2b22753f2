/// Counters of what happened on a bus: the error statistics and the EMCY history of its manager (paper 5 §4, by
/// Etschberger and Schlegel, "diagnosis and error interface"). Plain data: supervision fills it, the manager's objects
/// show it.
#pragma once

#include <algorithm>
#include <array>
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
    std::uint16_t emergencies = 0;  ///< that reported an error; counts to 65535
    std::uint16_t losses = 0;       ///< how often its heartbeat stopped
    std::uint16_t boots = 0;        ///< boot-up messages
  };
  static constexpr std::size_t most_emergencies = 64;

  std::deque<Emergency> emergencies;  ///< newest first; "error reset" is in it too
  std::array<Tally, 128> tallies{};   ///< by node-ID

  void told(NodeId node, const co::Emcy& message, rt::Time at) {
    emergencies.push_front({node, message, at});
    if (emergencies.size() > most_emergencies) emergencies.pop_back();
    if ((message.code >> 8U) != 0) count(tallies[node.value()].emergencies);
  }
  void lost(NodeId node) noexcept { count(tallies[node.value()].losses); }
  void booted(NodeId node) noexcept { count(tallies[node.value()].boots); }
  [[nodiscard]] Tally sum() const noexcept {
    Tally all;
    for (const auto& each : tallies) {
      add(all.emergencies, each.emergencies);
      add(all.losses, each.losses);
      add(all.boots, each.boots);
    }
    return all;
  }

 private:
  static void add(std::uint16_t& to, std::uint16_t more) noexcept {
    to = static_cast<std::uint16_t>(std::min<std::uint32_t>(0xFFFF, std::uint32_t{to} + more));
  }
  static void count(std::uint16_t& counter) noexcept { add(counter, 1); }
};

}  // namespace berth::operate
