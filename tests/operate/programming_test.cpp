// Programs and who gets them: a device that boots in the place of the slot's own is asked what it is before anything of
// it is written.
#include <gtest/gtest.h>
#include <unistd.h>
#include <chrono>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include <filesystem>

#include <fmt/format.h>

#include "../paths.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;

namespace {

std::string program(const char* name) { return berth::test::source_dir() + "/examples/programs/" + name; }

// What is asked and written of node 5's programs.
struct ProgramEar final : can::Tap {
  explicit ProgramEar(Rig& rig) : rig_(rig) { rig.world().bus("backbone")->add_tap(*this); }
  ~ProgramEar() { rig_.world().bus("backbone")->remove_tap(*this); }
  void frame(const can::Frame& f, rt::Time, int) noexcept override {
    if (f.extended || f.id != 0x605 || f.size != 8) return;
    ++frames;
    const unsigned index = f.data[1] | f.data[2] << 8U;
    const bool writes = (f.data[0] & 0xE0U) == 0x20 || (f.data[0] & 0xE1U) == 0xC0;
    if (f.data[0] == 0x40 && index == 0x1F56) ++asked;
    if (writes && index == 0x1F51) ++controlled;
    if (writes && index == 0x1F50) ++downloads;
    if (changed) changed();
  }
  unsigned frames = 0;
  unsigned asked = 0;
  unsigned controlled = 0;
  unsigned downloads = 0;
  std::function<void()> changed;

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

// The slot's own device, with a program that is not the slot's any more, and a spare of its type that came with the
// slot's node-ID stored.
class Programming : public ::testing::Test {
 protected:
  Programming() : Programming(places::Replacement::ask, "", true) {}
  // `vacant`: the device of a slot of the same type, which is gone before the story begins; none where it is empty.
  Programming(places::Replacement replacement, const std::string& vacant, bool spare_has_its_node_id, bool rand = true)
      : rig_(machine(replacement, vacant), plant(vacant, spare_has_its_node_id, rand)), vacant_(vacant) {}

  // The slot's device leaves as soon as `now` holds, and the spare boots in its place.
  void change_places_when(std::function<bool(const ProgramEar&)> now, bool spare_comes = true) {
    rig_.begin();
    ASSERT_TRUE(rig_.until_operational(30s)) << rig_.log();
    rig_.kill();
    rig_.device("own").device().apply(co::NmtCommand::enter_pre_operational);
    if (!vacant_.empty()) rig_.device(vacant_).unplug();
    rig_.run_for(1s);
    file_.become("controller-2.bprg");
    ear_.frames = ear_.asked = ear_.controlled = ear_.downloads = 0;
    ear_.changed = [this, now = std::move(now), spare_comes] {
      if (changed_ || !now(ear_)) return;
      changed_ = true;
      rig_.world().sim().after(1us, [this, spare_comes] {
        rig_.device("own").unplug();
        if (spare_comes) rig_.device("spare").plug();
      });
    };
    rig_.begin();
    ASSERT_TRUE(rig_.run_until([&] { return changed_; }, 30s)) << rig_.log();
    rig_.run_for(60s);
  }
  // Once it has booted: its program, and that it runs.
  [[nodiscard]] std::string spares_program() {
    const auto* const programs = rig_.device("spare").device().programs();
    if (programs == nullptr) return "?";
    const auto& has = programs->memory().program(1);
    return fmt::format("{:08X}{}{}", has.identification, has.valid ? "" : " invalid",
                       programs->runs() ? "" : " stopped");
  }
  void expect_own_is_programmed() {
    rig_.device("spare").unplug();
    rig_.device("own").plug();
    EXPECT_TRUE(rig_.until_operational(120s)) << rig_.log();
  }

  ProgramFile file_;
  Rig rig_;
  ProgramEar ear_{rig_};
  std::string vacant_;
  bool changed_ = false;
  static constexpr const char* as_it_came = "A2580ECF";

