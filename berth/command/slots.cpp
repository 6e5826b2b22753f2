// The slot table, and the user's changes to it: report, bind, replace, forget, poll.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/base/shell_word.hpp"
#include "berth/command/arguments.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/operate/slot_rows.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {

using places::SlotState;

rt::Task<void> report(Session& session, const Request& request, Reply& reply) {
  const Arguments arguments(request);
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  if (arguments.has("slot")) co_return co_await slot_status(session, request, reply);
  const std::string bus = arguments.text("bus");
  operate::Report now = session.report();
  bool operational = session.operational();
  if (!bus.empty()) {
    const auto network = network_for(session, bus, Use::look);
    if (!network) co_return refuse(reply, 2, network.error());
    operational = (*network)->operational();
    std::erase_if(now.slots, [&](const SlotReport& slot) { return slot.bus != bus; });
    std::erase_if(now.masters, [&](const operate::MasterReport& master) { return master.bus != bus; });
  }
  reply.json = to_json(now, -1);
  reply.lines = operate::to_table(now.slots, session.executor().now());
  for (const auto& master : now.masters) reply.lines.push_back(master.text());
  for (const auto& question : now.questions) reply.lines.push_back(question.text);
  for (const auto& network : session.networks()) {
    if (!bus.empty() && network->bus().name != bus) continue;
    for (const auto& oddity : network->planning().plan().oddities) reply.lines.push_back(oddity.text);
  }
  reply.status = operational ? 0 : 1;
}

namespace {

void give_report(Session& session, Reply& reply) {
  const operate::Report now = session.report();
  reply.json = to_json(now, -1);
  reply.lines = operate::to_table(now.slots, session.executor().now());
  for (const auto& network : session.networks()) {
    for (const auto& question : network->planning().plan().questions) reply.lines.push_back(question.text);
    for (const auto& oddity : network->planning().plan().oddities) reply.lines.push_back(oddity.text);
  }
}

}  // namespace

rt::Task<void> bind(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const bool scratch = arguments.has("from-scratch");
  const bool yes = arguments.has("yes");
  const std::string method = arguments.text("method");
  if (!method.empty() && method != "auto" && !discovery::method(method)) {
    arguments.wrong(fmt::format("there is no discovery method {}", text::quoted(method)));
  }
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto networks = networks_for(session, arguments.text("bus"), Use::send);
  if (!networks) co_return refuse(reply, 2, networks.error());
  std::string problem;
  int status = 0;
  for (Network* const network : *networks) {
    Result<void> bound;
    if (scratch) {
      bound = co_await network->bind_from_scratch(yes);
    } else {
      bound = co_await network->bind_once(method);
    }
    if (bound) continue;
    status = std::max(status, status_of(bound.error().code));
    problem += (problem.empty() ? "" : "; ") + fmt::format("bus {}: {}", network->bus().name, bound.error().text);
  }
  give_report(session, reply);
  reply.status = status;
  reply.error = error_line(problem);
}

namespace {

// The wait for the slot's new device is over; in the other states, the slot may still get one.
bool settled(SlotState state) {
  switch (state) {
    case SlotState::operational:
    case SlotState::question:
    case SlotState::power_cycle:
    case SlotState::failed:
    case SlotState::duplicate:
    case SlotState::wrong_type: return true;
    default: return false;
  }
}

std::optional<SlotReport> slot_of(const Network& network, const std::string& name) {
  const auto slots = network.report();
  const auto it = std::ranges::find(slots, name, &SlotReport::name);
  return it == slots.end() ? std::nullopt : std::optional<SlotReport>(*it);
}

rt::Duration longest_wait(const Network& network) noexcept {
  const auto& timing = network.bus().timing;
  return 3 * timing.probe_period + timing.boot_timeout;
}

// "valve-b released (heartbeat lost)". Leaves out the reason's advice: the user has followed it.
std::string released(const SlotReport& before) {
  const std::string fact = before.reason.substr(0, before.reason.find(';'));
  return before.state == SlotState::absent ? fmt::format("{} released ({})", before.name, fact)
                                           : fmt::format("{} released", before.name);
}

// Waits for the main job, which binds the device. If no device comes, the slot stays empty.
rt::Task<void> await_slot(Network& network, const std::string& name) {
  const auto& timing = network.bus().timing;
  const rt::Time deadline = network.services().executor.now() + longest_wait(network);
  while (network.services().executor.now() < deadline) {
    co_await rt::sleep_for(timing.heartbeat_period / 8 + std::chrono::milliseconds(1));
    const auto slot = slot_of(network, name);
    if (slot && settled(slot->state)) co_return;
  }
}

}  // namespace

