// What the random worlds are made of when there is no repository beside the program, and what is counted of them.
#include <gtest/gtest.h>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>

#include "berth/harness/as_sold.hpp"
#include "berth/harness/example_files.hpp"
#include "berth/harness/matrix.hpp"
#include "berth/harness/run_world.hpp"
#include "tests/harness/rig.hpp"

namespace berth::harness {
namespace {

std::string contents(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(ExampleFiles, AreTheRepositorysAndGoWithTheirObject) {
  std::string folder;
  {
    const auto files = ExampleFiles::make();
    ASSERT_TRUE(files);
    folder = files->folders().own;
    for (const auto* name : {"pump.eds", "pump.dcf"}) {
      const std::string text = contents(files->folders().example(name));
      EXPECT_GT(text.size(), 1000U);
      EXPECT_EQ(text, contents(example_eds(name)));
    }
    const auto mode = std::filesystem::status(folder).permissions();
    EXPECT_EQ(mode, std::filesystem::perms::owner_all) << "nobody else may write there";
  }
  EXPECT_FALSE(std::filesystem::exists(folder));
}

TEST(Matrix, ARoundIsTheSameCellWithOtherDevices) {
  matrix::Cell cell{matrix::Kind::lss, 2, 500'000, matrix::Latency::equal};
  const auto first = matrix::run(cell, matrix::budget(cell));
  cell.round = 1;
  const auto second = matrix::run(cell, matrix::budget(cell)), again = matrix::run(cell, matrix::budget(cell));
  EXPECT_EQ(first.end, matrix::End::operational);
  EXPECT_EQ(second.end, matrix::End::operational);
  EXPECT_NE(first.hash, second.hash);
  EXPECT_EQ(second.hash, again.hash);
}

// Two buses; the one device of the second is plugged in later.
TEST(Rig, IsOperationalWhenEveryBusIs) {
  design::Machine machine = one_bus(125'000);
  machine.buses.push_back(machine.buses.front());
  machine.buses.back().name = "second";
  add_slot(machine, 1, type_a);
  add_slot(machine, 1, type_a, "second");
  plant::PlantFile plant = one_bus_plant(1);
  plant.buses.push_back({"second", 0});
  add_device(plant, "d1", type_a, 1);
  add_device(plant, "d2", type_a, 2, "second").plugged = false;
  Rig rig(machine, plant);
  rig.begin();
  rig.run_for(20s);
  EXPECT_EQ(rig.state(1), places::SlotState::operational);
  EXPECT_FALSE(rig.first_operational);
  rig.device("d2").plug();
  ASSERT_TRUE(rig.run_until([&] { return rig.operational(); }, 60s));
  ASSERT_TRUE(rig.first_operational);
  EXPECT_GT(*rig.first_operational, 20s);
  EXPECT_LE(*rig.first_operational, rig.now().time_since_epoch());
}

}  // namespace
}  // namespace berth::harness
