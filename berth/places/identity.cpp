#include "berth/places/identity.hpp"

#include <array>
#include <utility>

namespace berth::places {

namespace {

// `calm`: pause before the last question, in which the node-ID is asked nothing.
rt::Task<Result<Identity>> read_parts(co::SdoClient& sdo, NodeId node, co::SdoOptions how, rt::Duration calm) {
  std::array<std::uint32_t, 4> parts{};
  std::uint8_t unknown = 0;
  for (unsigned i = 0; i < 4; ++i) {
    if (i == 3 && calm.count() > 0) co_await rt::sleep_for(calm);
    const auto part = co_await sdo.read<std::uint32_t>(node, 0x1018, static_cast<std::uint8_t>(i + 1), how);
    if (!part && part.error().code != Errc::aborted) co_return fail(part.error());
    if (part) parts[i] = *part;
    if (!part) unknown = static_cast<std::uint8_t>(unknown | 1U << i);
  }
  Identity who(parts[0], parts[1], parts[2], parts[3]);
  who.unknown = unknown;
  co_return who.with(node);
}

}  // namespace

rt::Task<Result<Identity>> read_identity(co::SdoClient& sdo, NodeId node) {
  return read_identity(sdo, node, sdo.options());
}

rt::Task<Result<Identity>> read_identity(co::SdoClient& sdo, NodeId node, co::SdoOptions how) {
  return read_parts(sdo, node, how, {});
}

rt::Task<Identified> identify(co::SdoClient& sdo, NodeId node, rt::Duration listens) {
  Identified answer;
  for (int time = 0; time < 2; ++time) {
    const auto surplus = sdo.surplus(node);
    auto who = co_await read_parts(sdo, node, sdo.options(), listens);
    answer.who = std::move(who);
    if (listens.count() > 0) co_await rt::sleep_for(listens);
    answer.by_two = sdo.surplus(node) != surplus;
    if (!answer.by_two) break;
    if (time == 0) co_await rt::sleep_for(second_answer);
  }
  co_return answer;
}

}  // namespace berth::places