rt::Task<void> replace(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const bool used = arguments.has("used");
  const std::string wanted = arguments.required("slot");
  const std::optional<Identity> device = arguments.optional_device("device");
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto slot_meant =
      own_slot(session, arguments.text("bus"), wanted,
               "the NMT master there gives its device the node-ID: put the new device in, and that master takes it");
  if (!slot_meant) co_return refuse(reply, 2, slot_meant.error());
  const auto& [network, name] = *slot_meant;
  const auto usable = network_for(session, network->bus().name, Use::send);
  if (!usable) co_return refuse(reply, 2, usable.error());
  // Whether the slot's device is on the bus is known only after a look; a running main job has looked already.
  if (!session.started()) {
    const auto looked = co_await network->bind_once();
    if (!looked && looked.error().code == Errc::bus)
      co_return fail_with(reply, looked.error(), "looking which devices are there");
  }
  const auto before = slot_of(*network, name);
  Result<void> cleared;
  {
    co_await network->services().turn.take();
    const rt::Held held(network->services().turn);
    cleared = network->replace(name, device, used);
  }
  if (!cleared) co_return fail_with(reply, cleared.error(), fmt::format("bus {}, slot {}", network->bus().name, name));
  if (session.started()) {
    const double seconds = std::chrono::duration<double>(longest_wait(*network)).count();
    if (before) reply.tell(fmt::format("{}; waiting for a new device, {:.0f} s at most", released(*before), seconds));
    co_await await_slot(*network, name);
  } else {
    const auto bound = co_await network->bind_once();
    if (!bound && bound.error().code == Errc::bus) co_return fail_with(reply, bound.error(), "binding");
  }
  const auto slot = slot_of(*network, name);
  const bool seated = slot && (slot->state == SlotState::operational || slot->state == SlotState::present);
  reply.json = slot ? to_json(*slot) : "{}";
  reply.lines = operate::to_table(slot ? std::vector<SlotReport>{*slot} : std::vector<SlotReport>{});
  const bool untold = !session.started() || !reply.progress;
  if (untold && before && before->state == SlotState::absent)
    reply.lines.insert(reply.lines.begin(), released(*before));
  if (seated) co_return;
  reply.status = 1;
  // Devices on the bus that do not fit: the user may have plugged in one of them.
  for (const auto& oddity : network->planning().plan().oddities) reply.lines.push_back(oddity.text);
  reply.error =
      error_line(fmt::format("slot {} has no new device yet; its binding is cleared, and {}", name,
                             session.started() ? "the next device of its type that comes gets it"
                                               : "`berth up` or `berth bind` gives it to the next device of its type"));
}

namespace {

// The buses whose slots wait for this device. Several: each has a twin, or one device was moved.
std::vector<std::string> waiting_buses(const std::vector<Network*>& networks, const Identity& device) {
  std::vector<std::string> buses;
  for (const Network* const network : networks) {
    if (network->planning().waits_for(device)) buses.push_back(network->bus().name);
  }
  return buses;
}

}  // namespace

rt::Task<void> forget(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const Identity device = arguments.device("device");
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto networks = networks_for(session, arguments.text("bus"), Use::look);
  if (!networks) co_return refuse(reply, 2, networks.error());
  const std::vector<std::string> waiting = waiting_buses(*networks, device);
  if (waiting.size() > 1) {
    co_return refuse(reply, 2,
                     fmt::format("Berth waits for device {} on the buses {}: on which one is it gone?",
                                 to_string(device), fmt::join(waiting, ", ")),
                     "give --bus NAME");
  }
  bool known = false;
  for (Network* const network : *networks) {
    const auto forgotten = network->forget(device);
    const bool elsewhere = !forgotten && forgotten.error().code == Errc::not_found;
    if (!forgotten && !elsewhere) {
      co_return fail_with(reply, forgotten.error(), fmt::format("bus {}, forget", network->bus().name));
    }
    known = known || forgotten.has_value();
  }
  if (!known) {
    co_return refuse(reply, 1, fmt::format("Berth does not wait for device {}", to_string(device)),
                     "`berth replace SLOT` releases a device that is in a slot");
  }
  Json json;
  put_address(json, device);
  give(reply, json, {fmt::format("Berth no longer waits for {}", to_string(device))});
}

rt::Task<void> poll(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const bool on = !arguments.has("stop");
  const std::string wanted = arguments.required("slot");
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto slot = own_slot(session, arguments.text("bus"), wanted, "the NMT master there asks for its slaves");
  if (!slot) co_return refuse(reply, 2, slot.error());
  const auto& [network, name] = *slot;
  const auto usable = network_for(session, network->bus().name, Use::send);
  if (!usable) co_return refuse(reply, 2, usable.error());
  const auto done = operate::poll_slot(*network, name, on);
  if (!done) co_return fail_with(reply, done.error(), fmt::format("bus {}, slot {}", network->bus().name, name));
  give(reply, Json{{"slot", name}, {"polled", on}},
       {on ? fmt::format("{} is asked for", name)
           : fmt::format("Berth no longer asks for {}, until it is heard or `berth poll {}` is given", name,
                         shell_word(name))});
}

}  // namespace berth::command
