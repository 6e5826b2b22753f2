// Programs and who gets them: a device that boots in the place of the slot's own is asked what it is before anything of
// it is written.
#include <gtest/gtest.h>
#include <chrono>
#include <functional>
#include <string>

#include <filesystem>

#include "../paths.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;

namespace {

std::string program(const char* name) { return berth::test::source_dir() + "/examples/programs/" + name; }

// Calls at each upload of 1F56h (program software identification) of node 5, and counts what is written to its 1F50h
// and 1F51h.
struct ProgramEar final : can::Tap {
  explicit ProgramEar(Rig& rig) : rig_(rig) { rig.world().bus("backbone")->add_tap(*this); }
  ~ProgramEar() { rig_.world().bus("backbone")->remove_tap(*this); }
  void frame(const can::Frame& f, rt::Time, int) noexcept override {
    if (f.extended || f.id != 0x605 || f.size != 8) return;
    const unsigned index = f.data[1] | f.data[2] << 8U;
    const bool writes = (f.data[0] & 0xE0U) == 0x20 || (f.data[0] & 0xE1U) == 0xC0;
    if (writes && (index == 0x1F50 || index == 0x1F51)) ++written;
    if (f.data[0] != 0x40 || index != 0x1F56) return;
    ++asked;
    if (at_question) at_question();
  }
  unsigned asked = 0;
  unsigned written = 0;
  std::function<void()> at_question;

 private:
  Rig& rig_;
};

// A program's file that can become another.
class ProgramFile {
 public:
  ProgramFile() {
    std::string pattern = (std::filesystem::temp_directory_path() / "berth-programs-XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
    become("controller-1.bprg");
  }
  ~ProgramFile() { std::filesystem::remove_all(folder_); }
  ProgramFile(const ProgramFile&) = delete;
  ProgramFile& operator=(const ProgramFile&) = delete;
  void become(const char* name) const {
    std::filesystem::copy_file(program(name), path(), std::filesystem::copy_options::overwrite_existing);
    std::filesystem::last_write_time(
        path(), std::filesystem::last_write_time(program(name)) + changes_++ * std::chrono::seconds(2));
  }
  [[nodiscard]] std::string path() const { return (folder_ / "program.bprg").string(); }

 private:
  std::filesystem::path folder_;
  mutable int changes_ = 1;
};

plant::PlantDevice& add_controller(plant::PlantFile& p, const std::string& name, std::uint32_t serial) {
  auto& d = add_device(p, name, TypeCode{1, 0x60}, serial);
  d.storing.programs.count = 1;
  d.storing.programs.size = 16'384;
  d.storing.programs.loaded = "controller-1.bprg";
  d.storing.programs.loaded_path = program("controller-1.bprg");
  return d;
}

}  // namespace

// The slot's device leaves when it is asked for its program, and a spare of its type that came with the slot's node-ID
// stored hears the repeated question: it has another program, and is not given the slot's.
TEST(Programming, ASpareThatBootsAtTheQuestionForTheProgramIsNotProgrammed) {
  const ProgramFile file;
  design::Machine machine = one_bus(125'000);
  add_slot(machine, 5, TypeCode{1, 0x60});
  machine.slots.back().spec.software.programs = {{.number = 1, .file = file.path(), .identification = {}}};
  auto plant = one_bus_plant(1);
  add_controller(plant, "own", 1);
  auto& spare = add_controller(plant, "spare", 99);
  spare.plugged = false;
  spare.source = plant::NodeIdSource::nonvolatile;
  spare.node_id = NodeId(5);
  Rig rig(machine, plant);
  rig.begin();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  rig.kill();
  rig.device("own").device().apply(co::NmtCommand::enter_pre_operational);
  rig.run_for(1s);
  file.become("controller-2.bprg");
  ProgramEar ear(rig);
  ear.at_question = [&] {
    if (ear.asked != 1) return;
    rig.world().sim().after(1us, [&] {
      rig.device("own").unplug();
      rig.device("spare").plug();
    });
  };
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return ear.asked >= 2; }, 10s)) << "the spare hears it" << rig.log();
  rig.run_for(20s);
  EXPECT_EQ(ear.written, 0U) << rig.log();
  // The slot's own device comes back, alone, and gets its program.
  rig.device("spare").unplug();
  rig.device("own").plug();
  EXPECT_TRUE(rig.until_operational(60s)) << rig.log();
  EXPECT_GT(ear.written, 0U);
}
