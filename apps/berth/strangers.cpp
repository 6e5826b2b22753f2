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
  constexpr rt::Duration slack = std::chrono::seconds(1);  // a port that was just opened comes up
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
  static_cast<void>(asked);  // a port that takes no frame is the session's to report
  over = true;
}

}  // namespace

// "another master: node 100, its 1F80h bit 0 is set": one line for each; empty when there is none.
std::vector<std::string> Strangers::quiet_masters(const design::Bus& bus, live::Census& census) {
  live::CensusOptions ask;
  ask.masters_only = true;
  ask.own = bus.master;
  for (const auto& spec : session_->machine().specs(bus.name)) ask.known.push_back(spec.id);
  bool over = false;
  {
    rt::Scope scope(driver_->executor());
    scope.spawn(ask_whether_masters(census, ask, over));
    const auto& gate = *guards_->gate(bus.name);
    const auto ends = [&] { return over || gate.state() != live::GateState::open || guards_->dry_run_over(); };
    wait_until(*driver_, *interrupt_, ends, rt::Duration::max());
  }
  std::vector<std::string> lines;
  for (const auto& node : census.nodes()) {
    if (!node.nmt_master) continue;
    lines.push_back(fmt::format(
        "bus {}: another master: node {}, its 1F80h bit 0 is set{}{}; it sent no command while Berth listened",
        bus.name, node.id.value(), node.network_list ? ", it has a network list (1F81h)" : "",
        node.device_type ? fmt::format(", its device type is {:08X}h", *node.device_type) : ""));
  }
  return lines;
}

tl::expected<void, Failure> Strangers::ask() {
  std::vector<std::string> problem;
  const auto heard = std::exchange(heard_, {});
  for (const auto& bus : session_->machine().buses) {
    const auto census = heard.find(bus.name);
    if (bus.flying) continue;  // others may be master here
    if (census == heard.end() || guards_->gate(bus.name)->state() != live::GateState::open) continue;
    std::ranges::copy(quiet_masters(bus, *census->second), std::back_inserter(problem));
  }
  if (auto goes_on = not_ended(); !goes_on) return goes_on;
  if (problem.empty()) return guards_->no_foreign_frames();
  problem.emplace_back(
      "Berth does not take its bus. End that master; or use the bus as role = \"commissioner\" or \"observer\"; or, "
      "when "
      "it is a device of this machine, give it a slot");
  return tl::unexpected(failure_in_lines(Exit::no, problem));
}

}  // namespace berth::cli
