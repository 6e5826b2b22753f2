#include "berth/tree/session.hpp"
#include "berth/tree/channel_settings.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace berth::tree {

Session::Session(rt::Executor& executor, const design::Machine& machine, places::SlotStore& store)
    : executor_(&executor), machine_(&machine), store_(&store), clock_(executor), tree_(executor, machine, networks_) {
  store.set_clock(&clock_);
}

Session::~Session() {
  stop();
  tree_.clear();
  if (store_->clock() != &clock_) return;
  store_->stamp(clock_.now_ms());
  store_->set_clock(nullptr);
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

bool Session::configures(const design::Slot& slot) const {
  const bool said = !slot.spec.config.empty() || settings_.contains(slot.spec.name.name) ||
                    is_gateway(*machine_, slot) || has_channels(*machine_, slot);
  return said || std::ranges::any_of(networks_, [&slot](const auto& network) {
           return network->bus().name == slot.spec.name.bus && operate::is_configured(*network, slot.spec.name.name);
         });
}

Result<void> Session::open() {
  if (!networks_.empty()) return fail(Errc::invalid, "the session is open already");
  if (ports_.size() != machine_->buses.size()) return fail(Errc::invalid, "a bus of the machine has no port");
  operate::NetworkObserver observer;
  observer.event = [this](const operate::Event& event) { record(event); };
  observer.milestone = [this](operate::Milestone milestone) {
    auto& buses = reached_[static_cast<std::size_t>(milestone)];
    if (++buses == networks_.size() && on_milestone_) on_milestone_(milestone);
  };
  for (const auto& bus : machine_->buses) {
    observer.command = [this, name = bus.name](std::string text, operate::NetworkObserver::Confirm confirm) {
      return on_command_ && on_command_(name, std::move(text), std::move(confirm));
    };
    observer.beneath = tree_.first_of(bus.name);
    const auto port = std::ranges::find(ports_, &bus, &decltype(ports_)::value_type::first);
    auto network = std::make_unique<operate::Network>(*executor_, *port->second, machine_->name, bus,
                                                      machine_->specs(bus.name), *store_, observer);
    operate::SlotDescriptions descriptions;
    for (const auto& slot : machine_->slots) {
      if (slot.spec.name.bus == bus.name && !slot.eds_path.empty())
        descriptions.emplace(slot.spec.name.name, slot.eds_path);
    }
    const auto opened = network->open(with_channels(*machine_, bus.name, with_gateways(*machine_, bus.name, settings_)),
                                      descriptions, operate::WrittenFiles(written_));
    if (!opened) return opened;
    networks_.push_back(std::move(network));
  }
  return tree_.open(observer.event, settings_);
}

void Session::start() {
  if (started_) return;
  started_ = true;
  began_ = executor_->now();
  for (auto& network : networks_) network->start();
  tree_.start();
}

void Session::stop() noexcept {
  for (auto& network : networks_) network->stop();
  tree_.stop();
  started_ = false;
}

void Session::tell(std::string_view bus, operate::EventKind kind, std::string text) {
  record({executor_->now(), std::string(bus), kind, {}, std::move(text)});
}

void Session::record(const operate::Event& event) {
  if (events_.size() == most_events) events_.pop_front();
  events_.push_back(event);
  if (on_event_) on_event_(event);
}

std::vector<operate::SlotReport> Session::slots() const {
  std::vector<operate::SlotReport> all;
  all.reserve(machine_->slots.size());
  for (const auto& network : networks_) {
    auto slots = network->report();
    std::ranges::move(slots, std::back_inserter(all));
  }
  for (const auto& each : tree_.buses()) {
    auto slots = each->report();
    std::ranges::move(slots, std::back_inserter(all));
  }
  return all;
}

operate::Report Session::take_report() {
  auto events = std::exchange(events_, {});
  operate::Report last = report();
  last.events = std::move(events);
  return last;
}

operate::Report Session::report() const {
  operate::Report report;
  report.slots = slots();
  const double elapsed = operate::seconds(executor_->now()) - operate::seconds(began_);
  for (const auto& network : networks_) report.bus_time_s.emplace_back(network->bus().name, elapsed);
  report.events = events_;
  report.questions = questions_of(*this);
  for (const auto& network : networks_) {
    if (const auto& master = network->services().master) report.masters.push_back(*master);
  }
  return report;
}

std::vector<operate::Event> questions_of(const Session& session) {
  std::vector<operate::Event> all;
  for (const auto& network : session.networks()) {
    auto questions = network->planning().question_events();
    std::ranges::move(questions, std::back_inserter(all));
  }
  return all;
}

bool Session::operational() const noexcept {
  return std::ranges::all_of(networks_, [](const auto& n) { return n->operational(); }) && tree_.operational();
}

bool Session::idle() const noexcept {
  return std::ranges::all_of(networks_, [](const auto& n) { return n->idle(); }) && tree_.idle();
}

operate::Network* Session::network(std::string_view bus) noexcept {
  if (bus.empty()) return networks_.size() == 1 ? networks_.front().get() : nullptr;
  const auto it = std::ranges::find_if(networks_, [&](const auto& n) { return n->bus().name == bus; });
  return it == networks_.end() ? nullptr : it->get();
}

}  // namespace berth::tree
