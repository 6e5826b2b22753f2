#include "tests/harvester/harvester.hpp"

#include <algorithm>

#include "berth/design/machine.hpp"
#include "berth/operate/slot_rows.hpp"
#include "tests/paths.hpp"

namespace berth::test {
namespace {

std::string words_of(const Findings& findings) {
  std::string text;
  for (const auto& each : findings) text += to_string(each) + "\n";
  return text;
}

}  // namespace

std::string harvester_file(const std::string& name) { return source_dir() + "/examples/harvester/" + name; }

Harvester::Harvester(const Change& change) {
  auto machine = design::load_machine(harvester_file("machine.toml"));
  auto plant = plant::load_plant(harvester_file("plant.toml"));
  if (!machine.machine || !plant.plant) {
    problem_ = words_of(machine.findings) + words_of(plant.findings);
    return;
  }
  machine_ = std::move(*machine.machine);
  plant_ = std::move(*plant.plant);
  if (change) change(machine_, plant_);
}

Harvester::~Harvester() {
  session_.reset();
  ports_.clear();
  if (world_ && watch_) world_->remove_observer(*watch_);
}

bool Harvester::begin() {
  if (!problem_.empty()) return false;
  Findings findings;
  std::vector<plant::BusRate> rates;
  for (const auto* const buses : {&machine_.buses, &machine_.beneath}) {
    for (const auto& bus : *buses) rates.push_back({bus.name, bus.bitrate});
  }
  world_ = plant::World::make(plant_, rates, findings);
  if (!world_) {
    problem_ = words_of(findings);
    return false;
  }
  watch_ = std::make_unique<Watch>(times_, *world_);
  world_->add_observer(*watch_);
  for (const auto& bus : machine_.buses) ports_.push_back(world_->attach_master(bus.name));
  world_->start();
  return attach();
}

bool Harvester::attach() {
  session_ = std::make_unique<tree::Session>(world_->executor(), machine_, store_);
  for (std::size_t i = 0; i < ports_.size(); ++i) {
    if (!session_->connect(machine_.buses[i].name, *ports_[i])) return false;
  }
  if (!session_->open()) {
    problem_ = "the session cannot be opened";
    return false;
  }
  session_->start();
  return true;
}

bool Harvester::begin_again() {
  session_.reset();
  return attach();
}

bool Harvester::all_run() const {
  return std::ranges::all_of(world_->devices(), [](const auto& device) {
    return !device->powered() || device->truth().state == NmtState::operational;
  });
}

double Harvester::seconds() const noexcept {
  return std::chrono::duration<double>(world_->executor().now().time_since_epoch()).count();
}

rt::Time Harvester::operational_at(const std::string& device) const {
  const auto it = times_.find(device);
  return it == times_.end() ? rt::never : it->second;
}

places::SlotState Harvester::state(const std::string& slot) const {
  const auto slots = session_->slots();
  const auto it = std::ranges::find(slots, slot, &operate::SlotReport::name);
  return it == slots.end() ? places::SlotState::unknown : it->state;
}

std::vector<std::string> Harvester::told(const std::string& slot, rt::Time since) const {
  std::vector<std::string> lines;
  for (const auto& event : session_->report().events) {
    if (event.slot == slot && event.at >= since) lines.push_back(event.text);
  }
  return lines;
}

std::string Harvester::log() const {
  std::string text;
  for (const auto& each : session_->report().events) text += operate::to_line(each) + "\n";
  for (const auto& line : operate::to_table(session_->slots())) text += line + "\n";
  return text;
}

void Harvester::Watch::plant_changed(const plant::SimDevice& device) noexcept {
  if (device.device().state() != NmtState::operational) return;
  times.try_emplace(device.name(), world.executor().now());
}

}  // namespace berth::test
