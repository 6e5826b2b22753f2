#include "berth/serve/cia309_commands.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/lss/frames.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/od/notation.hpp"
#include "berth/serve/cia309_net.hpp"

namespace berth::serve::cia309 {

using namespace std::chrono_literals;

namespace {

co::SdoOptions sdo_options(operate::Network& network, rt::Duration timeout, bool block) {
  co::SdoOptions options = network.services().sdo.options();
  options.timeout = timeout;
  options.retries = 0;  // the client's to repeat
  options.mode = block ? co::SdoMode::automatic : co::SdoMode::segmented;
  options.longest = NetCommands::longest_value;
  return options;
}

// No answer: CiA 301's abort code, which the device was told, too.
constexpr std::uint32_t no_answer = 0x0504'0000;

}  // namespace

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
    // Both are the machine file's; a command may only say what is so.
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

// The rate that the bus has: a way out of bus-off. Another: only where nothing is disturbed by it.
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

// ---- SDO, NMT ----

rt::Task<Outcome> NetCommands::perform(const Request& request, Net& net) {
  switch (request.verb) {
    case Verb::read: co_return co_await read(request, net);
    case Verb::write: co_return co_await write(request, net);
    case Verb::read_pdo: {
      const auto number = static_cast<std::uint16_t>(request.numbers[0]);
      co_return co_await read_pdo(number, net);
    }
    default: co_return co_await command(request, net);
  }
}

rt::Task<Outcome> NetCommands::read(const Request& request, Net& net) {
  if (!permits_->may_send(net, false)) co_return Outcome::refused(Code::internal_state);
  const auto options = sdo_options(net.network, net.sdo_timeout, net.sdo_block);
  const NodeId node(*request.node);
  const auto value = co_await net.network.services().sdo.upload(node, request.index, request.sub, options);
  if (!value && value.error().code == Errc::timeout) co_return Outcome::aborted(no_answer);
  if (!value) co_return net.failed(value.error());
  const auto text = value_text(request.type, value->bytes());
  if (!text) co_return Outcome::aborted(static_cast<std::uint32_t>(od::AbortCode::length_mismatch));
  co_return Outcome::value(*text);
}

rt::Task<Outcome> NetCommands::write(const Request& request, Net& net) {
  if (!permits_->may_send(net, false)) co_return Outcome::refused(Code::internal_state);
  command::Request command = permits_->request_for(net, "sdo write");
  command.arguments["node"] = fmt::format("{}", *request.node);
  command.arguments["object"] = od::write_object({request.index, request.sub});
  command.arguments["value"] = fmt::format("{:02X}", fmt::join(request.data, ""));
  command.arguments["type"] = "d";
  if (!permits_->undisturbing(command)) co_return Outcome::refused(Code::internal_state);
  const auto options = sdo_options(net.network, net.sdo_timeout, net.sdo_block);
  const NodeId node(*request.node);
  const auto written =
      co_await net.network.services().sdo.download(node, request.index, request.sub, request.data, options);
  if (!written && written.error().code == Errc::timeout) co_return Outcome::aborted(no_answer);
  if (!written) co_return net.failed(written.error());
  co_return Outcome();
}

rt::Task<Outcome> NetCommands::command(const Request& request, Net& net) {
  using co::NmtCommand;
  struct NmtVerb {
    Verb verb;
    NmtCommand nmt;
    const char* word;
  };
  static constexpr std::array<NmtVerb, 5> words{{{Verb::start, NmtCommand::start, "start"},
                                                 {Verb::stop, NmtCommand::stop, "stop"},
                                                 {Verb::preop, NmtCommand::enter_pre_operational, "preop"},
                                                 {Verb::reset_node, NmtCommand::reset_node, "reset-node"},
                                                 {Verb::reset_comm, NmtCommand::reset_communication, "reset-comm"}}};
  const NmtVerb word = *std::ranges::find(words, request.verb, &NmtVerb::verb);
  const bool harmless = word.nmt == NmtCommand::stop || word.nmt == NmtCommand::enter_pre_operational;
  if (!permits_->may_send(net, !harmless)) co_return Outcome::refused(Code::internal_state);
  command::Request wanted = permits_->request_for(net, "nmt");
  wanted.arguments["command"] = word.word;
  wanted.arguments["node"] = *request.node == 0 ? "all" : fmt::format("{}", *request.node);
  if (!permits_->undisturbing(wanted)) co_return Outcome::refused(Code::internal_state);
  co::NmtTarget target = co::NmtTarget::all();
  if (*request.node != 0) target = co::NmtTarget(NodeId(*request.node));
  const auto sent = co_await net.network.services().nmt.send(word.nmt, target);
  if (!sent) co_return net.failed(sent.error());
  net.network.commanded(word.nmt, target);
  co_return Outcome();
}

}  // namespace berth::serve::cia309