 private:
  [[nodiscard]] design::Machine machine(places::Replacement replacement, const std::string& vacant) const {
    design::Machine m = one_bus(125'000);
    add_slot(m, 5, TypeCode{1, 0x60});
    if (!vacant.empty()) add_slot(m, 6, TypeCode{1, 0x60});
    for (auto& slot : m.slots) {
      slot.spec.replacement = replacement;
      slot.spec.software.programs = {{.number = 1, .file = file_.path(), .identification = {}}};
    }
    return m;
  }
  [[nodiscard]] static plant::PlantFile plant(const std::string& vacant, bool spare_has_its_node_id, bool rand) {
    auto p = one_bus_plant(1);
    auto& own = add_controller(p, "own", 1);
    if (!rand) own.speaks = plant::SpeaksSet{plant::Speaks::lss};
    if (!vacant.empty()) add_controller(p, vacant, 2);
    auto& spare = add_controller(p, "spare", 99);
    spare.plugged = false;
    if (!spare_has_its_node_id) return p;
    spare.source = plant::NodeIdSource::nonvolatile;
    spare.node_id = NodeId(5);
    return p;
  }
};

}  // namespace

// It hears the repeated question: it has another program than the slot's device shall have, and keeps it.
TEST_F(Programming, ASpareThatBootsAtTheQuestionForTheProgramIsNotProgrammed) {
  change_places_when([](const ProgramEar& ear) { return ear.asked == 1; });
  EXPECT_GE(ear_.asked, 2U) << "the spare heard it";
  EXPECT_EQ(ear_.controlled + ear_.downloads, 0U) << rig_.log();
  EXPECT_EQ(spares_program(), as_it_came);
  expect_own_is_programmed();
}

// It may hear the stop repeated, from a client that got no answer: a power cycle ends that. It is not cleared.
TEST_F(Programming, ASpareThatBootsWhileTheOtherIsStoppedIsNotProgrammed) {
  change_places_when([](const ProgramEar& ear) { return ear.controlled == 1; });
  EXPECT_LE(ear_.controlled, 2U) << rig_.log();
  EXPECT_TRUE(spares_program().starts_with(as_it_came)) << spares_program();
  rig_.device("spare").power(false);
  rig_.run_for(100ms);
  rig_.device("spare").power(true);
  rig_.run_for(1s);
  EXPECT_EQ(spares_program(), as_it_came);
  expect_own_is_programmed();
}
TEST_F(Programming, ASpareThatBootsWhileTheOtherIsClearedIsNotProgrammed) {
  change_places_when([](const ProgramEar& ear) { return ear.controlled == 2; });
  EXPECT_EQ(spares_program(), as_it_came) << rig_.log();
  expect_own_is_programmed();
}
TEST_F(Programming, ASpareThatBootsDuringTheDownloadIsNotProgrammed) {
  change_places_when([](const ProgramEar& ear) { return ear.downloads == 1; });
  EXPECT_EQ(spares_program(), as_it_came) << rig_.log();
  expect_own_is_programmed();
}

// It leaves in the middle, and no other comes: its slot says so, and is ready for it.
TEST_F(Programming, ADeviceThatLeavesInTheMiddleIsAbsentAndProgrammedWhenItComesBack) {
  change_places_when([](const ProgramEar& ear) { return ear.downloads == 1; }, false);
  EXPECT_EQ(rig_.state(5), SlotState::absent) << rig_.log();
  rig_.device("own").plug();
  EXPECT_TRUE(rig_.until_operational(120s)) << rig_.log();
}

// `replacement = "auto"`: a device that leaves while it is programmed is as gone as one whose heartbeat stopped.
namespace {

using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;

struct Leaving {
  const char* name;
  std::function<bool(const ProgramEar&)> now;
  bool spare_has_its_node_id = false;
};
void PrintTo(const Leaving& leaving, std::ostream* out) { *out << leaving.name; }

class ExchangedWhileProgrammed : public Programming, public ::testing::WithParamInterface<Leaving> {
 protected:
  ExchangedWhileProgrammed() : Programming(places::Replacement::automatic, "", GetParam().spare_has_its_node_id) {}
};

// Beside a slot of the same type whose device was gone before.
class ExchangedBesideAVacantSlot : public Programming {
 protected:
  ExchangedBesideAVacantSlot() : Programming(places::Replacement::automatic, "vacant", false) {}
};

bool is_stopped(const ProgramEar& ear) { return ear.controlled == 1; }
bool is_cleared(const ProgramEar& ear) { return ear.controlled == 2; }
bool is_loaded(const ProgramEar& ear) { return ear.downloads == 1; }

}  // namespace

INSTANTIATE_TEST_SUITE_P(Automatic, ExchangedWhileProgrammed,
                         ::testing::Values(Leaving{"Stopped", is_stopped}, Leaving{"Cleared", is_cleared},
                                           Leaving{"Loaded", is_loaded}, Leaving{"StoppedSameNodeId", is_stopped, true},
                                           Leaving{"ClearedSameNodeId", is_cleared, true},
                                           Leaving{"LoadedSameNodeId", is_loaded, true}),
                         [](const auto& param) { return std::string(param.param.name); });

TEST_P(ExchangedWhileProgrammed, TheSpareTakesTheSlotAndIsProgrammed) {
  change_places_when(GetParam().now);
  EXPECT_TRUE(rig_.run_until([&] { return rig_.state(5) == SlotState::operational; }, 120s)) << rig_.log();
  EXPECT_EQ(rig_.seats(), (Seats{{5, 99}})) << rig_.log();
  EXPECT_NE(spares_program(), as_it_came) << rig_.log();
  EXPECT_EQ(rig_.device("spare").device().state(), NmtState::operational);
}

// No other comes: the slot is free, and its own device goes back there without a question.
TEST_P(ExchangedWhileProgrammed, ItsSlotIsFreeAndItComesBack) {
  change_places_when(GetParam().now, false);
  EXPECT_EQ(rig_.state(5), SlotState::empty) << rig_.log();
  rig_.device("own").plug();
  EXPECT_TRUE(rig_.run_until([&] { return rig_.state(5) == SlotState::operational; }, 120s)) << rig_.log();
  EXPECT_EQ(rig_.seats(), (Seats{{5, 1}}));
}

// One device for two free slots: a person says where. Neither slot keeps a device that is gone.
TEST_F(ExchangedBesideAVacantSlot, WhichSlotTheSpareTakesIsAsked) {
  change_places_when(is_loaded);
  EXPECT_EQ(rig_.state(5), SlotState::question) << rig_.log();
  EXPECT_EQ(rig_.state(6), SlotState::question) << rig_.log();
  ASSERT_TRUE(rig_.network().replace("s5", rig_.device("spare").truth().address));
  EXPECT_TRUE(rig_.run_until([&] { return rig_.state(5) == SlotState::operational; }, 120s)) << rig_.log();
  EXPECT_NE(spares_program(), as_it_came);
}

// It loses its power for a moment, at each kind of step, and comes back under its node-ID. It has no RAND, which would
// find it again.
namespace {

using Loss = std::tuple<unsigned, int>;  // at which frame; for how many milliseconds

class PowerLossWhileProgrammed : public Programming, public ::testing::WithParamInterface<Loss> {
 protected:
  PowerLossWhileProgrammed() : Programming(places::Replacement::ask, "", false, false) {}
};

}  // namespace

INSTANTIATE_TEST_SUITE_P(AtEachStep, PowerLossWhileProgrammed,
                         ::testing::Combine(::testing::Values(1, 4, 8, 9, 10, 11, 12, 40, 300, 590, 595, 596, 597, 598,
                                                              599, 600, 602, 605, 610, 615),
                                            ::testing::Values(20, 300, 2'000, 12'000)));

TEST_P(PowerLossWhileProgrammed, ItIsProgrammedAllTheSame) {
  const auto [frame, ms] = GetParam();
  rig_.begin();
  ASSERT_TRUE(rig_.until_operational(30s)) << rig_.log();
  rig_.kill();
  rig_.device("own").device().apply(co::NmtCommand::enter_pre_operational);
  rig_.run_for(1s);
  file_.become("controller-2.bprg");
  ear_.frames = 0;
  ear_.changed = [this, at = frame, off = ms] {
    if (changed_ || ear_.frames != at) return;
    changed_ = true;
    rig_.world().sim().after(1us, [this] { rig_.device("own").power(false); });
    rig_.world().sim().after(std::chrono::milliseconds(off), [this] { rig_.device("own").power(true); });
  };
  rig_.begin();
  ASSERT_TRUE(rig_.run_until([&] { return changed_; }, 60s)) << ear_.frames << " frames\n" << rig_.log();
  rig_.run_for(15s);
  EXPECT_TRUE(rig_.run_until([&] { return rig_.state(5) == SlotState::operational; }, 120s)) << rig_.log();
}
