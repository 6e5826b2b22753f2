// nmt: sends one NMT command.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "berth/co/nmt_master.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/network/network_requests.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {

namespace {

struct NmtWord {
  std::string_view word;
  std::string_view also;  ///< the state that the command leads to, or its short form
  co::NmtCommand command;
};
constexpr std::array nmt_words{NmtWord{"start", "operational", co::NmtCommand::start},
                               NmtWord{"stop", "stopped", co::NmtCommand::stop},
                               NmtWord{"preop", "pre-operational", co::NmtCommand::enter_pre_operational},
                               NmtWord{"reset-node", "reset", co::NmtCommand::reset_node},
                               NmtWord{"reset-comm", "reset-communication", co::NmtCommand::reset_communication}};

const NmtWord* nmt_word(std::string_view word) noexcept {
  const auto* const it =
      std::ranges::find_if(nmt_words, [word](const NmtWord& w) { return w.word == word || w.also == word; });
  return it == nmt_words.end() ? nullptr : it;
}

}  // namespace

std::string no_nmt_command(const std::string& word) {
  if (nmt_word(word) != nullptr) return {};
  return fmt::format("{} is not an NMT command; use start, stop, preop, reset-node or reset-comm", text::quoted(word));
}

NmtArguments nmt_arguments(Arguments& arguments, const design::Machine& machine) {
  NmtArguments nmt;
  nmt.bus = arguments.text("bus");
  nmt.word = arguments.required("command");
  if (arguments.text("node") != "all") {
    const NodeArgument node = node_argument(arguments, machine);
    nmt.bus = node.bus;
    nmt.target = node.node;
    nmt.gateways = node.gateways;
  }
  if (arguments.has("request"))
    nmt.requested_of = NodeId(static_cast<std::uint8_t>(arguments.number("request", 1, 127)));
  if (const auto* const meant = nmt_word(nmt.word)) {
    nmt.word = meant->word;
    nmt.command = meant->command;
  } else {
    arguments.wrong(no_nmt_command(nmt.word));
  }
  return nmt;
}

std::uint8_t NmtArguments::request_sub() const noexcept {
  return target == co::NmtTarget::all() ? network::NetworkRequests::all_nodes : target.node;
}
std::uint8_t NmtArguments::request_value() const noexcept { return network::request_value(command); }

namespace {

// NMT has no answer, so the next heartbeat serves as one: a report asked for after this command then has the new
// states. A node that stays silent or does not change its state is no failure of the command.
rt::Task<void> wait_for_heartbeats(Network& bus, const NmtArguments& nmt) {
  const NmtState wanted = co::state_after(nmt.command);
  if (wanted == NmtState::initialising) co_return;
  const auto period = bus.bus().timing.heartbeat_period;
  const auto& heartbeats = bus.services().heartbeats;
  const auto follows = [&](const SlotReport& slot) -> bool {
    const auto state = nmt.target.includes(slot.id) ? heartbeats.state(slot.id) : std::nullopt;
    return !state || state == wanted;
  };
  const rt::Time end = bus.services().executor.now() + period + period / 4;
  while (bus.services().executor.now() < end && !std::ranges::all_of(bus.report(), follows)) {
    co_await rt::sleep_for(period / 16 + std::chrono::milliseconds(1));
  }
}

std::string whom(const NmtArguments& nmt) {
  if (nmt.target == co::NmtTarget::all()) return "all nodes";
  return "node " + multilevel::to_string(multilevel::Path{nmt.gateways, NodeId(nmt.target.node)});
}

Json json_of(const Network& bus, const NmtArguments& nmt) {
  Json json;
  json["bus"] = bus.bus().name;
  json["command"] = nmt.word;
  if (nmt.target == co::NmtTarget::all()) {
    json["node"] = "all";
  } else {
    json["node"] = nmt.target.node;
  }
  return json;
}

// Another master of the bus, or the master of a bus beneath, sends the command: its 1F82h is written.
rt::Task<void> request_of(Session& session, Network& bus, const NmtArguments& nmt, Reply& reply) {
  const std::array<std::uint8_t, 1> value{nmt.request_value()};
  const NodeArgument master{bus.bus().name, nmt.requested_of, nullptr, nmt.gateways};
  std::optional<co::NodeAccess> direct;
  const co::SdoOptions how = bus.services().sdo.options();
  co::SdoAccess& objects = objects_of(session, bus, master, how, direct);
  const std::uint8_t sub = nmt.request_sub();
  const std::span<const std::uint8_t> data(value);
  const auto written = co_await objects.write(od::cia302::request_nmt, sub, data);
  if (!written) {
    co_return fail_with(reply, written.error(),
                        fmt::format("bus {}, NMT {} of {} by the master at node {} (1F82h:{:02X})", bus.bus().name,
                                    nmt.word, whom(nmt), master.text(), nmt.request_sub()),
                        "a node that is not an NMT master, or is not in its network list (1F81h), is refused",
                        master.path());
  }
  // The master beneath sends the command now. Waiting a little gives a report asked for afterwards the new states.
  const auto* const line = bus_of(session.machine(), master);
  tree::Beneath* const beneath = line == nullptr ? nullptr : session.tree().bus(line->name);
  if (beneath != nullptr && session.started()) {
    co_await rt::sleep_for(bus.bus().timing.heartbeat_period / 16 + std::chrono::milliseconds(1));
    beneath->ask_all();
  }
  Json json = json_of(bus, nmt);
  json["requested_of"] = nmt.requested_of.value();
  give(reply, json,
       {fmt::format("node {} was asked for NMT {} to {} (1F82h)", master.text(), co::name(nmt.command), whom(nmt))});
}

// A gateway does not forward NMT: the master of the bus beneath it must send the command.
NodeId master_beneath(const design::Machine& machine, const std::string& bus, const NmtArguments& nmt) {
  for (const auto& beneath : machine.beneath) {
    if (tree::way_to(machine, beneath.name) == tree::Way{bus, nmt.gateways}) return beneath.master;
  }
  return {};
}

}  // namespace

rt::Task<void> nmt_command(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  NmtArguments nmt = nmt_arguments(arguments, session.machine());
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const bool harmless = nmt.command == co::NmtCommand::stop || nmt.command == co::NmtCommand::enter_pre_operational;
  const auto network = network_for(session, nmt.bus, harmless ? Use::send : Use::command);
  if (!network) co_return refuse(reply, 2, network.error());
  Network& bus = **network;
  if (!nmt.gateways.empty() && !nmt.requested_of.configured()) {
    nmt.requested_of = master_beneath(session.machine(), bus.bus().name, nmt);
    if (!nmt.requested_of.configured()) {
      co_return refuse(reply, 2,
                       fmt::format("NMT ends at a gateway, and the machine file does not say which node is the NMT "
                                   "master of the bus of {}",
                                   whom(nmt)),
                       "name it by --request");
    }
  }
  if (nmt.requested_of.configured()) co_return co_await request_of(session, bus, nmt, reply);
  const auto sent = co_await bus.services().nmt.send(nmt.command, nmt.target);
  if (!sent)
    co_return fail_with(reply, sent.error(), fmt::format("bus {}, NMT {} to {}", bus.bus().name, nmt.word, whom(nmt)));
  bus.commanded(nmt.command, nmt.target);
  const bool waits = session.started() && !arguments.has("no-wait");
  if (waits) co_await wait_for_heartbeats(bus, nmt);
  Json json = json_of(bus, nmt);
  json["sent_s"] = operate::seconds(*sent);
  give(reply, json, {fmt::format("NMT {} sent to {}", co::name(nmt.command), whom(nmt))});
}

}  // namespace berth::command
