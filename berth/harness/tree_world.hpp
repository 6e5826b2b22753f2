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

#include "berth/harness/axe.hpp"
#include "berth/harness/duplicate_watch.hpp"
#include "berth/harness/states_told.hpp"
#include "berth/harness/told_watch.hpp"
#include "berth/harness/tree_facts.hpp"
#include "berth/harness/tree_mixture.hpp"
#include "berth/harness/tree_troubles.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/plant/world.hpp"
#include "berth/tree/session.hpp"

namespace berth::harness {

// How many troubles a random tree has.
inline constexpr int troubles_of_a_tree = 8;

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
    facts_ = std::make_unique<TreeFacts>(plan_, *world_);
    troubles_ = std::make_unique<TreeTroubles>(
        plan_, *world_, random_,
        [this] {
          note(runs() ? "Berth dies" : "Berth begins");
          runs() ? end() : begin();
        },
        [this](const std::string& text) { note(text); });
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
    session_->on_milestone([this](operate::Milestone m) {
      if (m == operate::Milestone::operational && !first_operational_)
        first_operational_ = world_->executor().now().time_since_epoch();
    });
    const bool opened = session_->connect("backbone", *heard_port_) && session_->open();
    if (!opened) failure_ += "the session cannot be opened\n";
    session_->start();
  }
  void end() { session_.reset(); }
  [[nodiscard]] bool runs() const noexcept { return session_ != nullptr; }
  // Points of Berth's port in this life.
  [[nodiscard]] const std::vector<PointKind>& trace() const noexcept { return axe_.trace(); }
  [[nodiscard]] bool died() const noexcept { return axe_.fallen(); }

  // From blank devices through so many troubles. Returns what is wrong at the end.
  [[nodiscard]] std::string go(int troubles) {
    if (!failure_.empty()) return failure_;
    begin();
    for (int step = 0; step < troubles; ++step) {
      run_for(std::chrono::milliseconds(random_.below(random_.below(2) == 0 ? 1000 : 15'000)));
      troubles_->trouble();
    }
    note("the troubles are over");
    troubles_->mend();
    if (!runs()) begin();
    if (plan_.mixed) run_for(std::chrono::seconds(12));  // spares that are on the way
    settle();
    if (failure_.empty()) lose_one();
    if (failure_.empty()) failure_ = facts_->wrong_mandatory();
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
    for (const auto& spare : troubles_->exchanged()) {
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
    for (const auto& slot : plan_.machine.slots) failure_ += facts_->wrong_seat(slot);
    return false;
  }
  [[nodiscard]] const std::string& failure() const noexcept { return failure_; }
  // Bus time at which Berth told for the first time that all is operational.
  [[nodiscard]] std::optional<rt::Duration> first_operational() const noexcept { return first_operational_; }
  [[nodiscard]] const std::string& log() const noexcept { return log_; }
  // False: its plant is wrong, and nothing runs; `failure` says why.
  [[nodiscard]] bool made() const noexcept { return world_ != nullptr; }
  [[nodiscard]] plant::World& world() noexcept { return *world_; }

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
    states_.take(event);
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
    const auto runs = [](const auto& slot) { return slot.state == places::SlotState::operational; };
    return session_ && session_->operational() && facts_->all_seats_are_right() &&
           std::ranges::all_of(session_->slots(), runs);
  }
  // One device of any bus loses its power and gets it back.
  void lose_one() {
    if (plan_.mixed) troubles_->clear_away();
    const auto& slot = plan_.machine.slots[random_.below(plan_.machine.slots.size())];
    plant::SimDevice* device = nullptr;
    for (const auto& each : world_->devices()) {
      const auto truth = each->truth();
      if (truth.powered && truth.bus == slot.spec.name.bus && truth.active == slot.spec.id) device = each.get();
    }
    if (device == nullptr) return;
    const auto whom = facts_->taken_by(slot);
    states_.clear();
    note("power off " + device->name());
    device->power(false);
    static_cast<void>(run_until([&] { return states_.told("absent").size() >= whom.size(); }, std::chrono::minutes(2)));
    run_for(std::chrono::seconds(10));
    failure_ += states_.judge("absent", whom);
    states_.clear();
    note("power on " + device->name());
    device->power(true);
    settle();
    failure_ += states_.judge("operational", whom);
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
  std::unique_ptr<TreeFacts> facts_;
  std::unique_ptr<TreeTroubles> troubles_;
  std::set<std::pair<const plant::SimDevice*, const plant::SimDevice*>> told_;
  StatesTold states_;
  std::optional<rt::Duration> first_operational_;
  std::string failure_;
  std::string log_;
};

}  // namespace berth::harness
