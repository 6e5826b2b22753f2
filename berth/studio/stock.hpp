/// The executor's side of the metrics: takes stock of the machine for the server's thread. Internal to room `studio`.
#pragma once

#include <cstdint>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

#include "berth/studio/link.hpp"
#include "berth/tree/session.hpp"

namespace berth::studio {

class Stock {
 public:
  /// Both must outlive this.
  Stock(tree::Session& session, const Link& link);
  /// A timer of the loop ran so late.
  void late(double seconds) noexcept { lateness_.add(seconds); }
  /// `slots`: as the session reports them.
  [[nodiscard]] Figures take(const std::vector<operate::SlotReport>& slots) const;

 private:
  [[nodiscard]] BusFigures bus(std::size_t index) const;

  tree::Session* session_;
  const Link* link_;
  std::vector<std::string_view> buses_;  // in the machine's order
  std::map<std::pair<std::string_view, std::uint8_t>, bool> optional_;
  Lateness lateness_;
};

}  // namespace berth::studio
