/// What is said of the connection to a broker: each change once, and few words of one that ends again and again. Pure.
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "berth/mqtt/client.hpp"

namespace berth::fleet {

class ConnectionWords {
 public:
  using Steady = std::chrono::milliseconds;
  /// A connection that ends sooner was not a good one.
  static constexpr Steady short_life{60'000};
  /// So many in a row, and nothing more is said until one is good.
  static constexpr unsigned most_short_lives = 3;

  /// Empty: nothing is to be said.
  [[nodiscard]] std::optional<std::string> connected(const std::string& where, Steady now);
  [[nodiscard]] std::optional<std::string> lost(const mqtt::Disconnected& over, Steady now);

 private:
  std::string told_;  // of the last loss
  Steady connected_at_{0};
  unsigned short_lives_ = 0;
};

}  // namespace berth::fleet
