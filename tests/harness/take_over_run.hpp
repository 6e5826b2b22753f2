// Two Berths on one bus: the active one dies at a chosen point of its work, the standby finishes it, and then the first
// begins again and takes its role back. What must hold at the end, and on the way (docs/flying-master.md).
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "berth/harness/config_watch.hpp"
#include "berth/operate/programming.hpp"
#include "tests/harness/berths.hpp"
#include "tests/harness/mortal.hpp"
#include "tests/harness/program_watch.hpp"

namespace berth::harness {

class TakeOverRun final : private plant::World::Observer {
 public:
  // `older`, `wanted`: images of programs.
  TakeOverRun(const std::string& older, const std::string& wanted)
      : berths_(machine(wanted), plant(older), {0, 1}),
        programs_(berths_.world(), operate::load_program(wanted)->identification),
        pump_(manager::load_configuration(example_eds("pump.dcf")).configuration) {
    berths_.world().add_observer(*this);
    berths_.put_between([this](std::size_t i, can::Port& port) -> can::Port* {
      if (i != 0) return &port;
      mortal_ = std::make_unique<MortalPort>(axe_, port);
      return mortal_.get();
    });
  }
  ~TakeOverRun() {
    for (const std::size_t i : {0U, 1U}) {
      if (berths_.runs(i)) berths_.kill(i);
    }
    berths_.world().remove_observer(*this);
  }

  // Runs until everything is operational; the first Berth dies at its point `at`. Empty: all is well.
  std::string go(std::optional<std::uint64_t> at) {
    axe_.life(at);
    berths_.begin(0);
    berths_.begin(1);
    const auto first = [this] { return axe_.fallen() || (berths_.leads(0) && berths_.operational(0)); };
    if (!berths_.run_until(first, 60s)) return "the first one does not come to its end";
    trace_ = axe_.trace();
    if (!at) return judge(0);
    if (!axe_.fallen()) return "the point was not reached";
    berths_.kill(0);
    const auto standby = [this] { return berths_.leads(1) && berths_.operational(1); };
    if (!berths_.run_until(standby, 180s)) return "the standby does not finish it";
    std::string wrong = judge(1);
    if (!wrong.empty()) return "by the standby: " + wrong;
    const unsigned left = berths_.left_operational;
    axe_.life({});
    berths_.begin(0);
    const auto again = [this] { return berths_.leads(0) && berths_.operational(0); };
    if (!berths_.run_until(again, 180s)) return "the first one does not take its role back";
    wrong = judge(0);
    if (!wrong.empty()) return "when it is back: " + wrong;
    return berths_.left_operational == left ? std::string() : "a device left operational when the first one came back";
  }
  [[nodiscard]] const std::vector<PointKind>& trace() const noexcept { return trace_; }
  [[nodiscard]] std::string log() const { return berths_.log(); }

 private:
  static constexpr TypeCode type_controller{0x0000'0001, 0x0000'0060};

  static design::Machine machine(const std::string& wanted) {
    design::Machine m = one_bus(250'000);
    add_slot(m, 1, type_pump);
    m.slots.back().spec.config = example_eds("pump.dcf");
    add_slot(m, 2, type_controller);
    m.slots.back().spec.software.programs = {{.number = 1, .file = wanted, .identification = {}}};
    add_slot(m, 3, type_b);
    auto& t = m.buses.front().timing;
    t.heartbeat_period = 200ms;
    t.heartbeat_timeout = 500ms;
    t.probe_period = 400ms;
    return m;
  }
  static plant::PlantFile plant(const std::string& older) {
    plant::PlantFile p = one_bus_plant(7);
    add_device(p, "pump", type_pump, 0x11);
    auto& controller = add_device(p, "controller", type_controller, 0x22);
    auto& programs = controller.storing.programs;
    programs.count = 1;
    programs.size = programs.sector = 256;
    programs.erase = 4ms;
    programs.write = 20us;
    programs.loaded = programs.loaded_path = older;
    add_device(p, "sensor", type_b, 0x33);  // invalidates `controller`
    return p;
  }

  [[nodiscard]] std::string judge(std::size_t leads) {
    if (!failure_.empty()) return failure_;
    if (!programs_.failure().empty()) return programs_.failure();
    if (berths_.second_starts != 0) return "a device that ran was started again";
    if (!berths_.world().duplicates().empty()) return "two devices had one node-ID";
    unsigned id = 0;
    for (const auto& device : berths_.world().devices()) {
      const auto t = device->truth();
      ++id;
      if (t.active.value() != id) return t.name + " has node-ID " + std::to_string(t.active.value());
      if (t.state != NmtState::operational) return t.name + " is not operational";
    }
    const std::string wrong = programs_.check(*berths_.world().find("controller"));
    if (!wrong.empty()) return wrong;
    for (const auto& slot : berths_.network(leads).report()) {
      if (slot.state != places::SlotState::operational) return "slot " + slot.name + " is not operational";
    }
    return {};
  }
  // A running pump has its configuration.
  void plant_changed(const plant::SimDevice& device) noexcept override {
    const bool runs = device.powered() && device.device().state() == NmtState::operational;
    if (!runs || device.name() != "pump" || !failure_.empty()) return;
    const auto wrong = wrong_configuration(pump_, *berths_.world().find("pump"));
    if (!wrong.empty()) failure_ = "the pump was started, and " + wrong;
  }

  Axe axe_;
  std::unique_ptr<MortalPort> mortal_;
  Berths berths_;
  ProgramWatch programs_;
  manager::Configuration pump_;
  std::vector<PointKind> trace_;
  std::string failure_;
};

}  // namespace berth::harness
