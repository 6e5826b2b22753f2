#include "berth/linker/bounds.hpp"

#include <algorithm>

namespace berth::linker {
namespace {

constexpr TransmissionType last_cyclic = 240;

}  // namespace

bool synchronous(TransmissionType type) noexcept { return type <= last_cyclic; }

Sending sending_of(const Network& network, const Pdo& pdo) {
  const auto objects = static_cast<std::int64_t>(pdo.mpdo ? pdo.carried.size() : 1);
  return {pdo.transmission, inhibit_unit * pdo.inhibit * objects, network.buses[pdo.bus].sync};
}

rt::Duration waiting(const Sending& sending) {
  if (!synchronous(sending.transmission)) return sending.inhibit;
  return sending.sync * (std::max<unsigned>(sending.transmission, 1) + 1);
}

rt::Duration left_for_bus(const Sending& sending, rt::Duration deadline) {
  const auto left = deadline - waiting(sending);
  if (synchronous(sending.transmission) && left >= rt::Duration(0)) return sending.sync;
  return std::max(left, rt::Duration(1));
}

rt::Duration worst_of(const Network& network, const Pdo& pdo, rt::Duration response) {
  return waiting(sending_of(network, pdo)) + (synchronous(pdo.transmission) ? rt::Duration(0) : response);
}

std::optional<rt::Duration> worst_of(const Network& network, const CrossingLink& crossing,
                                     std::span<const std::optional<rt::Duration>> pdos) {
  rt::Duration sum{};
  for (const std::size_t gateway : crossing.gateways) sum += network.gateways[gateway].delay;
  for (const std::size_t pdo : crossing.pdos) {
    if (!pdos[pdo]) return std::nullopt;
    sum += *pdos[pdo];
  }
  return sum;
}

}  // namespace berth::linker
