/// Turns links into signals: which bits go from which object to which objects. Internal to room `linker`.
#pragma once

#include <vector>

#include "berth/linker/device_pdos_parts.hpp"
#include "berth/linker/plan.hpp"

namespace berth::linker {

struct Consumer {
  std::size_t node = 0;
  ObjectRef object{};
  friend auto operator<=>(const Consumer&, const Consumer&) = default;
};

/// FEh and FFh are equal for a link: at a change, by the device's own rule.
[[nodiscard]] constexpr TransmissionType one_of_kind(TransmissionType type) noexcept {
  return type >= 254 ? at_change : type;
}

/// One object of a producer that links carry with one transmission type.
struct Signal {
  std::size_t producer = 0;
  ObjectRef object{};
  std::uint8_t bits = 0;
  TransmissionType transmission = at_change;
  std::vector<Consumer> consumers = {};  ///< ascending
  std::optional<rt::Duration> deadline{};
  std::vector<std::size_t> links = {};  ///< ascending
  /// For a link across gateways: its source node. Such signals share PDOs only with others from the same node, so that
  /// a gateway can stop a TPDO when its producer is silent; they never use an MPDO.
  std::size_t origin = 0;
  bool crosses = false;
};

struct Resolved {
  std::vector<Variable> variables;
  std::vector<Signal> signals;  ///< ascending by producer, object and transmission
  std::vector<bool> linked;     ///< by node
};

/// Errors go to `findings`; the result contains only links without errors.
[[nodiscard]] Resolved resolve(const LinkNetwork& network, const std::vector<DevicePdos>& devices,
                               const Earlier& earlier, Findings& findings);

[[nodiscard]] Finding refusal(const LinkNetwork& network, std::size_t link, std::string message, std::string fix);

/// Indices of the links, in an order independent of the file's.
[[nodiscard]] std::vector<std::size_t> canonical_order(const LinkNetwork& network);

}  // namespace berth::linker
