#include "tests/conveyor/conveyor.hpp"

#include <algorithm>

#include "berth/design/machine.hpp"
#include "berth/od/names.hpp"
#include "berth/operate/slot_rows.hpp"
#include "tests/paths.hpp"

namespace berth::test {
namespace {

std::string all_of(const Findings& findings) {
  std::string text;
  for (const auto& each : findings) text += to_string(each) + "\n";
  return text;
}

std::string spare_of(const std::string& name) { return name + " spare"; }

}  // namespace

std::string conveyor_file(const std::string& name) { return source_dir() + "/examples/conveyor/" + name; }

const std::vector<std::string>& belts() {
  static const std::vector<std::string> names{"unloader",  "quay",    "tower 1", "yard",    "stacker",
                                              "reclaimer", "tower 2", "main",    "sampler", "bunker"};
  return names;
}

Conveyor::Conveyor(const Change& change) {
  auto machine = design::load_machine(conveyor_file("machine.toml"));
  auto plant = plant::load_plant(conveyor_file("plant.toml"));
  if (!machine.machine || !plant.plant) {
    problem_ = all_of(machine.findings) + all_of(plant.findings);
    return;
  }
  machine_ = std::move(*machine.machine);
  plant_ = std::move(*plant.plant);
  // On the shelf: one for each device, of the same make and with the same program.
  const auto devices = plant_.devices;
  for (auto spare : devices) {
    spare.name = spare_of(spare.name);
    spare.address.serial += 5000;
    spare.plugged = false;
    plant_.devices.push_back(std::move(spare));
  }
  if (change) change(machine_, plant_);
}

Conveyor::~Conveyor() {
  for (const auto* const each : {&standby_, &berth_}) {
    if (*each) (*each)->session->stop();
  }
  if (world_) world_->remove_observer(*this);
}

bool Conveyor::begin() {
  if (!problem_.empty()) return false;
  Findings findings;
  world_ = plant::World::make(plant_, std::vector<plant::BusRate>{{"field", machine_.buses.front().bitrate}}, findings);
  if (!world_) {
    problem_ = all_of(findings);
    return false;
  }
  world_->add_observer(*this);
  berth_ = make_berth(machine_);
  if (!berth_) return false;
  world_->start();
  berth_->session->start();
  return true;
}

std::unique_ptr<Conveyor::Berth> Conveyor::make_berth(design::Machine machine) {
  auto made = std::make_unique<Berth>();
  made->machine = std::move(machine);
  made->port = world_->attach_master("field");
  made->session = std::make_unique<tree::Session>(world_->executor(), made->machine, made->store);
  const auto links = traffic::plan_links(made->machine);
  if (has_errors(links.findings)) {
    problem_ = all_of(links.findings);
    return nullptr;
  }
  made->session->configure_with(traffic::settings_of(links));
  if (!made->session->connect("field", *made->port) || !made->session->open()) {
    problem_ = "the session cannot be opened";
    return nullptr;
  }
  made->session->on_milestone([](operate::Milestone) {});
  return made;
}

bool Conveyor::begin_standby() {
  auto machine = machine_;
  auto& bus = machine.buses.front();
  bus.master = NodeId(static_cast<std::uint8_t>(bus.master.value() - 1));
  bus.flying->priority = 2;
  standby_ = make_berth(std::move(machine));
  if (!standby_) return false;
  standby_->session->start();
  return true;
}

void Conveyor::kill_active() { berth_ = std::move(standby_); }

double Conveyor::seconds() const noexcept {
  return std::chrono::duration<double>(world_->executor().now().time_since_epoch()).count();
}

plant::SimDevice* Conveyor::at(const std::string& slot) {
  const auto* const place = machine_.slot(slot);
  if (place == nullptr) return nullptr;
  for (const auto& device : world_->devices()) {
    if (device->powered() && device->device().node_id() == place->spec.id) return device.get();
  }
  return nullptr;
}

std::optional<double> Conveyor::value(const std::string& slot, const std::string& object) {
  auto* const device = at(slot);
  if (device == nullptr) return std::nullopt;
  const auto& values = device->device().values();
  auto known = objects_.find({slot, object});
  if (known == objects_.end()) {
    const auto found = od::find_object(values.description(), object);
    if (!found) return std::nullopt;
    known = objects_.emplace(std::pair(slot, object), *found).first;
  }
  const auto* const sub = values.description().find(known->second);
  if (sub == nullptr) return std::nullopt;
  const auto bytes = values.bytes(known->second);
  const auto raw = od::load(sub->type, bytes.data());
  if (od::is_real(sub->type)) return od::real_of(sub->type, raw);
  return od::is_signed(sub->type) ? static_cast<double>(static_cast<std::int64_t>(raw)) : static_cast<double>(raw);
}

void Conveyor::replace(const std::string& slot) {
  auto* const old = at(slot);
  if (old != nullptr) old->unplug();
  if (auto* const fresh = world_->find(spare_of(slot))) fresh->plug();
}

void Conveyor::script_told(const plant::SimDevice& device, const script::Message& told) noexcept {
  told_.push_back(device.name() + ": " + to_string(told));
}

std::string Conveyor::log() {
  std::string text;
  for (const auto& each : berth_->session->report().events) text += operate::to_line(each) + "\n";
  for (const auto& line : operate::to_table(berth_->session->slots())) text += line + "\n";
  for (const auto& line : told_) text += line + "\n";
  return text;
}

}  // namespace berth::test
