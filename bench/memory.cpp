// Memory of a device: dictionary and services; and of a simulated one, with its controller, host and flash.
#include <malloc.h>

#include <array>
#include <filesystem>
#include <vector>

#include "bench/tools/figures.hpp"
#include "bench/tools/world.hpp"
#include "berth/device/device.hpp"
#include "berth/eds/eds.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

constexpr double first_aim = 24'000;
constexpr double further_aim = 6000;
constexpr unsigned further = 100;

double heap() { return static_cast<double>(::mallinfo2().uordblks); }

/// Hears nothing and is always ready: a device's memory is not its controller's.
class Silence final : public can::Port {
 public:
  can::Queued send(const can::Frame&, std::uint32_t) noexcept override { return can::Queued::yes; }
  void withdraw(std::uint32_t) noexcept override {}
  void listen(can::Listener*, std::span<const can::IdRange>) noexcept override {}
  [[nodiscard]] can::Status status() const noexcept override { return {.up = true}; }
  bool restart(std::uint32_t) noexcept override { return true; }
};

/// A device as a maker has it: dispatcher, dictionary, services. Operational.
struct Node {
  Node(rt::Executor& executor, can::Port& port, std::shared_ptr<const od::Description> description,
       device::NvMemory& memory)
      : dispatcher(executor, port), device(dispatcher, std::move(description), &memory, {.node_id = NodeId(5)}) {
    device.power_on();
    executor.advance(executor.now() + 1s);
    device.apply(co::NmtCommand::start);
    executor.advance(executor.now() + 1s);
  }
  can::Dispatcher dispatcher;
  device::Device device;
};

/// What the description, and then each further device of the type, takes.
void add_device(std::vector<bench::Figure>& figures, const std::string& name, const std::string& eds) {
  rt::Executor executor;
  Silence port;
  std::vector<std::unique_ptr<device::SimFlash>> flash;
  for (unsigned i = 0; i <= further; ++i) flash.push_back(std::make_unique<device::SimFlash>(executor, 65536, 1ms));
  std::vector<std::unique_ptr<Node>> nodes;
  nodes.reserve(1 + further);
  const double before = heap();
  auto description = eds.empty() ? device::minimal_description() : eds::read_file(eds).file.description;
  nodes.push_back(std::make_unique<Node>(executor, port, description, *flash[0]));
  const double first = heap() - before;
  for (unsigned i = 1; i <= further; ++i) {
    nodes.push_back(std::make_unique<Node>(executor, port, description, *flash[i]));
  }
  const double more = (heap() - before - first) / further;
  figures.push_back(bench::at_most(name + ", first device", first, first_aim, "bytes"));
  figures.push_back(bench::at_most(name + ", each further", more, further_aim, "bytes"));
}

/// The same in a plant: with controller, slow host and flash of the simulation.
void add_simulated(std::vector<bench::Figure>& figures, const std::string& name, const std::string& eds) {
  const auto world_of = [&eds](unsigned count) {
    auto plant = bench::plant_of(count, false, 500us);
    unsigned id = 1;
    for (auto& device : plant.devices) {
      device.eds = eds;
      device.eds_path = eds;
      device.source = plant::NodeIdSource::hard_coded;
      device.node_id = NodeId(static_cast<std::uint8_t>(id++));
    }
    auto world = bench::start(plant, 1'000'000);
    world->sim().run_for(200ms);
    return world;
  };
  const double before = heap();
  const auto one = world_of(1);
  const double first = heap() - before;
  const auto many = world_of(1 + further);
  const double more = (heap() - before - 2 * first) / further;
  figures.push_back({name + ", simulated: each further", bench::grouped(more) + " bytes"});
}

}  // namespace

int main() {
  std::vector<bench::Figure> figures;
  add_device(figures, "built-in description", {});
  add_simulated(figures, "built-in description", {});
  const auto folder = bench::eds_folder();
  std::string profile;
  if (!folder.empty()) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
      if (entry.path().filename() == "DS301_profile.eds") profile = entry.path().string();
    }
  }
  if (profile.empty()) {
    figures.push_back({"DS301_profile.eds", "no such file; see BERTH_EDS_DIR"});
  } else {
    add_device(figures, "DS301_profile.eds", profile);
    add_simulated(figures, "DS301_profile.eds", profile);
  }
  bench::print_figures("Memory of a whole device, operational", figures);
  return 0;
}
