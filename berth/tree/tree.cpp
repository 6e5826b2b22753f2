#include "berth/tree/tree.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bitset>
#include <optional>
#include <span>

#include "berth/decode/emcy_words.hpp"
#include "berth/tree/channel_settings.hpp"
#include "berth/tree/gateway_settings.hpp"

namespace berth::tree {
namespace {

/// The number of gateways from this bus down to that one; 0: it is not beneath.
std::size_t levels_between(const design::Machine& machine, const std::string& top, const design::Bus& bus) {
  std::size_t levels = 0;
  for (const design::Bus* at = &bus; at != nullptr && at->name != top; at = machine.bus(at->gateway->bus)) {
    if (!at->gateway) return 0;
    ++levels;
  }
  return levels;
}

// Profiles use the same codes for different errors, so the producer's profile decides (paper 3 Figure 10).
const char* words(std::uint16_t code, std::uint16_t profile) {
  const char* const own = multilevel::gateway_code_text(code);
  return own != nullptr ? own : decode::emcy_words(code, profile);
}

bool is_communication(const multilevel::EmcyReading& reading) noexcept {
  const std::uint16_t code = reading.code != 0 ? reading.code : reading.exiting;
  return code >> 8U == co::emcy_code::id_collision >> 8U;
}

multilevel::GatewayTimes gateway_times(const design::Machine& machine, const std::string& top) {
  multilevel::GatewayTimes times;
  std::optional<rt::Duration> slowest;
  for (const auto* const bus : machine.all_buses()) {
    const std::size_t levels = levels_between(machine, top, *bus);
    if (levels == 0) continue;
    times.levels = std::max(times.levels, levels);
    slowest = std::max<rt::Duration>(slowest.value_or(bus->gateway->timeout), bus->gateway->timeout);
  }
  times.timeout = slowest.value_or(times.timeout);
  return times;
}

std::bitset<128> gateways_on(const design::Machine& machine, const std::string& bus) noexcept {
  std::bitset<128> gateways;
  for (const auto* const lines : {&machine.buses, &machine.beneath}) {
    for (const auto& each : *lines) {
      if (each.gateway && each.gateway->bus == bus) gateways.set(each.gateway->slot.value());
    }
  }
  return gateways;
}

// For a bus beneath a gateway on which Berth has a port of its own.
rt::Task<Result<void>> await_operational(rt::Executor& executor, operate::Network& network) {
  const rt::Duration boot_time = network.bus().startup.boot_time;
  const rt::Time deadline = executor.now() + (boot_time.count() > 0 ? boot_time : Beneath::patience);
  while (!network.operational() && executor.now() < deadline) co_await rt::sleep_for(std::chrono::milliseconds(50));
  if (network.operational()) co_return Result<void>{};
  co_return fail(Errc::mismatch, "a bus beneath it is not operational: see its slots");
}

}  // namespace

Result<void> Tree::open(const std::function<void(const operate::Event&)>& events,
                        const manager::SlotSettings& settings) {
  events_ = events;
  for (const auto& line : machine_->beneath) {
    Way way = way_to(*machine_, line.name);
    operate::Network* const top = network(way.bus);
    if (top == nullptr) {
      return fail(Errc::invalid,
                  "a bus beneath a gateway is to be reached through a bus that is not opened: open that one too");
    }
    operate::NetworkObserver observer;
    observer.event = events;
    buses_.push_back(
        std::make_unique<Beneath>(*executor_, line, way, machine_->specs(line.name),
                                  with_channels(*machine_, line.name, with_gateways(*machine_, line.name, settings)),
                                  routes(*top), std::move(observer)));
    Root& root = *roots_[top];
    if (!root.log) {
      root.log = std::make_unique<multilevel::EventLog>(top->services().dispatcher, layout_of(*machine_, way.bus));
      root.log->hear_all();
      root.log->on_event([this, name = way.bus](const multilevel::LoggedEmcy& entry) { heard(name, entry); });
    }
    auto& made = *buses_.back();
    made.on_still_runs([this, &made](NodeId node) { still_runs(made, node); });
    Beneath* const above = bus(line.gateway->bus);
    const NodeId gateway_slot = line.gateway->slot;
    const auto runs = [gateway_slot](const std::vector<operate::SlotReport>& slots) {
      const auto slot = std::ranges::find(slots, gateway_slot, &operate::SlotReport::id);
      return slot != slots.end() && slot->state == places::SlotState::operational;
    };
    if (above != nullptr) {
      above->add({*line.gateway, [&made] { return made.bring_up(); }, [&made] { return made.operational(); }});
      made.know_gateway([above, runs] { return runs(above->report()); });
    } else {
      made.know_gateway([top, runs] { return runs(top->report()); },
                        [top, gateway_slot] { top->try_again(gateway_slot); });
    }
  }
  for (const auto& each : *networks_) {
    const auto& gateway = each->bus().gateway;
    Beneath* const above = gateway ? bus(gateway->bus) : nullptr;
    if (above == nullptr) continue;
    above->add({*gateway, [this, deeper = each.get()] { return await_operational(*executor_, *deeper); },
                [deeper = each.get()] { return deeper->operational(); }});
  }
  return {};
}

// Reports the EMCY only if it is certain which slot it is about; asks the states of the others.
void Tree::heard(const std::string& name, const multilevel::LoggedEmcy& entry) {
  constexpr auto loss = co::emcy_code::life_guard_or_heartbeat;
  const auto& reading = entry.reading;
  // Another device's bytes are manufacturer-specific, even if they look like node-IDs; its own bus reports it.
  if (!gateways_on(*machine_, name)[reading.path.front().value()]) return;
  const EmcyOrigins origins = origins_of(*machine_, name, layout_of(*machine_, name), reading);
  const bool lost = reading.code == loss;
  const auto ask = [&](const std::vector<const design::Slot*>& slots) {
    for (const auto* const slot : slots) bus(slot->spec.name.bus)->ask(slot->spec.id, lost);
  };
  ask(origins.named);
  // A node beneath another is asked when that one runs (`still_runs`): nothing answers through a lost gateway.
  if (origins.named.empty()) ask(origins.beneath);
  if (reading.code == multilevel::gateway_code::mandatory_bus_failed) note_stopping(name, reading, origins);
  if (reading.path.size() < 2 || reading.garbled) return;
  if (!lost && reading.exiting != loss) tell(name, entry, origins);
}

// A gateway stops itself (paper 3 Figure 1). The last named node is the one that failed; if the gateway names none, the
// gateway itself.
void Tree::note_stopping(const std::string& name, const multilevel::EmcyReading& reading, const EmcyOrigins& origins) {
  for (const auto* const slot : origins.named) {
    bus(slot->spec.name.bus)->stops_itself(slot->spec.id);
    const auto& gateway = *bus(slot->spec.name.bus)->bus().gateway;
    if (Beneath* const above = bus(gateway.bus)) above->stops_itself(gateway.slot);
  }
  operate::Network* const top = network(name);
  const bool may_be_on_top = reading.path.size() <= 2 && resets_.running() == 0;
  if (may_be_on_top && top->services().may_command()) resets_.spawn(reset_stopped(*top, reading.path.front()));
}

// A stopped gateway forwards nothing. After a reset it boots like any other; it is started when the bus beneath it
// runs.
rt::Task<void> Tree::reset_stopped(operate::Network& network, NodeId gateway) {
  auto& services = network.services();
  co_await rt::sleep_for(2 * services.bus.timing.heartbeat_period);
  if (services.heartbeats.state(gateway) != NmtState::stopped) co_return;
  events_({executor_->now(),
           network.bus().name,
           operate::EventKind::step,
           {},
           fmt::format("gateway {} has stopped itself, because a mandatory bus beneath it failed: it is reset",
                       gateway.value())});
  const auto sent = co_await services.nmt.send(co::NmtCommand::reset_communication, gateway);
  static_cast<void>(sent);
}

void Tree::tell(const std::string& name, const multilevel::LoggedEmcy& entry, const EmcyOrigins& origins) {
  auto possible = origins.named;
  if (origins.may_be_deeper) possible.insert(possible.end(), origins.beneath.begin(), origins.beneath.end());
  multilevel::LoggedEmcy told = entry;
  if (possible.size() == 1) {
    const auto& spec = possible.front()->spec;
    told.profile = bus(spec.name.bus)->slots().at(spec.id)->profile;
  }
  const std::string text = "EMCY " + multilevel::text(told, words);
  if (possible.size() == 1) {
    const auto& spec = possible.front()->spec;
    Beneath& line = *bus(spec.name.bus);
    // Two devices with one node-ID report that, and the damaged frames, again and again.
    const bool known = line.slots().at(spec.id)->doubled && is_communication(entry.reading);
    if (!known) line.slots().events().tell(operate::EventKind::emcy, spec.name.name, text);
    // A gateway without a layout reports EMCYs from beneath as its own.
    const bool its_own = origins.beneath.empty();
    if (its_own && entry.reading.code == co::emcy_code::id_collision) line.collided(spec.id);
    return;
  }
  std::string whose;
  for (const auto* const slot : possible) whose += (whose.empty() ? "" : " or ") + path_of(*slot);
  if (!whose.empty()) whose = fmt::format(" (of {}: it does not say which)", whose);
  events_({executor_->now(), name, operate::EventKind::emcy, {}, text + whose});
}

std::string Tree::path_of(const design::Slot& slot) const {
  const auto way = way_to(*machine_, slot.spec.name.bus);
  return fmt::format("{} {}", multilevel::to_string(multilevel::Path{way.gateways, slot.spec.id}), slot.spec.name.name);
}

// A loss of this slot's node was reported, but the node is there: a gateway may have reported a loss beneath it as its
// own.
void Tree::still_runs(const Beneath& above, NodeId gateway) {
  for (const auto& each : buses_) {
    const auto& line = *each->bus().gateway;
    if (line.bus == above.bus().name && line.slot == gateway) each->ask_all();
  }
}

operate::BeneathFirst Tree::first_of(const std::string& bus) {
  operate::BeneathFirst first;
  first.gateways = gateways_on(*machine_, bus);
  if (first.gateways.none()) return first;
  first.hands_on = [this, bus](NodeId gateway, const co::Emcy& message) {
    if (!gateways_on(*machine_, bus)[gateway.value()]) return false;
    const auto reading = multilevel::read_emcy(layout_of(*machine_, bus), gateway, message);
    return reading.path.size() > 1 && !reading.garbled;
  };
  first.bring_up = [this, bus](NodeId gateway) { return bring_up(bus, gateway); };
  return first;
}

// Brings up all buses of one gateway in turn: they share its SDO server.
rt::Task<Result<void>> Tree::bring_up(std::string bus, NodeId gateway) {
  Result<void> all;
  const auto is_beneath = [&](const design::Bus& line) {
    return line.gateway && line.gateway->bus == bus && line.gateway->slot == gateway;
  };
  for (const auto& each : buses_) {
    if (!is_beneath(each->bus())) continue;
    const auto done = co_await each->bring_up();
    if (!done && each->bus().gateway->mandatory && all) all = done;
  }
  for (const auto& each : *networks_) {
    if (!is_beneath(each->bus()) || !each->bus().gateway->mandatory) continue;
    const auto done = co_await await_operational(*executor_, *each);
    if (!done && all) all = done;
  }
  co_return all;
}

void Tree::start() {
  for (auto& each : buses_) each->start();
}

void Tree::stop() noexcept {
  resets_.cancel();
  for (auto& each : buses_) each->stop();
}

void Tree::clear() noexcept {
  buses_.clear();
  roots_.clear();
}

multilevel::Routes& Tree::routes(operate::Network& network) {
  auto& root = roots_[&network];
  if (!root) root = std::make_unique<Root>(network, gateway_times(*machine_, network.bus().name));
  return root->routes;
}

Beneath* Tree::bus(std::string_view name) const noexcept {
  const auto it = std::ranges::find_if(buses_, [&](const auto& b) { return b->bus().name == name; });
  return it == buses_.end() ? nullptr : it->get();
}

operate::Network* Tree::network(std::string_view name) const noexcept {
  const auto it = std::ranges::find_if(*networks_, [&](const auto& n) { return n->bus().name == name; });
  return it == networks_->end() ? nullptr : it->get();
}

bool Tree::operational() const noexcept {
  return std::ranges::all_of(buses_, [](const auto& b) { return b->operational() || !b->bus().gateway->mandatory; });
}

bool Tree::idle() const noexcept {
  return std::ranges::all_of(buses_, [](const auto& b) { return b->idle(); });
}

}  // namespace berth::tree
