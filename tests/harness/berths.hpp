/// Several Berths on one simulated bus (docs/flying-master.md): which of them works, what each sent, and whether a
/// running device was started again.
#pragma once

#include <fmt/format.h>

#include <map>
#include <optional>
#include <set>
#include <string>

#include "tests/harness/rig.hpp"

namespace berth::harness {

// One bus, its devices, and Berths, each with its own slot table.
class Berths : private can::Tap, private plant::World::Observer {
 public:
  // Without `flying`: one Berth, the only master of its bus.
  Berths(const design::Machine& machine, const plant::PlantFile& file, const std::vector<std::uint8_t>& priorities,
         bool flying = true) {
    Findings findings;
    const std::vector<plant::BusRate> rates{{"backbone", machine.buses[0].bitrate}};
    world_ = plant::World::make(file, rates, findings);
    world_->bus("backbone")->add_tap(*this);
    world_->add_observer(*this);
    for (std::size_t i = 0; i < priorities.size(); ++i) {
      auto& one = *berths_.emplace_back(std::make_unique<One>());
      one.machine = machine;
      one.machine.buses[0].master = NodeId(static_cast<std::uint8_t>(127 - i));
      if (flying) one.machine.buses[0].flying = design::FlyingBus{priorities[i], {}};
    }
    world_->start();
  }
  ~Berths() {
    for (auto& one : berths_) kill(*one);
    world_->bus("backbone")->remove_tap(*this);
    world_->remove_observer(*this);
  }

  // The next `begin` of this Berth reads it.
  [[nodiscard]] design::Machine& machine(std::size_t i) { return berths_[i]->machine; }

  // A layer between a Berth and its controller, from its next `begin` on; it must exist until that Berth is killed.
  using Between = std::function<can::Port*(std::size_t, can::Port&)>;
  void put_between(Between between) { between_ = std::move(between); }

  // The settings that the machine's links need in the slots' devices, from the next `begin` on.
  void settle(manager::SlotSettings settings) { settings_ = std::move(settings); }

  void begin(std::size_t i) {
    One& one = *berths_[i];
    one.port = world_->attach_master("backbone");
    operate::NetworkObserver observer;
    observer.event = [&one](const operate::Event& event) { one.lines.push_back(operate::to_line(event)); };
    can::Port& port = between_ ? *between_(i, *one.port) : *one.port;
    one.network = std::make_unique<operate::Network>(world_->executor(), port, one.machine.name, one.machine.buses[0],
                                                     one.machine.specs("backbone"), one.store, observer);
    if (!one.network->open(settings_)) std::abort();
    one.network->start();
  }
  // Ends this Berth at once, as a crash does.
  void kill(std::size_t i) { kill(*berths_[i]); }
  [[nodiscard]] bool runs(std::size_t i) const { return berths_[i]->network != nullptr; }
  // This Berth, and every second device, on one side; the rest on the other.
  void cut(std::size_t i) {
    std::vector<sim::Controller*> side;
    if (berths_[i]->port) side.push_back(berths_[i]->port.get());
    for (std::size_t k = 0; k < world_->devices().size(); k += 2) {
      side.push_back(&world_->devices()[k]->controller());
    }
    world_->bus("backbone")->split(side);
    for (const auto* controller : side) side_.insert(controller->number());
  }
  // This device on one side, the rest on the other.
  void cut_off(plant::SimDevice& device) {
    std::vector<sim::Controller*> side{&device.controller()};
    world_->bus("backbone")->split(side);
    side_ = {device.controller().number()};
  }
  void join() {
    world_->bus("backbone")->join();
    side_.clear();
  }
  [[nodiscard]] bool leads(std::size_t i) const {
    if (!berths_[i]->machine.buses[0].flying) return runs(i);
    const auto master = berths_[i]->network ? berths_[i]->network->services().master : std::nullopt;
    return master && master->here;
  }
  [[nodiscard]] const sim::Controller& controller(std::size_t i) const { return *berths_[i]->port; }
  [[nodiscard]] operate::Network& network(std::size_t i) { return *berths_[i]->network; }
  [[nodiscard]] bool operational(std::size_t i) const {
    return berths_[i]->network->operational() && berths_[i]->network->idle();
  }
  [[nodiscard]] std::size_t count() const noexcept { return berths_.size(); }
  bool run_until(const std::function<bool()>& done, rt::Duration limit = 120s) {
    return world_->sim().run_until(done, limit);
  }
  void run_for(rt::Duration time) { world_->sim().run_for(time); }
  // Frames of this Berth's controller, by identifier, since `forget`.
  [[nodiscard]] std::map<std::uint32_t, unsigned> sent_by(std::size_t i) const {
    const auto found = sent_.find(berths_[i]->port ? berths_[i]->port->number() : -1);
    return found == sent_.end() ? std::map<std::uint32_t, unsigned>{} : found->second;
  }
  void forget() {
    sent_.clear();
    commands.clear();
  }
  std::vector<std::string> commands;  // NMT
  [[nodiscard]] std::string log() const {
    std::string text = started_again_;
    for (const auto& one : berths_) {
      text += "---\n";
      for (const auto& line : one->lines) text += line + "\n";
    }
    return text;
  }
  [[nodiscard]] plant::World& world() { return *world_; }
  unsigned second_starts = 0;
  unsigned left_operational = 0;

