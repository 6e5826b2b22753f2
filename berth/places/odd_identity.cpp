#include "berth/places/odd_identity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <optional>
#include <vector>

#include "berth/places/identity.hpp"
#include "berth/places/inquiry.hpp"

namespace berth::places {
namespace {

constexpr std::size_t enough = 3;  // values of one part: two devices answering in turn give at most two
constexpr unsigned serial_number = 3;
constexpr rt::Duration slow_pause = std::chrono::milliseconds(12);  // between frames to a single-slot receive buffer

using Values = std::array<std::vector<std::uint32_t>, 4>;

void put(Values& values, const Identity& who) {
  for (unsigned part = 0; part < values.size(); ++part) {
    auto& known = values.at(part);
    const std::uint32_t value = who.address.part(part);
    if (who.knows(part) && std::ranges::find(known, value) == known.end()) known.push_back(value);
  }
}

// Does the device that LSS selects use this node-ID, and does no device answer to the LSS address that SDO reports
// there?
rt::Task<bool> lss_knows_it(Binder::Services services, NodeId node, Identity expected, Identity said, rt::Turn* turn) {
  std::optional<rt::Held> held;
  if (turn != nullptr) {
    co_await turn->take();
    held.emplace(*turn);
  }
  Inquiry inquiry(services);
  const bool whole = true;
  const auto uses = co_await inquiry.active_id_once(expected.address, whole);
  const bool there = uses.has_value() && uses.value() == node;
  if (!there) co_return false;
  const auto other = co_await inquiry.active_id(said.address, whole, slow_pause);
  co_return !other && other.error().code == Errc::timeout;
}

bool differs_in_serial_only(Identity who, Identity expected) noexcept {
  const bool both = who.has_serial() && expected.has_serial();
  who.unknown = static_cast<std::uint8_t>(who.unknown | 1U << serial_number);
  return both && who.knows(0) && who.knows(1) && who.agrees(expected);
}

}  // namespace

rt::Task<Uncompared> excuse(Binder::Services services, NodeId node, Identity who, Identity expected, bool asks_lss,
                            rt::Turn* turn) {
  Values values;
  put(values, who);
  Identity last = who;
  for (std::size_t reading = 0; reading < enough; ++reading) {
    const auto again = co_await identify(services.sdo, node, second_answer);
    if (!again.who || again.by_two) co_return Uncompared{};
    last = *again.who;
    put(values, last);
  }
  Uncompared found;
  for (unsigned part = 0; part < values.size(); ++part) {
    if (values.at(part).size() >= enough) found.changes = static_cast<std::uint8_t>(found.changes | 1U << part);
  }
  if (found.of(last).agrees(expected)) co_return found;
  const bool may_be = asks_lss && last.address == who.address && differs_in_serial_only(last, expected);
  if (!may_be) co_return Uncompared{};
  const bool known = co_await lss_knows_it(services, node, expected, last, turn);
  const auto surplus = services.sdo.surplus(node);
  const auto still = co_await identify(services.sdo, node, second_answer);
  const bool alone = still.who && !still.by_two && still.who->address == who.address;
  if (!known || !alone || services.sdo.surplus(node) != surplus) co_return Uncompared{};
  found.differs = 1U << serial_number;
  co_return found;
}

std::string words_of(const Uncompared& parts) {
  if (parts.differs != 0)
    return "1018h:04 and LSS report different serial numbers: Berth uses that of LSS; report it to the maker";
  std::string list;
  for (unsigned part = 0; part < 4; ++part) {
    if ((parts.changes >> part & 1U) != 0) list += fmt::format("{}1018h:{:02X}", list.empty() ? "" : ", ", part + 1);
  }
  return fmt::format("{} changes from reading to reading: it is not compared; report it to the maker", list);
}

}  // namespace berth::places
