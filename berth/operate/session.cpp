#include "berth/operate/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <span>

#include "berth/text/quantity.hpp"

namespace berth::operate {

/// Tells the store the time of each line of its history.
class Session::StampedStore final : public places::SlotStore {
 public:
  StampedStore(rt::Executor& executor, places::SlotStore& store) noexcept : executor_(&executor), store_(&store) {}

  Result<places::SlotId> declare(const places::SlotName& name) override { return stamped().declare(name); }
  Result<std::vector<places::SlotRecord>> load(std::string_view machine) override { return store_->load(machine); }
  Result<places::SlotRecord> load(places::SlotId slot) override { return store_->load(slot); }
  Result<void> ask(places::SlotId slot, const places::Seat& seat, std::string_view reason) override {
    return stamped().ask(slot, seat, reason);
  }
  Result<void> confirm(places::SlotId slot, const places::Seat& seat, std::string_view reason) override {
    return stamped().confirm(slot, seat, reason);
  }
  Result<void> clear(places::SlotId slot, std::string_view reason) override { return stamped().clear(slot, reason); }
  Result<void> configure(places::SlotId slot, const places::Configured& configured, std::string_view reason) override {
    return stamped().configure(slot, configured, reason);
  }
  Result<void> ask_blank(const places::UnfinishedBlank& blank, std::string_view reason) override {
    return stamped().ask_blank(blank, reason);
  }
  Result<void> confirm_blank(const LssAddress& device, std::string_view reason) override {
    return stamped().confirm_blank(device, reason);
  }
  Result<void> drop_blank(const LssAddress& device, std::string_view reason) override {
    return stamped().drop_blank(device, reason);
  }
  Result<std::vector<places::UnfinishedBlank>> unfinished_blanks() override { return store_->unfinished_blanks(); }
  Result<void> mark(places::Mark mark, const LssAddress& device, NodeId id, std::string_view reason) override {
    return stamped().mark(mark, device, id, reason);
  }
  Result<void> unmark(places::Mark mark, const LssAddress& device, std::string_view reason) override {
    return stamped().unmark(mark, device, reason);
  }
  Result<std::vector<places::Marked>> marked(places::Mark mark) override { return store_->marked(mark); }
  Result<bool> is_marked(places::Mark mark, const LssAddress& device) override {
    return store_->is_marked(mark, device);
  }
  Result<void> lend(const places::LentId& lent) override { return store_->lend(lent); }
  Result<void> give_back(const LssAddress& device) override { return store_->give_back(device); }
  Result<std::vector<places::LentId>> lent() override { return store_->lent(); }
  Result<void> note(const places::HistoryEntry& entry) override { return stamped().note(entry); }
  Result<std::vector<places::HistoryEntry>> history_of(const LssAddress& device) override {
    return store_->history_of(device);
  }
  Result<std::vector<places::HistoryEntry>> history(std::optional<places::SlotId> slot) override {
    return store_->history(slot);
  }
  void stamp(std::int64_t now_ms) noexcept override { store_->stamp(now_ms); }

