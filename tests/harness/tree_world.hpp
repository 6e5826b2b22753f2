// One random machine of many buses from blank devices through troubles to its end (docs/faults.md): cables cut beside
// gateways, gateways and devices without power or reset, devices exchanged, frames lost, Berth killed. Requirements:
//   - no master of any bus makes two devices hold one node-ID (duplicate_watch.hpp), and two powered devices of a bus
//     never use one node-ID, unless one of them came with it by itself;
//   - nothing is reported about a slot that was not asked or heard of that slot (told_watch.hpp);
//   - when the troubles are over every slot has its device, alone under its node-ID and operational, by itself, and
//     every gateway has in its dictionary which bus beneath it is mandatory (5F00h);
//   - then a loss is reported once, for each slot that it takes away and for no other, and its end is reported once.
#pragma once

#include <fmt/format.h>

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "berth/multilevel/sub_bus.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/plant/world.hpp"
#include "berth/tree/session.hpp"
#include "tests/harness/duplicate_watch.hpp"
#include "tests/harness/mortal.hpp"
#include "tests/harness/told_watch.hpp"
#include "tests/harness/tree_mixture.hpp"

namespace berth::harness {

class TreeWorld final : private plant::World::Observer, private can::Tap {
 public:
  // `frames`: the log also has every frame of this bus.
  explicit TreeWorld(TreePlan plan, const std::string& frames = {})
      : plan_(std::move(plan)), random_(plan_.seed ^ 0x7EE5) {
    Findings findings;
    std::vector<plant::BusRate> rates;
    for (const auto* const bus : plan_.machine.all_buses()) rates.push_back({bus->name, bus->bitrate});
    world_ = plant::World::make(plan_.plant, rates, findings);
    for (const auto& finding : findings) failure_ += to_string(finding) + "\n";
    if (!world_) return;
    watch_ = std::make_unique<DuplicateWatch>(*world_, plan_.machine, &store_);
    told_watch_ = std::make_unique<ToldWatch>(*world_, plan_.machine);
    world_->add_observer(*this);
    tapped_ = world_->bus(frames);
    if (tapped_ != nullptr) tapped_->add_tap(*this);
    controller_ = world_->attach_master("backbone");
    world_->start();
  }
  ~TreeWorld() {
    end();
    heard_port_.reset();
    port_.reset();
    controller_.reset();
    watch_.reset();
    told_watch_.reset();
    if (tapped_ != nullptr) tapped_->remove_tap(*this);
    if (world_) world_->remove_observer(*this);
  }

  // Begins a Berth that knows only the store and the bus, as a new process would. It dies at point `k` of its port.
  // `instead`: what happens there instead.
  void begin(std::optional<std::uint64_t> k = {}, std::function<Axe::Instead()> instead = {}) {
    axe_.life(k, std::move(instead));
    watch_->berth_began();
    told_watch_->berth_began();
    port_ = std::make_unique<MortalPort>(axe_, *controller_);
    heard_port_ = std::make_unique<HeardPort>(*watch_, "backbone", *port_);
    session_ = std::make_unique<tree::Session>(world_->executor(), plan_.machine, store_);
    session_->on_event([this](const operate::Event& event) { take(event); });
    const bool opened = session_->connect("backbone", *heard_port_) && session_->open();
    if (!opened) failure_ += "the session cannot be opened\n";
    session_->start();
  }
  void end() { session_.reset(); }
  [[nodiscard]] bool runs() const noexcept { return session_ != nullptr; }
  // Points of Berth's port in this life.
  [[nodiscard]] std::size_t points() const noexcept { return axe_.trace().size(); }
  [[nodiscard]] const std::vector<PointKind>& trace() const noexcept { return axe_.trace(); }
  [[nodiscard]] bool died() const noexcept { return axe_.fallen(); }

