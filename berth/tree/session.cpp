#include "berth/tree/session.hpp"
#include "berth/tree/channel_settings.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace berth::tree {

/// Tells the store the time of each line of its history.
class Session::StampedStore final : public places::SlotStore {
 public:
  StampedStore(rt::Executor& executor, places::SlotStore& store) noexcept : executor_(&executor), store_(&store) {}

  Result<places::SlotId> declare(const places::SlotName& name) override { return stamped().declare(name); }
  Result<std::vector<places::SlotRecord>> load(std::string_view machine) override { return store_->load(machine); }
  Result<places::SlotRecord> load(places::SlotId slot) override { return store_->load(slot); }
  Result<void> ask(places::SlotId slot, const places::Assignment& seat, std::string_view reason) override {
    return stamped().ask(slot, seat, reason);
  }
  Result<void> confirm(places::SlotId slot, const places::Assignment& seat, std::string_view reason) override {
    return stamped().confirm(slot, seat, reason);
  }
  Result<void> clear(places::SlotId slot, std::string_view reason) override { return stamped().clear(slot, reason); }
  Result<void> configure(places::SlotId slot, const places::Configured& configured, std::string_view reason) override {
    return stamped().configure(slot, configured, reason);
  }
  Result<void> ask_blank(const places::UnfinishedBlank& blank, std::string_view reason) override {
    return stamped().ask_blank(blank, reason);
  }
  Result<void> confirm_blank(const places::BusDevice& who, std::string_view reason) override {
    return stamped().confirm_blank(who, reason);
  }
  Result<void> drop_blank(const places::BusDevice& who, std::string_view reason) override {
    return stamped().drop_blank(who, reason);
  }
  Result<std::vector<places::UnfinishedBlank>> unfinished_blanks() override { return store_->unfinished_blanks(); }
  Result<void> mark(places::Mark mark, const places::BusDevice& who, NodeId id, std::string_view reason) override {
    return stamped().mark(mark, who, id, reason);
  }
  Result<void> unmark(places::Mark mark, const places::BusDevice& who, std::string_view reason) override {
    return stamped().unmark(mark, who, reason);
  }
  Result<std::vector<places::Marked>> marked(places::Mark mark) override { return store_->marked(mark); }
  Result<bool> is_marked(places::Mark mark, const places::BusDevice& who) override {
    return store_->is_marked(mark, who);
  }
  Result<void> lend(const places::LentId& lent) override { return store_->lend(lent); }
  Result<void> give_back(const places::BusDevice& who) override { return store_->give_back(who); }
  Result<std::vector<places::LentId>> lent() override { return store_->lent(); }
  Result<void> note(const places::HistoryEntry& entry) override { return stamped().note(entry); }
  Result<std::vector<places::HistoryEntry>> history_of(const places::BusDevice& who) override {
    return store_->history_of(who);
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
    : executor_(&executor),
      machine_(&machine),
      store_(std::make_unique<StampedStore>(executor, store)),
      tree_(executor, machine, networks_) {}

Session::~Session() {
  stop();
  tree_.clear();
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
