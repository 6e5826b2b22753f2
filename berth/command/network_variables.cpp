#include "berth/command/network_variables.hpp"

#include <algorithm>
#include <cctype>
#include <vector>

#include "berth/traffic/link_network.hpp"

namespace berth::command {
namespace {

bool same_name(const std::string& a, const std::string& b) {
  const auto lower = [](unsigned char c) { return std::tolower(c); };
  return std::ranges::equal(a, b, {}, lower, lower);
}

bool named_by_a_link(const design::Machine& machine, const std::string& slot, const std::string& word) {
  const auto is_it = [&](const design::LinkEnd& end) { return end.slot == slot && same_name(end.object, word); };
  return std::ranges::any_of(
      machine.links, [&](const design::Link& link) { return is_it(link.from) || std::ranges::any_of(link.to, is_it); });
}

// Reads the file of the plan if there is one: planning anew takes longer.
std::vector<linker::EarlierVariable> variables_of(const design::Machine& machine) {
  Findings ignored;
  auto earlier = traffic::earlier_plan(machine, ignored);
  if (earlier && !earlier->variables.empty()) return std::move(earlier->variables);
  const traffic::LinkPlan links = traffic::plan_links(machine);
  return has_errors(links.findings) ? std::vector<linker::EarlierVariable>()
                                    : linker::earlier_of(links.network, links.plan).variables;
}

}  // namespace

std::optional<KnownObject> network_variable(const design::Machine& machine, const NodeArgument& node,
                                            const std::string& word) {
  const auto* const bus = bus_of(machine, node);
  const auto* const slot = bus == nullptr ? nullptr : machine.slot(bus->name, node.node);
  if (slot == nullptr || !named_by_a_link(machine, slot->spec.name.name, word)) return std::nullopt;
  for (const auto& variable : variables_of(machine)) {
    if (variable.node != slot->spec.name.name || !same_name(variable.name, word)) continue;
    KnownObject object = known_object(node.description.get(), variable.object);
    object.name = variable.name;
    object.type = variable.type;
    return object;
  }
  return std::nullopt;
}

}  // namespace berth::command