 private:
  places::SlotStore& stamped() noexcept {
    const auto now = executor_->now().time_since_epoch();
    store_->stamp(std::chrono::duration_cast<std::chrono::milliseconds>(now).count());
    return *store_;
  }
  rt::Executor* executor_;
  places::SlotStore* store_;
};

Session::Session(rt::Executor& executor, const design::Machine& machine, places::SlotStore& store)
    : executor_(&executor), machine_(&machine), store_(std::make_unique<StampedStore>(executor, store)) {}

Session::~Session() {
  stop();
  beneath_.clear();
  trees_.clear();
}

places::SlotStore& Session::store() noexcept { return *store_; }

Result<void> Session::connect(std::string_view bus, can::Port& port) {
  const design::Bus* const known = machine_->bus(bus);
  if (known == nullptr) return fail(Errc::not_found, "the machine has no bus of this name");
  const bool connected = std::ranges::find(ports_, known, &decltype(ports_)::value_type::first) != ports_.end();
  if (connected) return fail(Errc::duplicate, "this bus has its port already");
  ports_.emplace_back(known, &port);
  return {};
}

Result<void> Session::open() {
  if (!networks_.empty()) return fail(Errc::invalid, "the session is open already");
  if (ports_.size() != machine_->buses.size()) return fail(Errc::invalid, "a bus of the machine has no port");
  NetworkObserver observer;
  observer.event = [this](const Event& event) { record(event); };
  observer.milestone = [this](Milestone milestone) { reached(milestone); };
  for (const auto& bus : machine_->buses) {
    observer.command = [this, name = bus.name](std::string text, NetworkObserver::Confirm confirm) {
      return on_command_ && on_command_(name, std::move(text), std::move(confirm));
    };
    observer.beneath = beneath_of(bus.name);
    const auto port = std::ranges::find(ports_, &bus, &decltype(ports_)::value_type::first);
    auto network =
        std::make_unique<Network>(*executor_, *port->second, bus, machine_->specs(bus.name), *store_, observer);
    const auto opened = network->open(settings_);
    if (!opened) return opened;
    networks_.push_back(std::move(network));
  }
  return open_beneath(observer);
}

// ---- buses beneath gateways ----

Result<void> Session::open_beneath(const NetworkObserver& observer) {
  for (const auto& bus : machine_->beneath) {
    Way way = way_to(*machine_, bus.name);
    Network* const top = network(way.bus);
    if (top == nullptr) return fail(Errc::invalid, "a bus beneath a gateway leads to no bus with a port");
    NetworkObserver own;
    own.event = observer.event;
    beneath_.push_back(
        std::make_unique<Beneath>(*executor_, bus, way, machine_->specs(bus.name), routes(*top), std::move(own)));
    Tree& tree = *trees_[top];
    if (!tree.log) {
      tree.log = std::make_unique<multilevel::EventLog>(top->services().dispatcher,
                                                        multilevel::EmcyLayout::source_and_exit);
      tree.log->hear_all();
      tree.log->on_event([this, name = way.bus](const multilevel::LoggedEmcy& entry) { heard(name, entry); });
    }
    Beneath* const above = beneath(bus.gateway->bus);
    if (above != nullptr) above->add(*beneath_.back());
    if (above != nullptr) continue;
    beneath_.back()->on_operational([top, gateway = bus.gateway->slot] { top->try_again(gateway); });
  }
  return {};
}

void Session::heard(const std::string& bus, const multilevel::LoggedEmcy& entry) {
  const auto& path = entry.reading.path;
  if (path.size() < 2 || entry.reading.garbled) return;
  for (auto& each : beneath_) {
    const auto& hops = each->way().gateways;
    const auto leads = [&] {
      return std::ranges::equal(hops, std::span(path).first(hops.size()), {}, &multilevel::Hop::gateway);
    };
    if (each->way().bus == bus && hops.size() + 1 == path.size() && leads()) return each->heard(path.back(), entry);
  }
}

BeneathFirst Session::beneath_of(const std::string& bus) {
  BeneathFirst first;
  for (const auto* const buses : {&machine_->buses, &machine_->beneath}) {
    for (const auto& each : *buses) {
      if (each.gateway && each.gateway->bus == bus) first.gateways.set(each.gateway->slot.value());
    }
  }
  if (first.gateways.any()) first.bring_up = [this, bus](NodeId gateway) { return beneath_first(bus, gateway); };
  return first;
}

// All of one gateway, one after the other: they share its SDO server.
rt::Task<Result<void>> Session::beneath_first(std::string bus, NodeId gateway) {
  Result<void> all;
  for (auto& each : beneath_) {
    const auto& way = *each->bus().gateway;
    if (way.bus != bus || way.slot != gateway) continue;
    const auto done = co_await each->bring_up();
    if (!done && way.mandatory && all) all = done;
  }
  for (auto& each : networks_) {
    const auto& way = each->bus().gateway;
    if (!way || way->bus != bus || way->slot != gateway || !way->mandatory) continue;
    const auto done = co_await await_network(*each);
    if (!done && all) all = done;
  }
  co_return all;
}

// A bus beneath the gateway on which Berth has a port of its own.
rt::Task<Result<void>> Session::await_network(Network& network) {
  const rt::Duration boot_time = network.bus().startup.boot_time;
  const rt::Time deadline = executor_->now() + (boot_time.count() > 0 ? boot_time : Beneath::patience);
  while (!network.operational() && executor_->now() < deadline) co_await rt::sleep_for(std::chrono::milliseconds(50));
  if (network.operational()) co_return Result<void>{};
  co_return fail(Errc::mismatch, "a bus beneath it is not operational: its slots say why");
}

multilevel::Routes& Session::routes(Network& network) {
  auto& tree = trees_[&network];
  if (!tree) tree = std::make_unique<Tree>(network);
  return tree->routes;
}

Beneath* Session::beneath(std::string_view bus) noexcept {
  const auto it = std::ranges::find_if(beneath_, [&](const auto& b) { return b->bus().name == bus; });
  return it == beneath_.end() ? nullptr : it->get();
}

void Session::start() {
  if (started_) return;
  started_ = true;
  began_ = executor_->now();
  for (auto& network : networks_) network->start();
  for (auto& each : beneath_) each->start();
}

void Session::stop() noexcept {
  for (auto& network : networks_) network->stop();
  for (auto& each : beneath_) each->stop();
  started_ = false;
}

void Session::tell(std::string_view bus, EventKind kind, std::string text) {
  record({executor_->now(), std::string(bus), kind, {}, std::move(text)});
}

void Session::record(const Event& event) {
  if (events_.size() == most_events) events_.pop_front();
  events_.push_back(event);
  if (on_event_) on_event_(event);
}

void Session::reached(Milestone milestone) {
  auto& buses = reached_[static_cast<std::size_t>(milestone)];
  if (++buses == networks_.size() && on_milestone_) on_milestone_(milestone);
}

std::vector<SlotReport> Session::slots() const {
  std::vector<SlotReport> all;
  for (const auto& network : networks_) {
    auto slots = network->report();
    std::ranges::move(slots, std::back_inserter(all));
  }
  for (const auto& each : beneath_) {
    auto slots = each->report();
    std::ranges::move(slots, std::back_inserter(all));
  }
  return all;
}

Report Session::report() const {
  Report report;
  report.slots = slots();
  const double elapsed = seconds(executor_->now()) - seconds(began_);
  for (const auto& network : networks_) report.bus_time_s.emplace_back(network->bus().name, elapsed);
  report.events.assign(events_.begin(), events_.end());
  for (const auto& network : networks_) {
    if (const auto& master = network->services().master) report.masters.push_back(*master);
    auto questions = network->planning().question_events();
    std::ranges::move(questions, std::back_inserter(report.questions));
  }
  return report;
}

bool Session::operational() const noexcept {
  return std::ranges::all_of(networks_, [](const auto& n) { return n->operational(); }) &&
         std::ranges::all_of(beneath_,
                             [](const auto& b) { return b->operational() || !b->bus().gateway->mandatory; });
}

bool Session::idle() const noexcept {
  return std::ranges::all_of(networks_, [](const auto& n) { return n->idle(); }) &&
         std::ranges::all_of(beneath_, [](const auto& b) { return b->idle(); });
}

Network* Session::network(std::string_view bus) noexcept {
  if (bus.empty()) return networks_.size() == 1 ? networks_.front().get() : nullptr;
  const auto it = std::ranges::find_if(networks_, [&](const auto& n) { return n->bus().name == bus; });
  return it == networks_.end() ? nullptr : it->get();
}

Network* Session::network_of_slot(std::string_view slot, std::string& name) noexcept {
  auto meant = machine_->slots_named({}, slot);
  const auto number = text::parse_ranges(slot, 1, 127);
  if (meant.empty() && number && number->size() == 1) {
    for (const auto& s : machine_->slots) {
      if (s.spec.id.value() == number->front()) meant.push_back(&s);
    }
  }
  if (meant.size() != 1) return nullptr;
  name = meant.front()->spec.name.name;
  return network(meant.front()->spec.name.bus);
}

}  // namespace berth::operate
