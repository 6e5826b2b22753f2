#include "strangers.hpp"

#include <fmt/format.h>

#include <utility>

#include "berth/rt/scope.hpp"

namespace berth::cli {

tl::expected<void, Failure> Strangers::listen_first() {
  if (guards_->empty()) return {};
  rt::Duration longest{0};
  for (const auto& bus : session_->machine().buses) {
    longest = std::max(longest, bus.timing.listen);
    if (bus.role != design::Role::master || guards_->gate(bus.name) == nullptr) continue;
    heard_[bus.name] = std::make_unique<live::Census>(session_->network(bus.name)->services().dispatcher);
  }
  constexpr rt::Duration slack = std::chrono::seconds(1);  // for a port that was just opened to come up
  wait_until(
      *driver_, *interrupt_, [&] { return guards_->decided(); }, longest + slack);
  if (auto goes_on = not_ended(); !goes_on) return goes_on;
  return guards_->no_foreign_frames();
}

tl::expected<void, Failure> Strangers::not_ended() {
  if (!interrupt_->came()) return {};
  return tl::unexpected(failure(Exit::no, "ended before its work on a bus began"));
}

namespace {

rt::Task<void> ask_whether_masters(live::Census& census, live::CensusOptions options, bool& over) {
  const auto asked = co_await census.ask(options);
  static_cast<void>(asked);  // the session reports a port that sends no frames
  over = true;
}

// "another master: node 100, its 1F80h bit 0 is set": one line for each; empty when there is none.
std::vector<std::string> quiet_masters(const design::Bus& bus, const std::vector<places::SlotSpec>& specs,
                                       const live::Census& census) {
  std::vector<std::string> lines;
  for (const auto& node : census.nodes()) {
    const bool ours = std::ranges::find(specs, node.id, &places::SlotSpec::id) != specs.end();
    if (!node.nmt_master || ours) continue;
    lines.push_back(fmt::format(
        "bus {}: another master: node {}, its 1F80h bit 0 is set{}{}; it sent no command while Berth listened",
        bus.name, node.id.value(), node.network_list ? ", it has a network list (1F81h)" : "",
        node.device_type ? fmt::format(", its device type is {:08X}h", *node.device_type) : ""));
  }
  return lines;
}

// A slot without a type takes only the device at its node-ID.
bool takes(const places::SlotSpec& spec, const live::NodeSeen& node) {
  constexpr std::uint8_t any_type = 3;
  if (spec.asks.unasked == any_type) return spec.id == node.id;
  return node.identity && places::fits(spec, *node.identity);
}

// A node that no slot takes may be a master, even if only its heartbeat was heard. A node that is not operational and
// answers no SDO is a stopped device.
bool may_be_master(const live::NodeSeen& node, const std::vector<places::SlotSpec>& specs) {
  const bool told = node.identity || node.state == NmtState::operational;
  return node.beats > 0 && !node.nmt_master && told &&
         std::ranges::none_of(specs, [&](const auto& spec) { return takes(spec, node); });
}

std::string line_of(const design::Bus& bus, const live::NodeSeen& node) {
  std::string type = "reports no type";
  if (node.identity) {
    const auto& is = node.identity->address;
    type = fmt::format("vendor-ID {:08X}h, product code {:08X}h", is.vendor, is.product);
  }
  return fmt::format(
      "bus {}: node {} ({}{}{}) sends a heartbeat, and no slot of this machine takes its type: it may be "
      "the master of a plant that runs",
      bus.name, node.id.value(), type, node.state ? ", " : "", node.state ? name(*node.state) : "");
}

}  // namespace

void Strangers::ask_all(const design::Bus& bus, live::Census& census, bool first) {
  live::CensusOptions ask;
  ask.masters_only = true;
  ask.types = first;
  ask.own = bus.master;
  if (!first) {
    for (const auto& spec : session_->machine().specs(bus.name)) ask.known.push_back(spec.id);
  }
  bool over = false;
  rt::Scope scope(driver_->executor());
  scope.spawn(ask_whether_masters(census, ask, over));
  const auto& gate = *guards_->gate(bus.name);
  const auto ends = [&] { return over || gate.state() != live::GateState::open || guards_->dry_run_over(); };
  wait_until(*driver_, *interrupt_, ends, rt::Duration::max());
}

tl::expected<void, Failure> Strangers::ask(bool first) {
  std::vector<std::string> problem;
  const auto heard = std::exchange(heard_, {});
  for (const auto& bus : session_->machine().buses) {
    const auto census = heard.find(bus.name);
    if (bus.flying) continue;  // others may be master here
    if (census == heard.end() || guards_->gate(bus.name)->state() != live::GateState::open) continue;
    ask_all(bus, *census->second, first);
    const auto specs = session_->machine().specs(bus.name);
    std::ranges::move(quiet_masters(bus, specs, *census->second), std::back_inserter(problem));
    for (const auto& node : census->second->nodes()) {
      const bool suspect = first && node.id != bus.master && may_be_master(node, specs);
      if (suspect) may_be_masters_.push_back(line_of(bus, node));
    }
  }
  if (auto goes_on = not_ended(); !goes_on) return goes_on;
  if (problem.empty()) return guards_->no_foreign_frames();
  problem.emplace_back(
      "Berth does not become a second master on its bus. End that master; or use the bus as role = \"commissioner\" or "
      "\"observer\"; or, "
      "when "
      "it is a device of this machine, give it a slot");
  return tl::unexpected(failure_in_lines(Exit::no, problem));
}

}  // namespace berth::cli
