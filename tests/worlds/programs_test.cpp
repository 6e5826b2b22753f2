// Programs that are updated by two Berths as flying masters, in random worlds (docs/programs.md,
// docs/flying-master.md).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/operate/programming.hpp"
#include "tests/harness/berths.hpp"
#include "tests/harness/program_watch.hpp"
#include "tests/worlds/seeds.hpp"

using namespace berth;
using namespace berth::harness;

namespace {

constexpr TypeCode controller{0x0000'0001, 0x0000'0060};
constexpr std::size_t slots = 3;

std::string image_file(const std::string& name) { return berth::test::source_dir() + "/examples/programs/" + name; }

design::Machine machine() {
  auto made = one_bus(250'000);
  for (unsigned id = 1; id <= slots; ++id) {
    add_slot(made, id, controller);
    made.slots.back().spec.software.programs = {{1, image_file("controller-2.bprg"), {}}};
    made.slots.back().spec.replacement = places::Replacement::automatic;
  }
  return made;
}

// In the slots one blank, one with an older program, one with the right one; and as many spares on the shelf.
plant::PlantFile plant_of(std::uint64_t seed) {
  auto file = one_bus_plant(seed);
  for (unsigned i = 0; i < 2 * slots; ++i) {
    auto& device = add_device(file, fmt::format("d{}", i + 1), controller, i + 1);
    device.plugged = i < slots;
    device.storing.programs.count = 1;
    device.storing.programs.size = 16'384;
    device.storing.programs.images = i % 2 == 0 ? 2 : 1;
    device.storing.programs.erase = 25ms;
    device.storing.programs.write = 8us;
    if (i % 3 == 0) continue;
    device.storing.programs.loaded = device.storing.programs.loaded_path =
        image_file(fmt::format("controller-{}.bprg", i % 3));
  }
  return file;
}

void something_happens(Random& random, Berths& berths) {
  const auto devices = berths.world().devices();
  auto& device = *devices[random.below(devices.size())];
  switch (random.below(6)) {
    case 0: {
      const auto i = random.below(2);
      berths.runs(i) ? berths.kill(i) : berths.begin(i);
      return;
    }
    case 1:  // a power cut, at whatever byte
      device.power(false);
      berths.run_for(std::chrono::milliseconds(random.below(300)));
      device.power(true);
      return;
    case 2: device.power(!device.powered()); return;
    case 3: {  // another one in its place
      const auto place = random.below(slots);
      const bool first = devices[place]->plugged();
      devices[place + (first ? 0 : slots)]->unplug();
      devices[place + (first ? slots : 0)]->plug();
      return;
    }
    case 4:
      berths.world()
          .bus("backbone")
          ->faults()
          .draw_from({.disturbed_per_million = static_cast<std::uint32_t>(random.below(3000)),
                      .overrun_per_million = static_cast<std::uint32_t>(random.below(1500))});
      return;
    default: berths.world().bus("backbone")->faults().draw_from({}); return;
  }
}

// Two new devices for one free slot: a person says which device sits where.
void answer(Berths& berths) {
  if (berths.leads(0) == berths.leads(1)) return;
  auto& network = berths.network(berths.leads(0) ? 0 : 1);
  std::vector<LssAddress> waiting;
  for (const auto& device : berths.world().devices()) {
    const bool waits = device->plugged() && device->device().state() != NmtState::operational;
    if (waits) waiting.push_back(device->truth().address);
  }
  for (const auto& slot : network.report()) {
    const bool used = true;
    if (slot.state == places::SlotState::operational || waiting.empty()) continue;
    static_cast<void>(network.replace(slot.name, waiting.back(), used));
    waiting.pop_back();
  }
}

}  // namespace

// Masters die, devices lose power in the middle of their images and are exchanged, frames are lost: nothing runs but
// the slot's program, and when the faults end all of it runs.
TEST(ProgramsRandomWorlds, NothingRunsButTheSlotsProgram) {
  const auto image = operate::load_program(image_file("controller-2.bprg"));
  ASSERT_TRUE(image);
  const auto range = worlds::seeds(25);
  for (std::uint64_t seed = range.from; seed < range.end(); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    Berths berths(machine(), plant_of(seed), {static_cast<std::uint8_t>(random.below(3)), 1});
    ProgramWatch watch(berths.world(), image->identification);
    berths.begin(0);
    berths.begin(1);
    for (int step = 0; step < 10; ++step) {
      berths.run_for(std::chrono::milliseconds(random.below(random.below(2) == 0 ? 400 : 6000)));
      something_happens(random, berths);
    }
    auto& world = berths.world();
    world.bus("backbone")->faults().draw_from({});
    for (std::size_t i = 0; i < slots; ++i) {
      auto& one = *world.devices()[i];
      auto& other = *world.devices()[i + slots];
      if (one.plugged() == other.plugged()) one.plugged() ? other.unplug() : one.plug();
      for (auto* const each : {&one, &other}) {
        if (each->plugged()) each->power(true);
      }
    }
    for (std::size_t i = 0; i < 2; ++i) {
      if (!berths.runs(i)) berths.begin(i);
    }
    const auto good = [&] {
      return berths.leads(0) != berths.leads(1) && berths.network(berths.leads(0) ? 0 : 1).operational();
    };
    berths.run_for(10s);  // what was exchanged last is missed by then
    if (!berths.run_until(good, 120s)) answer(berths);
    EXPECT_TRUE(berths.run_until(good, 600s)) << berths.log();
    berths.run_for(10s);
    EXPECT_TRUE(good()) << berths.log();
    for (const auto& device : world.devices()) {
      if (!device->plugged()) continue;
      EXPECT_EQ(device->device().state(), NmtState::operational) << device->name() << "\n" << berths.log();
      EXPECT_EQ(program_of(*device), image->identification) << device->name();
    }
    EXPECT_EQ(watch.failure(), "") << berths.log();
    EXPECT_TRUE(world.duplicates().empty());
    EXPECT_EQ(berths.second_starts, 0U) << berths.log();
  }
}
