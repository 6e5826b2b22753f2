// scan: who is on the bus.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

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
  if (!seen.slot.empty()) json["slot"] = seen.slot;
  return json;
}

std::string line_of(const operate::Seen& seen, const std::string& bus) {
  return fmt::format("{}  {:>3}  {:<35}  {:<15}{}{}", bus,
                     seen.id.configured() ? fmt::format("{}", seen.id.value()) : "-",
                     seen.device ? to_string(*seen.device) : "(does not tell its identity)",
                     seen.state ? name(*seen.state) : "-", seen.slot.empty() ? "" : "  slot " + seen.slot,
                     seen.duplicate ? "  DUPLICATE: two devices answer here; take one of them off the bus" : "");
}

// RAND has found them: they are "identified" and would not answer a running main job's question for new devices.
rt::Task<void> make_unknown_again(Network& network, const std::vector<operate::Seen>& seen) {
  co_await network.services().turn.take();
  const rt::Held held(network.services().turn);
  for (const auto& s : seen) {
    const bool stranger = s.device && s.slot.empty();
    if (!stranger) continue;
    const LssAddress device = *s.device;
    const auto told = co_await network.services().rand.switch_selective(device, nodeid::Identification::unknown);
    if (!told) co_return;
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
  Json json;
  json["nodes"] = Json::array();
  std::vector<std::string> lines;
  std::size_t unconfigured = 0;
  std::size_t duplicates = 0;
  for (Network* const network : *networks) {
    const auto seen = co_await network->scan();
    const std::string& bus = network->bus().name;
    if (!seen) co_return fail_with(reply, seen.error(), fmt::format("bus {}, scan", bus));
    for (const auto& s : *seen) {
      json["nodes"].push_back(json_of(s, bus));
      lines.push_back(line_of(s, bus));
      if (!s.id.configured()) ++unconfigured;
      if (s.duplicate) ++duplicates;
    }
    if (session.started()) co_await make_unknown_again(*network, *seen);
  }
  // Where Berth has no port, the gateway's master tells whom it knows.
  for (const auto& each : session.tree().buses()) {
    const std::string& bus = each->bus().name;
    if (!only.empty() && bus != only) continue;
    const auto seen = co_await each->scan();
    if (!seen) co_return fail_with(reply, seen.error(), fmt::format("bus {}, scan through its gateway", bus));
    for (const auto& s : *seen) {
      json["nodes"].push_back(json_of(s, bus));
      lines.push_back(line_of(s, bus));
    }
  }
  const std::size_t all = lines.size();
  json["configured"] = all - unconfigured;
  json["unconfigured"] = unconfigured;
  json["duplicates"] = duplicates;
  lines.push_back(fmt::format("{} devices: {} with a node-ID, {} without, {} duplicate", all, all - unconfigured,
                              unconfigured, duplicates));
  give(reply, json, std::move(lines));
  if (duplicates > 0) reply.status = 1;
}

}  // namespace berth::command
