#include "guards.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace berth::cli {

can::Port& Guards::add(rt::Executor& executor, const design::Bus& bus, can::Port& port, const Options& options) {
  executor_ = &executor;
  live::GateOptions wanted;
  const bool observes = options.outside.observe || bus.role == live::Role::observer;
  // To read a node beneath gateways, Berth needs more than SDO uploads from the gateway, which is all that a reader
  // may.
  const bool reads = options.outside.read_only && machine_->beneath.empty();
  wanted.role = observes ? live::Role::observer : reads ? live::Role::reader : bus.role;
  wanted.listen = bus.timing.listen;
  wanted.watch.own = bus.master;
  wanted.watch.tolerated = bus.tolerate;
  if (bus.flying && options.master.takes_part) {
    // The masters themselves agree on which of them is active. Another node with Berth's own node-ID is still a
    // problem.
    wanted.watch.tolerated.set();
    wanted.watch.tolerated.reset(static_cast<std::size_t>(live::Sign::heartbeat));
  }
  wanted.dry_run = options.dry_run;
  for (const auto& spec : machine_->specs(bus.name)) wanted.slots.push_back(spec.id);
  auto gate = std::make_unique<live::Gate>(executor, port, std::move(wanted));
  gate->on_change([this, name = bus.name, raw = gate.get()] { changed(name, *raw); });
  gate->clients().on_first([this, name = bus.name](NodeId node, const can::Frame& request) {
    if (!on_client_) return;
    on_client_(name,
               fmt::format("another SDO client asks node {} ({}). Berth goes on; it asks that node nothing until the "
                           "client has been silent for {:g} s. When it is one of the machine's own, write tolerate "
                           "= [\"sdo\"] into the bus",
                           node.value(), can::to_string(request),
                           std::chrono::duration<double>(live::OtherClients::pause).count()));
  });
  if (options.dry_run) {
    gate->on_held([this, name = bus.name](const can::Frame& frame, rt::Time at) {
      record_->frame(name, frame, at, true);
      if (live::expects_answer(frame)) question_at_ = std::min(question_at_, at);
    });
  } else if (!options.files.record.empty() || options.master.takes_part) {  // `berth trace` may join a `berth up`
    gate->on_frame(
        [this, name = bus.name](const can::Frame& frame, rt::Time at, bool own) {
          record_->frame(name, frame, at, own);
        },
        [this, name = bus.name](const can::Frame& report, rt::Time at) { record_->error(name, report, at, {}); });
  }
  return *gates_.emplace_back(bus.name, std::move(gate)).second;
}

void Guards::changed(const std::string& bus, const live::Gate& gate) {
  if (!on_foreign_ || gate.state() != live::GateState::foreign) return;
  const auto report = gate.report();
  constexpr const char* cure = "end that master, then restart Berth";
  on_foreign_(bus, fmt::format("{}; {}", report.front(), cure),
              fmt::format("{}. Berth writes nothing more on this bus; {}", fmt::join(report, "; "), cure));
}

live::Gate* Guards::gate(std::string_view bus) noexcept {
  const auto gate = std::ranges::find(gates_, bus, [](const auto& g) { return std::string_view(g.first); });
  return gate == gates_.end() ? nullptr : gate->second.get();
}

bool Guards::decided() const noexcept {
  return std::ranges::all_of(gates_, [](const auto& g) { return g.second->decided(); });
}

tl::expected<void, Failure> Guards::no_foreign_frames() const {
  std::vector<std::string> problem;
  for (const auto& [bus, gate] : gates_) {
    if (gate->state() != live::GateState::foreign) continue;
    const auto report = gate->report();
    problem.push_back(fmt::format("bus {}: {}", bus, report.front()));
    for (auto line = report.begin() + 1; line != report.end(); ++line) problem.push_back("    " + *line);
  }
  if (problem.empty()) return {};
  problem.emplace_back(
      "Berth sends nothing there. End that master; or have its network written as a machine file by `berth adopt`; or "
      "use the bus as role = \"commissioner\" or \"observer\"; or, when "
      "the machine's own devices send these frames, say so by tolerate = […]");
  return tl::unexpected(failure_in_lines(Exit::no, problem));
}

bool Guards::shut_out() const noexcept {
  return !gates_.empty() && gates_.size() == machine_->buses.size() &&
         std::ranges::all_of(gates_, [](const auto& g) { return g.second->state() == live::GateState::foreign; });
}

bool Guards::dry_run_over() const noexcept {
  constexpr rt::Duration patience = std::chrono::milliseconds(900);  // for frames sent along with the first question
  return question_at_ != rt::never && executor_->now() >= question_at_ + patience;
}

}  // namespace berth::cli