  // From blank devices through so many troubles. Returns what is wrong at the end.
  [[nodiscard]] std::string go(int troubles) {
    if (!failure_.empty()) return failure_;
    begin();
    for (int step = 0; step < troubles; ++step) {
      run_for(std::chrono::milliseconds(random_.below(random_.below(2) == 0 ? 1000 : 15'000)));
      trouble();
    }
    mend();
    settle();
    if (failure_.empty()) lose_one();
    if (failure_.empty()) failure_ = wrong_mandatory();
    return failure_;
  }

  // Berth dies at point `k` while it brings the machine up, and another one continues.
  [[nodiscard]] std::string kill_at(std::uint64_t k) {
    if (!failure_.empty()) return failure_;
    begin(k);
    static_cast<void>(run_until([this] { return died() || all_good(); }, limit));
    static_cast<void>(run_until([this] { return died(); }, std::chrono::seconds(10)));
    if (!died()) return failure_ + "the point was not reached\n";
    end();
    begin();
    settle();
    return failure_;
  }

  // A device loses its power at point `k` of Berth's port while Berth brings the machine up, and gets it back.
  [[nodiscard]] std::string cut_power_at(std::uint64_t k, const std::string& name) {
    if (!failure_.empty()) return failure_;
    bool struck = false;
    auto* const device = world_->find(name);
    begin(k, [&] {
      struck = true;
      world_->sim().after({}, [this, device] {
        note("power off " + device->name());
        device->power(false);
      });
      world_->sim().after(std::chrono::milliseconds(1500), [device] { device->power(true); });
      return Axe::Instead::lives;
    });
    static_cast<void>(run_until([&] { return struck; }, limit));
    run_for(std::chrono::seconds(3));
    if (!struck) return failure_ + "the point was not reached\n";
    settle();
    return failure_;
  }

  // A device was removed for good while it was assigned its node-ID: its slot waits for it, and reports that. The user
  // brings it back, unless its master heard it under its node-ID while no other device used it (`is_confirmed`): that
  // one is given up. Beside another device its master may keep waiting. False: there is none.
  bool bring_back() {
    bool any = false;
    // Two devices that boot under one node-ID at the same instant send one frame together. Without another node there
    // is no acknowledgement, and they repeat it together forever; or they drive each other to bus-off, and stay there.
    for (const auto& device : world_->devices()) {
      const auto status = device->controller().status();
      if (!device->powered() || !(status.bus_off || status.tec > 127)) continue;
      note("cannot send, switched off and on: " + device->name());
      device->power(false);
      device->power(true);
    }
    for (const auto& spare : exchanged_) {
      const auto slots = session_->slots();
      const auto slot = std::ranges::find(slots, spare.worn, &operate::SlotReport::name);
      const bool waits = slot != slots.end() && slot->reason.find("may have node-ID") != std::string::npos;
      if (!waits || watch_->is_confirmed(spare.worn)) continue;
      note("bring back " + spare.worn);
      for (const auto& name : {spare.fresh, spare.second}) {
        if (!name.empty()) world_->find(name)->unplug();
      }
      world_->find(spare.worn)->plug();
      any = true;
    }
    return any;
  }

  // Everything becomes operational, and stays so. False: see `failure`.
  bool settle() {
    bool good = false;
    unsigned fell = 0;
    for (rt::Duration waited{}; waited < limit; waited += person) {
      good = run_until([this] { return all_good() || !failure_.empty(); }, person);
      if (good) run_for(std::chrono::seconds(10));
      // A spare that came with the node-ID runs under it until its master has searched the bus, and takes it away: for
      // the device that it waits for, or for the spare with the lower serial number. This may happen once, but not
      // twice.
      const bool brought = !all_good() && bring_back();
      if (good && !brought && (all_good() || ++fell > 1 || !plan_.mixed)) break;
    }
    if (all_good()) return failure_.empty();
    failure_ += good ? "it does not stay operational:\n" : "it does not become operational:\n";
    for (const auto& slot : session_->slots()) {
      if (slot.state != places::SlotState::operational)
        failure_ += fmt::format("  slot {}: {} ({})\n", slot.name, places::name(slot.state), slot.reason);
    }
    for (const auto& device : world_->devices()) {
      if (device->powered() && device->device().state() != NmtState::operational)
        failure_ += fmt::format("  device {} is {}\n", device->name(), name(device->device().state()));
      const auto status = device->controller().status();
      if (device->powered() && (status.error_passive() || status.bus_off))
        failure_ += fmt::format("  device {} is {}\n", device->name(), status.bus_off ? "bus-off" : "error-passive");
    }
    for (const auto& slot : plan_.machine.slots) failure_ += wrong_seat(slot);
    return false;
  }
  [[nodiscard]] const std::string& failure() const noexcept { return failure_; }
  [[nodiscard]] const std::string& log() const noexcept { return log_; }
  [[nodiscard]] plant::World& world() noexcept { return *world_; }
  [[nodiscard]] const TreePlan& plan() const noexcept { return plan_; }

 private:
  static constexpr rt::Duration limit = std::chrono::minutes(10);
  static constexpr rt::Duration person = std::chrono::minutes(1);  // how often the user looks

  void run_for(rt::Duration time) { world_->sim().run_for(time); }
  bool run_until(const std::function<bool()>& done, rt::Duration most) { return world_->sim().run_until(done, most); }
  [[nodiscard]] double seconds() const {
    return std::chrono::duration<double>(world_->executor().now().time_since_epoch()).count();
  }
  void note(const std::string& text) { log_ += fmt::format("{:12.6f} s  {}\n", seconds(), text); }

  void frame(const can::Frame& frame, rt::Time, int sender) noexcept override {
    note(fmt::format("{:>3} {}", sender, can::to_string(frame)));
  }
  void take(const operate::Event& event) {
    if (died()) return;  // its process is gone: nobody reads its reports
    log_ += operate::to_line(event) + "\n";
    if (event.kind == operate::EventKind::state) states_.emplace_back(event.slot, event.text);
    const std::string wrong = told_watch_->judge(event);
    if (!wrong.empty()) fail_with(fmt::format("{:.3f} s: {}", seconds(), wrong));
  }
  // Keeps the first failure: others may follow from it.
  void fail_with(const std::string& text) {
    if (failure_.empty()) failure_ = text;
  }

  void plant_changed(const plant::SimDevice&) noexcept override {
    if (!watch_->failure().empty()) fail_with(watch_->failure() + "\n");
    for (const auto& [one, other] : world_->duplicates()) {
      const auto pair = std::pair(one, other);
      if (watch_->came_by_itself(*one) || watch_->came_by_itself(*other)) continue;
      if (!told_.insert(pair).second) continue;
      failure_ += fmt::format("{:.3f} s: {} and {} both use node-ID {} on {}\n", seconds(), one->name(), other->name(),
                              one->truth().active.value(), one->truth().bus);
    }
  }

  // A gateway's own node beneath it is the NMT master there: whether it starts itself is not judged. Of two spares for
  // one slot one is left over.
  [[nodiscard]] bool all_good() const {
    const auto good = [&](const auto& slot) { return wrong_seat(slot).empty(); };
    return session_ && session_->operational() && std::ranges::all_of(plan_.machine.slots, good) && all_slots_run();
  }
  [[nodiscard]] std::string wrong_seat(const design::Slot& slot) const {
    std::vector<std::string> users;
    bool right = false;
    for (const auto& device : world_->devices()) {
      if (!device->powered() || device->bus().name() != slot.spec.name.bus) continue;
      if (device->device().node_id() != slot.spec.id) continue;
      users.push_back(device->name());
      const bool fits = device->truth().address.type() == slot.spec.type;
      right = fits && device->device().state() == NmtState::operational;
    }
    if (users.size() == 1 && right) return {};
    std::string text = fmt::format("  node-ID {} of slot {} is used by", slot.spec.id.value(), slot.spec.name.name);
    for (const auto& user : users) text += " " + user;
    return text + (users.empty() ? " no device\n" : "\n");
  }
  [[nodiscard]] std::string wrong_mandatory() const {
    std::string text;
    if (!plan_.mixed) return text;
    for (const auto& line : plan_.machine.beneath) {
      const auto& gateway = *line.gateway;
      for (const auto& device : world_->devices()) {
        const bool is_it = device->powered() && device->bus().name() == gateway.bus &&
                           device->device().node_id() == gateway.slot &&
                           plan_.plant.gateway_part(device->name()).ports != 0;
        if (!is_it || multilevel::is_mandatory(device->device().values(), gateway.port) == gateway.mandatory) continue;
        text += fmt::format("  5F00h:{:02X} of {} says that {} is {}\n", gateway.port, device->name(), line.name,
                            gateway.mandatory ? "optional" : "mandatory");
      }
    }
    return text;
  }
  [[nodiscard]] bool all_slots_run() const {
    return std::ranges::all_of(session_->slots(),
                               [](const auto& slot) { return slot.state == places::SlotState::operational; });
  }

  plant::SimDevice& any_device() {
    for (;;) {
      auto& device = *world_->devices()[random_.below(world_->devices().size())];
      if (!device.plan().does.master && device.plugged()) return device;
    }
  }
  const design::Bus& any_bus() {
    const auto all = plan_.machine.all_buses();
    return *all[random_.below(all.size())];
  }

  void trouble() {
    if (plan_.calm || (plan_.mixed && random_.below(4) == 0)) return exchange();
    switch (random_.below(8)) {
      case 0: return cut(any_bus());
      case 1: return join(any_bus().name);
      case 2:
      case 3: {
        auto& device = any_device();
        note(fmt::format("power {} {}", device.powered() ? "off" : "on", device.name()));
        return device.power(!device.powered());
      }
      case 4: {
        auto& device = any_device();
        note("reset " + device.name());
        if (device.powered()) device.reset();
        return;
      }
      case 5: return exchange();
      case 6: note(runs() ? "Berth dies" : "Berth begins"); return runs() ? end() : begin();
      default: return lose_frames(any_bus().name);
    }
  }

  // The master of the bus hears nothing: Berth's own cable is cut, or that of the gateway's port.
  void cut(const design::Bus& bus) {
    if (cut_.contains(bus.name)) return;
    plant::PlantEvent event;
    event.action = plant::Action::cut_cable;
    event.bus = bus.name;
    event.nodes = {bus.own_port ? "master" : bus.name + " port"};
    note("cut " + bus.name);
    if (world_->perform(event)) cut_.insert(bus.name);
  }
  void join(const std::string& bus) {
    if (cut_.erase(bus) == 0) return;
    plant::PlantEvent event;
    event.action = plant::Action::join;
    event.bus = bus;
    note("join " + bus);
    static_cast<void>(world_->perform(event));
  }

  // The worn device goes for good, unless its slot waits for it: then it is brought back at the end.
  void exchange() {
    if (plan_.spares.empty()) return;
    const auto at = plan_.spares.begin() + static_cast<std::ptrdiff_t>(random_.below(plan_.spares.size()));
    note("exchange " + at->worn);
    exchanged_.push_back(*at);
    world_->find(at->worn)->unplug();
    // At once, or when the worn device is missed.
    const auto pause = std::chrono::milliseconds(plan_.mixed ? random_.below(6000) : 0);
    bring(at->fresh, pause);
    if (!at->second.empty()) bring(at->second, pause + at->later);
    plan_.spares.erase(at);
  }
  void bring(const std::string& name, std::chrono::milliseconds later) {
    auto* const device = world_->find(name);
    if (later.count() == 0) return device->plug();
    world_->sim().after(later, [this, device] {
      note(fmt::format("plug {} with {}", device->name(), device->plan().node_id.value()));
      device->plug();
    });
  }

  void lose_frames(const std::string& bus) {
    const auto one_in_a_million = static_cast<std::uint32_t>(random_.below(2) * random_.below(2000));
    note(fmt::format("frames lost on {}: {} per million", bus, one_in_a_million));
    world_->bus(bus)->faults().draw_from(
        {.disturbed_per_million = one_in_a_million, .overrun_per_million = one_in_a_million / 2});
  }

  void mend() {
    note("the troubles are over");
    for (const auto* const bus : plan_.machine.all_buses()) {
      join(bus->name);
      world_->bus(bus->name)->faults().draw_from({});
    }
    for (const auto& device : world_->devices()) {
      if (device->plugged()) device->power(true);
    }
    if (!runs()) begin();
    if (plan_.mixed) run_for(std::chrono::seconds(12));  // spares that are on the way
  }

  // The slots that are lost with a device: its own, and all beneath it.
  [[nodiscard]] std::set<std::string> taken_by(const design::Slot& slot) const {
    std::set<std::string> names{slot.spec.name.name};
    std::vector<std::string> buses;
    const auto add = [&](std::string bus, NodeId gateway) {  // a copy: `buses` grows meanwhile
      for (const auto& line : plan_.machine.beneath) {
        const bool hangs_there = line.gateway->bus == bus && line.gateway->slot == gateway;
        if (hangs_there) buses.push_back(line.name);
      }
    };
    add(slot.spec.name.bus, slot.spec.id);
    for (std::size_t i = 0; i < buses.size(); ++i) {
      for (const auto& each : plan_.machine.slots) {
        if (each.spec.name.bus != buses[i]) continue;
        names.insert(each.spec.name.name);
        add(buses[i], each.spec.id);
      }
    }
    return names;
  }

  // How often each slot was reported in this state since then.
  [[nodiscard]] std::map<std::string, unsigned> told(std::string_view state) const {
    std::map<std::string, unsigned> count;
    for (const auto& [slot, text] : states_) {
      if (text.starts_with(state)) ++count[slot];
    }
    return count;
  }

  void judge_told(std::string_view state, const std::set<std::string>& whom) {
    const auto count = told(state);
    for (const auto& slot : whom) {
      const auto it = count.find(slot);
      const unsigned times = it == count.end() ? 0 : it->second;
      if (times != 1) failure_ += fmt::format("slot {} was told to be {} {} times\n", slot, state, times);
    }
    for (const auto& [slot, times] : count) {
      if (!whom.contains(slot)) failure_ += fmt::format("slot {} was told to be {}, and was not\n", slot, state);
    }
  }

  // The user removes devices without a slot: they would get the slot of a device that is without power.
  void clear_away() {
    for (const auto& device : world_->devices()) {
      const auto* const slot = plan_.machine.slot(device->bus().name(), device->device().node_id());
      if (device->plan().does.master || !device->powered() || slot != nullptr) continue;
      note("unplug " + device->name());
      device->unplug();
    }
  }

  // One device of any bus loses its power and gets it back.
  void lose_one() {
    if (plan_.mixed) clear_away();
    const auto& slot = plan_.machine.slots[random_.below(plan_.machine.slots.size())];
    plant::SimDevice* device = nullptr;
    for (const auto& each : world_->devices()) {
      const auto truth = each->truth();
      if (truth.powered && truth.bus == slot.spec.name.bus && truth.active == slot.spec.id) device = each.get();
    }
    if (device == nullptr) return;
    const auto whom = taken_by(slot);
    states_.clear();
    note("power off " + device->name());
    device->power(false);
    static_cast<void>(run_until([&] { return told("absent").size() >= whom.size(); }, std::chrono::minutes(2)));
    run_for(std::chrono::seconds(10));
    judge_told("absent", whom);
    states_.clear();
    note("power on " + device->name());
    device->power(true);
    settle();
    judge_told("operational", whom);
  }

  TreePlan plan_;
  Random random_;
  places::MemoryStore store_;
  Axe axe_;
  std::unique_ptr<plant::World> world_;
  std::unique_ptr<sim::Controller> controller_;
  std::unique_ptr<DuplicateWatch> watch_;
  std::unique_ptr<ToldWatch> told_watch_;
  std::unique_ptr<MortalPort> port_;
  std::unique_ptr<HeardPort> heard_port_;
  std::unique_ptr<tree::Session> session_;
  sim::Bus* tapped_ = nullptr;
  std::set<std::string> cut_;
  std::vector<TreePlan::Spare> exchanged_;
  std::set<std::pair<const plant::SimDevice*, const plant::SimDevice*>> told_;
  std::vector<std::pair<std::string, std::string>> states_;  // slot, words
  std::string failure_;
  std::string log_;
};

}  // namespace berth::harness