 private:
  struct One {
    design::Machine machine;
    places::MemoryStore store;
    std::unique_ptr<sim::Controller> port;
    std::unique_ptr<operate::Network> network;
    std::vector<std::string> lines;
  };
  [[nodiscard]] static double seconds(rt::Time time) {
    return std::chrono::duration<double>(time.time_since_epoch()).count();
  }
  static void kill(One& one) {
    one.network.reset();
    one.port.reset();
  }
  void frame(const can::Frame& frame, rt::Time at, int sender) noexcept override {
    const rt::Time before = std::exchange(last_frame_, at);
    ++sent_[sender][frame.key()];
    if (frame.key() == 0) commands.push_back(can::to_string(frame));
    const bool start = frame.key() == 0 && frame.size == 2 && frame.data[0] == 1;
    if (!start) return;
    // After two parts of a bus are joined there are two active masters until one hears the other, and both may be about
    // to start a device (docs/flying-master.md, "What remains possible"): only such starts are not counted.
    std::size_t leading = 0;
    for (std::size_t i = 0; i < berths_.size(); ++i) leading += leads(i) ? 1U : 0U;
    if (leading > 1) return;
    for (const auto& device : world_->devices()) {
      const auto since = runs_since_[device.get()];
      const auto id = device->device().node_id();
      const bool hears = side_.contains(sender) == side_.contains(device->controller().number());
      const bool meant = hears && id.configured() && (frame.data[1] == 0 || frame.data[1] == id.value());
      // Only this frame was on the bus since: its sender saw an error in the frame's last bit and repeats it. A device
      // that started meanwhile did so by the first transmission.
      const bool by_this_frame = since && *since > before;
      if (!meant || !since || by_this_frame || !alone(*device)) continue;
      ++second_starts;
      started_again_ +=
          fmt::format("{:.3f} s: {} (node-ID {}), operational since {:.3f} s, is started by controller {}\n",
                      seconds(at), device->name(), id.value(), seconds(*since), sender);
    }
  }
  // A command to another device under the same node-ID, which got the slot while this one was away, does not count.
  [[nodiscard]] bool alone(const plant::SimDevice& device) const {
    return std::ranges::none_of(world_->devices(), [&](const auto& other) {
      return other.get() != &device && other->powered() && other->device().node_id() == device.device().node_id();
    });
  }
  void plant_changed(const plant::SimDevice& device) noexcept override {
    auto& since = runs_since_[&device];
    const bool runs = device.powered() && device.device().state() == NmtState::operational;
    if (since && !runs) ++left_operational;
    if (!runs) since.reset();
    if (runs && !since) since = world_->executor().now();
  }

  rt::Time last_frame_{};
  std::unique_ptr<plant::World> world_;
  Between between_;
  manager::SlotSettings settings_;
  std::vector<std::unique_ptr<One>> berths_;
  std::map<int, std::map<std::uint32_t, unsigned>> sent_;
  std::string started_again_;  // for the log
  std::set<int> side_;         // of a cut bus; frames of the other side are not heard here
  std::map<const plant::SimDevice*, std::optional<rt::Time>> runs_since_;
};

}  // namespace berth::harness
