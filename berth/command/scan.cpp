// scan: who is on the bus.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/command/arguments.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"

namespace berth::command {
namespace {

Json json_of(const operate::Seen& seen, const std::string& bus) {
  Json json;
  json["bus"] = bus;
  if (seen.id.configured()) {
    json["id"] = seen.id.value();
  } else {
    json["id"] = nullptr;
  }
  if (seen.device) put_address(json, *seen.device);
  if (seen.device_type) json["device_type"] = hex(*seen.device_type);
  if (seen.state) json["state"] = name(*seen.state);
  json["duplicate"] = seen.duplicate;
  if (seen.left_alone) json["left_alone"] = true;
  if (!seen.slot.empty()) json["slot"] = seen.slot;
  return json;
}

const char* why_unknown(const operate::Seen& seen) {
  return seen.left_alone ? "(another SDO client talks to it)" : "(does not report its identity)";
}

std::string line_of(const operate::Seen& seen, const std::string& bus) {
  return fmt::format("{}  {:>3}  {:<35}  {:<15}{}{}", bus,
                     seen.id.configured() ? fmt::format("{}", seen.id.value()) : "-",
                     seen.device ? to_string(*seen.device) : why_unknown(seen), seen.state ? name(*seen.state) : "-",
                     seen.slot.empty() ? "" : "  slot " + seen.slot,
                     seen.duplicate ? "  DUPLICATE: two devices answer here; take one of them off the bus" : "");
}

// The scan's RAND has left these devices "identified": they would not answer when a running main job looks for new
// devices.
rt::Task<void> make_unknown_again(Network& network, const std::vector<operate::Seen>& seen) {
  co_await network.services().turn.take();
  const rt::Held held(network.services().turn);
  for (const auto& s : seen) {
    const bool stranger = s.device && s.slot.empty();
    if (!stranger) continue;
    const LssAddress device = s.device->address;
    const auto told = co_await network.services().rand.switch_selective(device, nodeid::Identification::unknown);
    if (!told) co_return;
  }
}

}  // namespace

namespace {

// A bus beneath, whose gateway does not answer, or a gateway above that one.
struct Unreached {
  std::string bus;
  std::string why;
  int status = 1;
};

// `among_heard`: the others were not asked.
std::string totals(std::size_t all, std::size_t unconfigured, std::size_t duplicates, bool among_heard) {
  constexpr const char* rest =
      "`berth scan --all` asks every node-ID, and searches for devices without one by LSS and RAND";
  if (!among_heard) {
    return fmt::format("{}: {} with a node-ID, {} without, {} duplicate", counted(all, "device"), all - unconfigured,
                       unconfigured, duplicates);
  }
  constexpr auto listened = std::chrono::duration_cast<std::chrono::seconds>(operate::Scan::listens).count();
  if (all == 0) return fmt::format("no device was heard in {} s, and none was asked; {}", listened, rest);
  return fmt::format("{} heard, {} duplicate; one that is silent, or has no node-ID, was not asked: {}",
                     counted(all, "device"), duplicates, rest);
}

// The gateway's slot on the bus above, for the user.
std::string gateway_of(const design::Machine& machine, const design::Bus& bus) {
  const auto* const slot = machine.slot(bus.gateway->bus, bus.gateway->slot);
  return slot == nullptr ? fmt::format("gateway {} of bus {}", bus.gateway->slot.value(), bus.gateway->bus)
                         : fmt::format("gateway {} ({}) of bus {}", bus.gateway->slot.value(), slot->spec.name.name,
                                       bus.gateway->bus);
}

std::string why_unreached(const Session& session, const design::Bus& bus, const Error& error) {
  const std::string gateway = gateway_of(session.machine(), bus);
  if (error.code == Errc::timeout) return gateway + " does not answer";
  return fmt::format("{}: {}", gateway, describe(error));
}

// The problem and what to do: a gateway answers after the bus above has been brought up.
std::string not_reached(const std::vector<Unreached>& all) {
  std::string text;
  for (const auto& each : all) text += fmt::format("bus {} was not asked: {}; ", each.bus, each.why);
  return text +
         "a gateway answers when it has its node-ID and power: `berth up` gives it the one (in a simulated world "
         "of its own: --up)";
}

}  // namespace

namespace {

// The reply about all buses.
struct ScanReply {
  Json json;
  std::vector<std::string> lines;
  std::vector<Unreached> unreached;
  std::size_t unconfigured = 0;
  std::size_t duplicates = 0;
  void add(const operate::Seen& seen, const std::string& bus) {
    json["nodes"].push_back(json_of(seen, bus));
    lines.push_back(line_of(seen, bus));
    if (!seen.id.configured()) ++unconfigured;
    if (seen.duplicate) ++duplicates;
  }
};

// On a bus without a port of Berth's, the gateway's master reports the nodes that it knows.
rt::Task<void> ask_beneath(Session& session, std::string only, ScanReply& told) {
  auto& unreached = told.unreached;
  for (const auto& each : session.tree().buses()) {
    const std::string& bus = each->bus().name;
    if (!only.empty() && bus != only) continue;
    const std::string& above = each->bus().gateway->bus;
    if (std::ranges::find(unreached, above, &Unreached::bus) != unreached.end()) {
      const std::string why = fmt::format("bus {} above it was not reached", above);
      unreached.push_back({bus, why, status_of(Errc::timeout)});
      continue;
    }
    const auto seen = co_await each->scan();
    if (!seen) {
      const std::string why = why_unreached(session, each->bus(), seen.error());
      unreached.push_back({bus, why, status_of(seen.error().code)});
      continue;
    }
    for (const auto& s : *seen) told.add(s, bus);
  }
}

}  // namespace

rt::Task<void> scan(Session& session, const Request& request, Reply& reply) {
  const Arguments arguments(request);
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const std::string only = arguments.text("bus");
  auto networks = networks_for(session, only, Use::send);
  const bool beneath = session.tree().bus(only) != nullptr;
  if (!networks && !beneath) co_return refuse(reply, 2, networks.error());
  if (beneath) networks = std::vector<Network*>{};
  const bool everybody = arguments.has("all");
  const auto range = everybody ? operate::ScanRange::all : operate::ScanRange::heard;
  ScanReply told;
  told.json["nodes"] = Json::array();
  for (Network* const network : *networks) {
    const auto seen = co_await network->scan(range);
    const std::string& bus = network->bus().name;
    if (!seen) co_return fail_with(reply, seen.error(), fmt::format("bus {}, scan", bus));
    for (const auto& s : *seen) told.add(s, bus);
    if (everybody && session.started()) co_await make_unknown_again(*network, *seen);
  }
  co_await ask_beneath(session, only, told);
  Json& json = told.json;
  const std::size_t all = told.lines.size();
  json["configured"] = all - told.unconfigured;
  json["unconfigured"] = told.unconfigured;
  json["duplicates"] = told.duplicates;
  json["asked"] = everybody ? "all" : "heard";
  told.lines.push_back(totals(all, told.unconfigured, told.duplicates, !everybody && !networks->empty()));
  for (const auto& each : told.unreached) json["unreached"].push_back({{"bus", each.bus}, {"why", each.why}});
  give(reply, json, std::move(told.lines));
  if (told.duplicates > 0) reply.status = 1;
  if (told.unreached.empty()) co_return;
  for (const auto& each : told.unreached) reply.status = std::max(reply.status, each.status);
  reply.error = error_line(not_reached(told.unreached));
}

}  // namespace berth::command
