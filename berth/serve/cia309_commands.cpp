#include "berth/serve/cia309_commands.hpp"

#include <fmt/format.h>

#include "berth/lss/frames.hpp"
#include "berth/serve/cia309_net.hpp"

namespace berth::serve::cia309 {

using namespace std::chrono_literals;

Outcome NetCommands::settle(const Request& request, Net& net) {
  const std::uint32_t first = request.numbers[0];
  const NodeId node(request.node.value_or(NodeId::unconfigured_value));
  switch (request.verb) {
    case Verb::set_sdo_timeout: net.sdo_timeout = first * 1ms; return {};
    case Verb::set_sdo_block: net.sdo_block = first == 1; return {};
    case Verb::boot_up_indication: net.boot_ups = first == 1; return {};
    case Verb::sync_indication: net.indicate_sync(first == 1); return {};
    case Verb::enable_heartbeat: net.heartbeats.supervise(node, first * 1ms); return {};
    case Verb::disable_heartbeat: net.heartbeats.supervise(node, 0ms); return {};
    case Verb::disable_guarding: net.guards.end(node); return {};
    case Verb::enable_guarding:
      if (!permits_->may_send(net, false)) return Outcome::refused(Code::internal_state);
      net.guards.guard(node, first * 1ms, static_cast<std::uint8_t>(request.numbers[1]));
      return {};
    case Verb::init: return init(net, first);
    // The machine file sets both; a command may only repeat the value.
    case Verb::set_heartbeat:
      if (first * 1ms != net.network.bus().timing.heartbeat_period) return Outcome::refused(Code::internal_state);
      return {};
    case Verb::set_id:
      if (first != net.network.bus().master.value()) return Outcome::refused(Code::internal_state);
      return {};
    case Verb::set_rpdo:
    case Verb::set_tpdo: return set_pdo(request, net);
    case Verb::write_pdo: return write_pdo(request, net);
    default: return Outcome::refused(Code::not_supported);
  }
}

// With the rate of the bus: recovers from bus-off. Another rate is allowed only if that disturbs nothing.
Outcome NetCommands::init(Net& net, std::uint32_t index) {
  const auto rate = lss::bit_rate(static_cast<lss::BitRateIndex>(index));
  if (!rate || *rate == 0) return Outcome::refused(Code::lss_bit_rate);
  if (!permits_->may_send(net, false)) return Outcome::refused(Code::internal_state);
  can::Port& port = net.network.services().dispatcher.port();
  const auto status = port.status();
  const auto now = status.bit_rate != 0 ? status.bit_rate : net.network.bus().bitrate;
  if (*rate == now && !status.bus_off) return {};
  const bool in_use =
      permits_->house().session->started() || (permits_->house().session->careful() && !permits_->house().confirmed);
  if (*rate != now && in_use) return Outcome::refused(Code::internal_state);
  return port.restart(*rate) ? Outcome() : Outcome::refused(Code::can_init);
}

rt::Task<Outcome> NetCommands::perform(const Request& request, Net& net) {
  if (request.verb != Verb::read_pdo) co_return co_await requests_.run(request, net);
  const auto number = static_cast<std::uint16_t>(request.numbers[0]);
  co_return co_await read_pdo(number, net);
}

// ---- PDO ----

Outcome NetCommands::set_pdo(const Request& request, Net& net) {
  if (request.verb == Verb::set_rpdo) {
    const auto wrong = net.pdos.set_rpdo(request.pdo);
    return wrong ? Outcome::refused(*wrong) : Outcome();
  }
  if (!permits_->may_send(net, false)) return Outcome::refused(Code::internal_state);
  const co::CobId id(request.pdo.cob_id);
  for (const Pdos* const other : permits_->house().pdos) {
    const bool same_net = other != &net.pdos && &other->dispatcher() == &net.network.services().dispatcher;
    if (id.valid() && same_net && other->sends(id.key())) return Outcome::refused(Code::pdo_used);
  }
  const auto wrong = net.pdos.set_tpdo(request.pdo);
  return wrong ? Outcome::refused(*wrong) : Outcome();
}

Outcome NetCommands::write_pdo(const Request& request, Net& net) {
  if (!permits_->may_send(net, false)) return Outcome::refused(Code::internal_state);
  const auto written = net.pdos.write(static_cast<std::uint16_t>(request.numbers[0]), request.values);
  if (written.error) return Outcome::refused(*written.error);
  if (written.queued == can::Queued::yes) return {};
  return net.failed(Error{.code = Errc::bus});
}

rt::Task<Outcome> NetCommands::read_pdo(std::uint16_t number, Net& net) {
  auto state = net.pdos.rpdo(number);
  if (!state) co_return Outcome::refused(Code::internal_state);
  if (state->by_request) {
    const auto before = state->receptions;
    if (!permits_->may_send(net, false)) co_return Outcome::refused(Code::internal_state);
    if (net.pdos.ask(number) != can::Queued::yes) co_return net.failed(Error{.code = Errc::bus});
    const rt::Time end = net.network.services().dispatcher.executor().now() + net.sdo_timeout;
    while (state && state->receptions == before && net.network.services().dispatcher.executor().now() < end) {
      co_await rt::sleep_for(1ms);
      state = net.pdos.rpdo(number);
    }
    if (!state || state->receptions == before) co_return Outcome::refused(Code::timeout);
  }
  if (state->receptions == 0) co_return Outcome::refused(Code::internal_state);
  co_return Outcome::value(
      fmt::format("{} pdo {}{}", net.number, state->values.size(), Net::pdo_values(state->values)));
}

}  // namespace berth::serve::cia309
