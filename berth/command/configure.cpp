// `berth configure`: compares devices with their configuration files, and writes what differs.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/command/arguments.hpp"
#include "berth/command/differences.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

using operate::SlotConfiguration;

struct Wish {
  std::vector<Network*> networks;
  std::string slot;  // empty: all slots that have a configuration
  bool write = true;
};

const char* result_of(const SlotConfiguration& c, bool write) {
  if (!c.problem.empty() || !c.report.good()) return "failed";
  if (!write && !c.report.differences.empty()) return "differs";
  if (c.state == places::SlotState::power_cycle) return "power cycle needed";
  if (write && (c.state == places::SlotState::failed || c.state == places::SlotState::absent)) return "failed";
  return c.report.changed() ? "configured" : "right";
}

std::string text_of(const SlotConfiguration& c, bool write) {
  if (!c.problem.empty()) return c.problem;
  const std::string result = result_of(c, write);
  if (result == "failed" && c.report.good()) return c.reason;
  return result == "power cycle needed" ? c.reason : summary(c.report, c.file);
}

Json json_of(const SlotConfiguration& c, bool write) {
  Json json;
  json["bus"] = c.bus;
  json["id"] = c.id.value();
  json["slot"] = c.slot;
  json["file"] = c.file;
  json["result"] = result_of(c, write);
  json["text"] = text_of(c, write);
  json["differences"] = Json::array();
  for (const auto& d : c.report.differences) json["differences"].push_back(difference_json(d));
  return json;
}

void give_result(Reply& reply, const std::vector<SlotConfiguration>& slots, bool write) {
  Json json;
  json["slots"] = Json::array();
  std::vector<std::string> lines;
  std::size_t wrong = 0;
  for (const auto& c : slots) {
    const std::string result = result_of(c, write);
    const bool right = result == "right" || result == "configured";
    if (!right) ++wrong;
    json["slots"].push_back(json_of(c, write));
    lines.push_back(fmt::format("{}  {:>3}  {}: {}: {}", c.bus, c.id.value(), c.slot, result, text_of(c, write)));
    if (write && right) continue;
    for (const auto& d : c.report.differences) lines.push_back("    " + describe(d, c.file));
  }
  json["wrong"] = wrong;
  give(reply, json, std::move(lines));
  reply.status = wrong == 0 ? 0 : 1;
  if (wrong != 0) {
    reply.error = fmt::format("{} of {} {}", wrong, counted(slots.size(), "slot"),
                              wrong == 1 ? "differs from its file" : "differ from their files");
  }
}

// The networks to configure. Returns the problem as text for the user.
std::string read_wish(Session& session, const Request& request, Wish& wish) {
  Arguments arguments(request);
  if (!arguments.good()) return arguments.problem();
  wish.write = !arguments.has("check");
  const std::string bus = arguments.text("bus");
  const std::string slot = arguments.text("slot");
  if (!slot.empty()) {
    const auto meant =
        own_slot(session, bus, slot, "`berth up` brings its configuration into the gateway, whose master writes it");
    if (!meant) return meant.error();
    wish.slot = meant->name;
    wish.networks = {meant->network};
  } else if (!bus.empty()) {
    Network* const network = session.network(bus);
    if (network == nullptr) return fmt::format("the machine has no bus {}", text::quoted(bus));
    wish.networks = {network};
  } else {
    for (const auto& network : session.networks()) wish.networks.push_back(network.get());
  }
  for (const Network* const network : wish.networks) {
    const auto usable = network_for(session, network->bus().name, Use::send);
    if (!usable) return usable.error();
  }
  const auto has_config = [&](const design::Slot& s) {
    const auto& name = s.spec.name;
    const bool here = std::ranges::any_of(wish.networks, [&](const Network* n) { return n->bus().name == name.bus; });
    return here && session.configures(s) && (wish.slot.empty() || name.name == wish.slot);
  };
  if (std::ranges::any_of(session.machine().slots, has_config)) return {};
  return wish.slot.empty() ? "no slot of this machine has a configuration; give one its config = \"FILE.dcf\""
                           : fmt::format("slot {} has no configuration; give it config = \"FILE.dcf\"", wish.slot);
}

}  // namespace

rt::Task<void> configure(Session& session, const Request& request, Reply& reply) {
  Wish wish;
  const std::string problem = read_wish(session, request, wish);
  if (!problem.empty()) co_return refuse(reply, 2, problem);
  std::vector<SlotConfiguration> slots;
  for (Network* const network : wish.networks) {
    if (!session.started()) {
      const auto bound = co_await network->bind_once();
      if (!bound && bound.error().code == Errc::bus)
        co_return fail_with(reply, bound.error(), "looking which devices are there");
    }
    auto done = co_await network->configure(wish.slot, wish.write);
    if (!done) co_return fail_with(reply, done.error(), fmt::format("bus {}", network->bus().name));
    for (auto& c : *done) slots.push_back(std::move(c));
  }
  give_result(reply, slots, wish.write);
}

}  // namespace berth::command
