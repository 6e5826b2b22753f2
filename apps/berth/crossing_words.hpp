/// A link across gateways as `berth link` and `berth analyze` show it.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "berth/linker/plan.hpp"

namespace berth::cli {

struct CrossingShown {
  const linker::LinkNetwork& network;
  const linker::CrossingLink& crossing;
  std::optional<rt::Duration> worst;  ///< none: no bound

  /// There is a bound, and it is within the deadline, if there is one.
  [[nodiscard]] bool kept() const;
  /// "motor/6401h:01 -> engine/6411h:01 through left, right: worst 12.300 ms, deadline 60 ms kept".
  [[nodiscard]] std::string text() const;
  [[nodiscard]] nlohmann::ordered_json json() const;
};

}  // namespace berth::cli
