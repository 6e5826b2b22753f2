#include "berth/tree/tree.hpp"

#include <algorithm>
#include <optional>
#include <span>

namespace berth::tree {
namespace {

/// Gateways from this bus down to that one; none: it is not beneath.
std::size_t levels_between(const design::Machine& machine, const std::string& top, const design::Bus& bus) {
  std::size_t levels = 0;
  for (const design::Bus* at = &bus; at != nullptr && at->name != top; at = machine.bus(at->gateway->bus)) {
    if (!at->gateway) return 0;
    ++levels;
  }
  return levels;
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

// A bus beneath a gateway on which Berth has a port of its own.
rt::Task<Result<void>> await_operational(rt::Executor& executor, operate::Network& network) {
  const rt::Duration boot_time = network.bus().startup.boot_time;
  const rt::Time deadline = executor.now() + (boot_time.count() > 0 ? boot_time : Beneath::patience);
  while (!network.operational() && executor.now() < deadline) co_await rt::sleep_for(std::chrono::milliseconds(50));
  if (network.operational()) co_return Result<void>{};
  co_return fail(Errc::mismatch, "a bus beneath it is not operational: its slots say why");
}

}  // namespace

Result<void> Tree::open(const std::function<void(const operate::Event&)>& events,
                        const operate::SlotSettings& settings) {
  for (const auto& line : machine_->beneath) {
    Way way = way_to(*machine_, line.name);
    operate::Network* const top = network(way.bus);
    if (top == nullptr) {
      return fail(Errc::invalid,
                  "a bus beneath a gateway is to be reached through a bus that is not opened: open that one too");
    }
    operate::NetworkObserver observer;
    observer.event = events;
    buses_.push_back(std::make_unique<Beneath>(*executor_, line, way, machine_->specs(line.name), settings,
                                               routes(*top), std::move(observer)));
    Root& root = *roots_[top];
    if (!root.log) {
      constexpr auto layout = multilevel::EmcyLayout::source_and_exit;
      root.log = std::make_unique<multilevel::EventLog>(top->services().dispatcher, layout);
      root.log->hear_all();
      root.log->on_event([this, name = way.bus](const multilevel::LoggedEmcy& entry) { heard(name, entry); });
    }
    Beneath* const above = bus(line.gateway->bus);
    const NodeId gateway_slot = line.gateway->slot;
    const auto runs = [gateway_slot](const std::vector<operate::SlotReport>& slots) {
      const auto slot = std::ranges::find(slots, gateway_slot, &operate::SlotReport::id);
      return slot != slots.end() && slot->state == places::SlotState::operational;
    };
    if (above != nullptr) {
      above->add({*line.gateway, [deeper = buses_.back().get()] { return deeper->bring_up(); }});
      buses_.back()->know_gateway([above, runs] { return runs(above->report()); });
    } else {
      buses_.back()->know_gateway([top, runs] { return runs(top->report()); },
                                  [top, gateway_slot] { top->try_again(gateway_slot); });
    }
  }
  for (const auto& each : *networks_) {
    const auto& gateway = each->bus().gateway;
    Beneath* const above = gateway ? bus(gateway->bus) : nullptr;
    if (above == nullptr) continue;
    above->add({*gateway, [this, deeper = each.get()] { return await_operational(*executor_, *deeper); }});
  }
  return {};
}

void Tree::heard(const std::string& name, const multilevel::LoggedEmcy& entry) {
  const auto& path = entry.reading.path;
  if (path.size() < 2 || entry.reading.garbled) return;
  for (auto& each : buses_) {
    const auto& hops = each->way().gateways;
    if (each->way().bus != name || hops.size() + 1 != path.size()) continue;
    const auto gateways = std::span(path).first(hops.size());
    if (std::ranges::equal(hops, gateways, {}, &multilevel::Hop::gateway)) return each->heard(path.back(), entry);
  }
}

operate::BeneathFirst Tree::first_of(const std::string& bus) {
  operate::BeneathFirst first;
  for (const auto* const lines : {&machine_->buses, &machine_->beneath}) {
    for (const auto& each : *lines) {
      if (each.gateway && each.gateway->bus == bus) first.gateways.set(each.gateway->slot.value());
    }
  }
  if (first.gateways.any()) first.bring_up = [this, bus](NodeId gateway) { return bring_up(bus, gateway); };
  return first;
}

// All of one gateway, one after the other: they share its SDO server.
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
