// The world that a plant file makes: devices, what happens to them, events, the truth, and what outlives the process.
#include <gtest/gtest.h>
#include <unistd.h>
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include <filesystem>
#include <fstream>

#include "../pch.hpp"
#include "berth/plant/world.hpp"
#include "record.hpp"
#include "tests/eds_folder.hpp"
#include "tests/paths.hpp"

namespace berth::plant::world_tests {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

PlantEvent event(Action action, const std::string& name, Duration delay, After after = After::start) {
  PlantEvent e;
  e.after = after;
  e.delay = delay;
  e.action = action;
  e.device = name;
  e.bus = "b";
  return e;
}

PlantFile plant(std::vector<PlantDevice> devices, std::vector<PlantEvent> events = {}) {
  PlantFile p;
  p.buses.push_back({"b", 250'000});
  p.devices = std::move(devices);
  p.events = std::move(events);
  return p;
}

/// A world with Berth's node on bus "b".
struct Scene {
  explicit Scene(const PlantFile& file) : world(World::make(file, {}, findings)) {
    if (!world) return;
    record = std::make_unique<Record>(*world->bus("b"));
    me = world->attach_master("b");
    world->start();
  }
  ~Scene() {
    me.reset();
    record.reset();
  }
  void ask(std::string_view frame, rt::Duration time = milliseconds(5)) {
    me->send(*can::parse_frame(frame), 0);
    world->sim().run_for(time);
  }
  void run(rt::Duration time) { world->sim().run_for(time); }
  SimDevice& operator[](std::string_view name) { return *world->find(name); }

  Findings findings;
  std::unique_ptr<World> world;
  std::unique_ptr<Record> record;
  std::unique_ptr<sim::Controller> me;
};

// Without power it is no node of the bus: nobody is left who acknowledges.
TEST(PlantWorld, ADeviceThatIsOffDoesNotAcknowledge) {
  Scene s(plant({device("only", 6, 3)}, {event(Action::power_off, "only", milliseconds(60))}));
  ASSERT_TRUE(s.world);
  s.run(milliseconds(50));
  const auto before = s.me->status().tec;
  s.ask("603#4000100000000000");
  EXPECT_EQ(s.me->status().tec, before);
  s.run(milliseconds(10));
  s.ask("603#4000100000000000", milliseconds(50));
  EXPECT_GE(s.me->status().tec, 128) << "error-passive: its frame is on the bus again and again";
  EXPECT_EQ(s.me->status().queued, 1);
}

TEST(PlantWorld, DevicesBootAndAnswerAsThePlanSays) {
  auto late = device("late", 8, 4);
  late.plugged = false;
  auto fixed = device("fixed", 9, 5);
  fixed.source = NodeIdSource::switches;
  fixed.heartbeat = milliseconds(100);
  Scene s(plant({device("blank", 6), device("stored", 7, 3), late, fixed}));
  ASSERT_TRUE(s.world);
  s.run(milliseconds(50));
  EXPECT_EQ(s.record->count("703#00"), 1);
  EXPECT_EQ(s.record->count("704#00"), 0);
  EXPECT_EQ(s.record->count("705#00"), 1);
  s.run(milliseconds(100));
  EXPECT_EQ(s.record->count("705#7F"), 1);
  s.ask("603#4018100400000000");
  EXPECT_EQ(s.record->text.back(), "583#4318100407000000");
  s["late"].plug();
  s.run(milliseconds(20));
  EXPECT_EQ(s.record->count("704#00"), 1);

  const auto truth = s.world->truth();
  ASSERT_EQ(truth.size(), 4U);
  EXPECT_EQ(truth[0].name, "blank");
  EXPECT_EQ(truth[0].address, (LssAddress{1, 2, 3, 6}));
  EXPECT_TRUE(truth[0].powered);
  EXPECT_FALSE(truth[0].active.configured());
  EXPECT_EQ(truth[1].active, NodeId(3));
  EXPECT_EQ(truth[1].persistent, NodeId(3));
  EXPECT_EQ(truth[1].state, NmtState::pre_operational);
  EXPECT_EQ(truth[1].bit_rate, 250'000U);
}

// LSS: 04 01 all into configuration, 11h, and then 17h: each node-ID of the truth by itself.
TEST(PlantWorld, TheTruthHasTheActiveThePendingAndThePersistentNodeId) {
  Scene s(plant({device("a", 6, 3)}));
  s.run(milliseconds(50));
  const auto ids = [&] {
    const auto truth = s["a"].truth();
    return std::array{truth.active, truth.pending, truth.persistent};
  };
  EXPECT_EQ(ids(), (std::array{NodeId(3), NodeId(3), NodeId(3)}));
  s.ask("7E5#0401000000000000");
  s.ask("7E5#1109000000000000");
  EXPECT_EQ(ids(), (std::array{NodeId(3), NodeId(9), NodeId(3)}));
  s.ask("7E5#1700000000000000", milliseconds(500));
  EXPECT_EQ(ids(), (std::array{NodeId(3), NodeId(9), NodeId(9)}));
}

TEST(PlantWorld, UnplugPowerAndReset) {
  Scene s(plant({device("a", 6, 3), device("other", 7, 4)}));
  s.run(milliseconds(50));
  s["a"].unplug();
  s.ask("603#4000100000000000");
  EXPECT_EQ(s.record->count("583#4300100000000000"), 0);
  EXPECT_FALSE(s["a"].truth().plugged);
  s["a"].power(true);
  EXPECT_FALSE(s["a"].powered()) << "no cable, no power";
  s["a"].plug();
  s.run(milliseconds(50));
  EXPECT_EQ(s.record->count("703#00"), 2);
  s["a"].power(false);
  s["a"].power(false);
  s.run(milliseconds(50));
  s["a"].power(true);
  EXPECT_TRUE(s["a"].truth().booting);
  s.run(milliseconds(50));
  EXPECT_EQ(s.record->count("703#00"), 3);
  s["a"].reset();
  s.run(milliseconds(50));
  EXPECT_EQ(s.record->count("703#00"), 4);
}

// Paper 1 §III: the replacement story's plugging, by events after a milestone; each milestone counts once.
TEST(PlantWorld, S1_51_EventsWaitForTheirMilestone) {
  auto spare = device("spare", 21);
  spare.plugged = false;
  Scene s(plant({device("s2", 5, 2), spare}, {event(Action::unplug, "s2", milliseconds(100), After::operational),
                                              event(Action::plug, "spare", milliseconds(200), After::operational),
                                              event(Action::power_off, "s2", milliseconds(30))}));
  s.run(milliseconds(29));
  EXPECT_TRUE(s["s2"].powered());
  s.run(milliseconds(2));
  EXPECT_FALSE(s["s2"].powered());
  EXPECT_TRUE(s["s2"].plugged());
  s.run(seconds(1));
  EXPECT_TRUE(s["s2"].plugged());
  s.world->milestone(After::operational);
  s.run(milliseconds(150));
  EXPECT_FALSE(s["s2"].plugged());
  EXPECT_FALSE(s["spare"].plugged());
  s.run(milliseconds(60));
  EXPECT_TRUE(s["spare"].plugged());
  s["spare"].unplug();
  s.world->milestone(After::operational);
  s.run(seconds(1));
  EXPECT_FALSE(s["spare"].plugged()) << "a milestone counts once";
}

TEST(PlantWorld, DeafAndSlowEndByThemselves) {
  Scene s(plant({device("a", 6, 3)}));
  s.run(milliseconds(50));
  s["a"].deaf(milliseconds(20));
  s.ask("603#4000100000000000", milliseconds(10));
  EXPECT_EQ(s.record->count("583#4300100000000000"), 0);
  s["a"].deaf(milliseconds(100));  // longer: the end of the first does not end it
  s.run(milliseconds(50));
  s.ask("603#4000100000000000", milliseconds(10));
  EXPECT_EQ(s.record->count("583#4300100000000000"), 0);
  s.run(milliseconds(50));
  s.ask("603#4000100000000000", milliseconds(10));
  EXPECT_EQ(s.record->count("583#4300100000000000"), 1);
  s["a"].slow(milliseconds(30), milliseconds(15));
  s.ask("603#4000100000000000", milliseconds(20));
  EXPECT_EQ(s.record->count("583#4300100000000000"), 1);
  s.run(milliseconds(20));
  EXPECT_EQ(s.record->count("583#4300100000000000"), 2);
  s.ask("603#4000100000000000", milliseconds(10));
  EXPECT_EQ(s.record->count("583#4300100000000000"), 3) << "no longer slow";
}

TEST(PlantWorld, BusEventsStrikeWhatTheyName) {
  auto cut = event(Action::cut_cable, "", milliseconds(0));
  cut.nodes = {"a"};
  auto lost = event(Action::overrun, "", milliseconds(0));
  lost.nodes = {"b"};
  lost.strike.id = 0x604;
  auto disturb = event(Action::disturb, "", milliseconds(0));
  disturb.strike.id = 0x604;
  disturb.strike.bit = 30;
  auto wrong = cut;
  wrong.nodes = {"nobody"};
  auto nowhere = cut;
  nowhere.bus = "x";
  Scene s(plant({device("a", 6, 3), device("b", 7, 4)}));
  s.run(milliseconds(50));
  EXPECT_FALSE(s.world->perform(wrong));
  EXPECT_FALSE(s.world->perform(nowhere));
  EXPECT_FALSE(s.world->perform(event(Action::plug, "nobody", milliseconds(0))));

  ASSERT_TRUE(s.world->perform(cut));
  s.ask("603#4000100000000000");
  s.ask("604#4000100000000000");
  EXPECT_EQ(s.record->count("583#4300100000000000"), 0);
  EXPECT_EQ(s.record->count("584#4300100000000000"), 1);
  ASSERT_TRUE(s.world->perform(event(Action::join, "", milliseconds(0))));
  s.run(milliseconds(10));
  s.ask("603#4000100000000000");
  EXPECT_EQ(s.record->count("583#4300100000000000"), 1);

  ASSERT_TRUE(s.world->perform(lost));
  s.ask("604#4000100000000000");
  EXPECT_EQ(s.record->count("584#4300100000000000"), 1) << "acknowledged, but lost";
  s.ask("604#4000100000000000");
  EXPECT_EQ(s.record->count("584#4300100000000000"), 2);

  const auto errors = s.world->bus("b")->statistics().error_frames;
  ASSERT_TRUE(s.world->perform(disturb));
  s.ask("604#4000100000000000", milliseconds(10));
  EXPECT_EQ(s.world->bus("b")->statistics().error_frames, errors + 1);
  EXPECT_EQ(s.record->count("584#4300100000000000"), 3) << "repeated by the controller";

  auto master = cut;
  master.nodes = {std::string(master_name)};
  ASSERT_TRUE(s.world->perform(master));
  s.ask("604#4000100000000000");
  EXPECT_EQ(s.record->count("584#4300100000000000"), 3);
}

TEST(PlantWorld, AStrikeMayWaitForFramesOfOneSender) {
  auto disturb = event(Action::disturb, "", milliseconds(0));
  disturb.strike.bit = 30;
  disturb.strike.sender = "b";
  Scene s(plant({device("a", 6, 3), device("b", 7, 4)}));
  s.run(milliseconds(50));
  auto nobody = disturb;
  nobody.strike.sender = "nobody";
  EXPECT_FALSE(s.world->perform(nobody));
  ASSERT_TRUE(s.world->perform(disturb));
  const auto errors = [&] { return s.world->bus("b")->statistics().error_frames; };
  const auto before = errors();
  s.ask("603#4000100000000000", milliseconds(10));
  EXPECT_EQ(s.record->count("583#4300100000000000"), 1);
  EXPECT_EQ(errors(), before) << "request and answer are of others";
  s.ask("604#4000100000000000", milliseconds(10));
  EXPECT_EQ(s.record->count("584#4300100000000000"), 1) << "repeated by the controller";
  EXPECT_EQ(errors(), before + 1);
}

TEST(PlantWorld, ADeviceRecoversFromDeafnessAndSlowness) {
  Scene s(plant({device("a", 6, 3)}));
  s.run(milliseconds(50));
  s["a"].deaf(Duration::zero());
  s["a"].slow(milliseconds(30), milliseconds(40));
  EXPECT_TRUE(s["a"].truth().deaf);
  EXPECT_EQ(s["a"].truth().late, milliseconds(30));
  s.ask("603#4000100000000000", milliseconds(35));
  EXPECT_EQ(s.record->count("583#4300100000000000"), 0);
  ASSERT_TRUE(s.world->perform(event(Action::recover, "a", milliseconds(0))));
  EXPECT_FALSE(s["a"].truth().deaf);
  EXPECT_EQ(s["a"].truth().late, Duration::zero());
  s.ask("603#4000100000000000", milliseconds(10));
  EXPECT_EQ(s.record->count("583#4300100000000000"), 1);
  s["a"].slow(milliseconds(30), Duration::zero());
  s.run(milliseconds(20));
  EXPECT_EQ(s["a"].truth().late, milliseconds(30)) << "the end of what it recovered from ends nothing later";
}

// Each side hears itself alone; a node that is alone has nobody who acknowledges.
TEST(PlantWorld, TheTruthTellsThePiecesOfACutCable) {
  Scene s(plant({device("a", 6, 3), device("b", 7, 4)}));
  s.run(milliseconds(50));
  const auto pieces = [&] {
    std::vector<std::vector<std::string>> names;
    for (const auto& piece : sim::pieces(*s.world->bus("b"))) {
      names.emplace_back();
      for (const auto* node : piece) names.back().push_back(node->name());
    }
    return names;
  };
  const auto before = pieces();
  ASSERT_EQ(before.size(), 1U);
  auto cut = event(Action::cut_cable, "", milliseconds(0));
  cut.nodes = {"b"};
  ASSERT_TRUE(s.world->perform(cut));
  ASSERT_EQ(pieces().size(), 2U);
  EXPECT_EQ(pieces().at(1), std::vector<std::string>{"b"});
  const auto unacknowledged = s["b"].controller().statistics().transmit_errors;
  s["b"].reset();
  s.run(milliseconds(100));
  EXPECT_GT(s["b"].controller().statistics().transmit_errors, unacknowledged) << "its boot-up message";
  s["b"].controller().cable(false);
  EXPECT_EQ(pieces().size(), 1U) << "a plug that is out is no piece";
  s["b"].controller().cable(true);
  ASSERT_TRUE(s.world->perform(event(Action::join, "", milliseconds(0))));
  EXPECT_EQ(pieces(), before);
}

TEST(PlantWorld, SerialAndStoredNodeIdChangeAtPowerOn) {
  Scene s(plant({device("a", 6, 3)}));
  s.run(milliseconds(50));
  auto serial = event(Action::set_serial, "a", milliseconds(0));
  serial.value = 99;
  auto id = event(Action::set_node_id, "a", milliseconds(0));
  id.value = 12;
  ASSERT_TRUE(s.world->perform(serial));
  ASSERT_TRUE(s.world->perform(id));
  id.value = 200;
  EXPECT_FALSE(s.world->perform(id));
  std::vector<std::uint8_t> image(s["a"].memory().image().begin(), s["a"].memory().image().end());
  image.resize(120, 0x5A);  // behind what LSS stores stand the parameters
  s["a"].memory().restore(image);
  const auto state = s.world->state();
  s.ask("603#4018100400000000");
  EXPECT_EQ(s.record->text.back(), "583#4318100406000000");
  EXPECT_EQ(s["a"].truth().address.serial, 6U);
  s["a"].power(false);
  s["a"].power(true);
  s.run(milliseconds(50));
  s.ask("60C#4018100400000000");
  EXPECT_EQ(s.record->text.back(), "58C#4318100463000000");
  EXPECT_EQ(s["a"].truth().address.serial, 99U);
  EXPECT_EQ(s["a"].memory().image()[100], 0x5A) << "another node-ID takes no parameters away";
  Scene again(plant({device("a", 6, 3)}));
  ASSERT_TRUE(again.world->restore(state));
  EXPECT_EQ(again["a"].memory().image()[100], 0x5A);
  EXPECT_EQ(again["a"].memory().image()[0], 0xFF);
}

TEST(PlantWorld, DuplicatesAndObserver) {
  struct Watch final : World::Observer {
    void plant_changed(const SimDevice& d) noexcept override { seen.push_back(d.name()); }
    std::vector<std::string> seen;
  };
  Watch watch;
  Scene s(plant({device("a", 6, 3), device("b", 7, 3), device("c", 8, 4)}));
  s.world->add_observer(watch);
  s.run(milliseconds(50));
  EXPECT_EQ(std::count(watch.seen.begin(), watch.seen.end(), "b") > 0, true);
  const auto clones = s.world->duplicates();
  ASSERT_EQ(clones.size(), 1U);
  EXPECT_EQ(clones[0].first->name(), "a");
  EXPECT_EQ(clones[0].second->name(), "b");
  s["b"].unplug();
  EXPECT_TRUE(s.world->duplicates().empty());
  EXPECT_EQ(watch.seen.back(), "b");
  s.world->remove_observer(watch);
}

TEST(PlantWorld, FindingsForWhatCannotBe) {
  Findings findings;
  auto p = plant({device("a", 6)});
  p.buses[0].bitrate = 0;
  EXPECT_EQ(World::make(p, {}, findings), nullptr);
  ASSERT_TRUE(has_errors(findings));
  findings.clear();
  const std::vector<BusRate> rates{{"b", 125'000}, {"empty", 50'000}};
  const auto world = World::make(p, rates, findings);
  ASSERT_TRUE(world);
  EXPECT_EQ(world->bus("b")->bit_rate(), 125'000U);
  EXPECT_NE(world->bus("empty"), nullptr);
  EXPECT_EQ(world->attach_master("nowhere"), nullptr);
  p.devices[0].eds = "missing.eds";
  p.devices.push_back(p.devices[0]);
  EXPECT_EQ(World::make(p, rates, findings), nullptr);
  EXPECT_EQ(findings.size(), 1U) << "one file, one finding";
  p.devices = {device("a", 6)};
  p.devices[0].bus = "nowhere";
  findings.clear();
  EXPECT_EQ(World::make(p, rates, findings), nullptr);
  EXPECT_TRUE(has_errors(findings));
}

// On wires nobody would hear anybody: the simulated bus works, and it is said.
TEST(PlantWorld, ABusThatTheMachineHasOtherwiseIsTold) {
  const auto said = [](std::uint32_t bit_rate, const std::vector<BusRate>& rates) {
    auto p = plant({device("a", 6)});
    p.buses[0].bitrate = bit_rate;
    Findings findings;
    const bool made = World::make(p, rates, findings) != nullptr;
    EXPECT_EQ(made, !has_errors(findings));
    EXPECT_LE(findings.size(), 1U);
    return findings.empty() ? std::string() : findings.front().key + ": " + findings.front().message;
  };
  EXPECT_EQ(said(250'000, {{"b", 250'000}}), "");
  EXPECT_EQ(said(0, {{"b", 250'000}}), "");
  EXPECT_EQ(said(250'000, {}), "");
  EXPECT_EQ(said(250'000, {{"b", 125'000}}),
            "bus.b: 250000 bit/s here and 125000 bit/s in the machine file: the simulated bus has 250000 bit/s");
  EXPECT_EQ(said(250'000, {{"field", 250'000}, {"left", 50'000}}),
            "bus.b: the machine file has no bus of this name, but \"field\", \"left\"");
  EXPECT_EQ(said(0, {}), "bus.b: no bit rate, neither here nor in a machine file");
  EXPECT_EQ(said(0, {{"field", 250'000}}),
            "bus.b: no bit rate here, and the machine file has no bus of this name, but \"field\"");
}

TEST(PlantWorld, DeviceOfADescriptionFile) {
  const auto folder = berth::test::eds_folder();
  if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << "no EDS files: set BERTH_EDS_DIR";
  std::vector<PlantDevice> devices;
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const auto extension = entry.path().extension().string();
    if (extension == ".eds" || extension == ".EDS") paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  for (const auto& path : paths) {
    auto d = device("d" + std::to_string(devices.size()), 1000 + static_cast<std::uint32_t>(devices.size()),
                    static_cast<std::uint8_t>(1 + devices.size() % 100));
    d.eds = d.eds_path = path.string();
    d.address_of_eds = true;
    devices.push_back(d);
    if (devices.size() == 100) break;
  }
  std::size_t usable = 0;
  // One by one: a file that cannot be read must not hide the rest.
  for (const auto& d : devices) {
    Scene s(plant({d}));
    if (!s.world) continue;
    ++usable;
    s.run(milliseconds(200));
    EXPECT_EQ(s.world->truth()[0].state == NmtState::initialising, false) << d.eds;
    s.ask(std::string("6") + can::to_string(can::Frame::base(d.node_id.value(), {})).substr(1, 2) + "#4000100000000000",
          milliseconds(20));
    EXPECT_TRUE(s.record->text.back().starts_with("5")) << d.eds << " " << s.record->text.back();
  }
  EXPECT_GT(usable, devices.size() / 2);
  std::printf("%zu of %zu description files became devices\n", usable, devices.size());
}

// The program of a programmable device has declared them: they are objects like any other, by name and mappable.
TEST(PlantWorld, NetworkVariablesOfADevice) {
  auto plc = device("plc", 6);
  plc.eds = plc.eds_path = berth::test::source_dir() + "/examples/eds/controller.eds";
  plc.address_of_eds = true;
  plc.does.variables = {{"speed", od::DataType::unsigned16, {0xA100, 3}},
                        {"run", od::DataType::unsigned8, {0xA4C0, 1}}};
  auto plain = plc;
  plain.name = "plain";
  plain.address.serial = 7;
  plain.does.variables.clear();
  const Scene s(plant({plc, plain}));
  ASSERT_TRUE(s.world);
  const auto& description = s.world->devices()[0]->device().values().description();
  const auto* const speed = description.find(ObjectRef{0xA100, 3});
  ASSERT_NE(speed, nullptr);
  EXPECT_EQ(speed->access, od::Access::ro) << "an input of the network";
  EXPECT_TRUE(speed->mappable);
  EXPECT_EQ(description.name(*speed), "speed");
  EXPECT_EQ(description.find(ObjectRef{0xA4C0, 1})->access, od::Access::rww);
  EXPECT_NE(description.find(ObjectRef{0x1A00, 8}), nullptr) << "and all else of the description";
  EXPECT_EQ(s.world->devices()[1]->device().values().description().find(ObjectRef{0xA100, 3}), nullptr);

  const auto refused = [&](const PlantVariable& variable) {
    plc.does.variables = {variable};
    Findings findings;
    EXPECT_EQ(World::make(plant({plc}), {}, findings), nullptr);
    return findings.empty() ? std::string() : to_string(findings.front());
  };
  EXPECT_NE(refused({"x", od::DataType::unsigned16, {0xA040, 1}}).find("in a segment of UNSIGNED8"), std::string::npos);
  EXPECT_NE(refused({"x", od::DataType::unsigned8, {0x6000, 1}}).find("in no segment"), std::string::npos);
}

TEST(PlantWorld, StateOutlivesTheProcess) {
  const auto file = plant({device("left sensor", 6), device("spare", 7)});
  std::string kept;
  {
    Scene s(file);
    s.run(milliseconds(50));
    s["spare"].unplug();
    for (const char* frame :
         {"7E5#0400000000000000", "7E5#4001000000000000", "7E5#4102000000000000", "7E5#4203000000000000",
          "7E5#4306000000000000", "7E5#1103000000000000", "7E5#1700000000000000"}) {
      s.ask(frame, milliseconds(50));
    }
    EXPECT_EQ(s.record->text.back(), "7E4#1700000000000000");
    s["left sensor"].next_power_on().serial = 66;
    kept = s.world->state();
  }
  Findings findings;
  auto world = World::make(file, {}, findings);
  ASSERT_TRUE(world->restore(kept));
  Record record(*world->bus("b"));
  auto me = world->attach_master("b");
  world->start();
  world->sim().run_for(milliseconds(50));
  EXPECT_EQ(record.text, std::vector<std::string>{"703#00"});
  EXPECT_EQ(world->find("left sensor")->truth().address.serial, 66U);
  EXPECT_FALSE(world->find("spare")->plugged());

  EXPECT_FALSE(world->restore("something else\n"));
  EXPECT_FALSE(world->restore("berth-plant-state 1\n1 2 3\n"));
  EXPECT_FALSE(world->restore("berth-plant-state 1\n"));
  EXPECT_FALSE(world->restore(kept + "1 255 0 1 ff nobody\n"));
  me.reset();
}

TEST(PlantWorld, StateFileIsWrittenWheneverMemoryIs) {
  const auto path = std::filesystem::temp_directory_path() / ("berth-world-test-" + std::to_string(::getpid()));
  std::filesystem::remove(path);
  const auto file = plant({device("a", 6)});
  {
    Findings findings;
    auto world = World::make(file, {}, findings);
    ASSERT_TRUE(world->keep_state(path.string()));
    auto me = world->attach_master("b");
    world->start();
    world->sim().run_for(milliseconds(50));
    const auto before = std::filesystem::file_size(path);
    EXPECT_GT(before, 20U);
    for (const char* frame : {"7E5#0401000000000000", "7E5#1103000000000000", "7E5#1700000000000000"}) {
      me->send(*can::parse_frame(frame), 0);
    }
    world->sim().run_for(milliseconds(100));
    me.reset();
  }  // as if killed: nothing is written at the end
  Findings findings;
  auto world = World::make(file, {}, findings);
  ASSERT_TRUE(world->keep_state(path.string()));
  EXPECT_EQ(world->truth()[0].persistent, NodeId(3));
  { std::ofstream(path) << "rubbish"; }
  auto other = World::make(file, {}, findings);
  EXPECT_FALSE(other->keep_state(path.string()));
  std::filesystem::remove(path);
}

TEST(PlantWorld, MemoryCannotBeKeptWhereNoFileCanBe) {
  Findings findings;
  auto world = World::make(plant({device("a", 1)}), {}, findings);
  ASSERT_TRUE(world);
  EXPECT_FALSE(world->keep_state(std::filesystem::temp_directory_path().string()));
  EXPECT_FALSE(world->keep_state("/no such folder/state"));
}

// One seed, one world: identical to the bit; with latencies, outliers and 40 devices.
TEST(PlantWorld, OneSeedGivesOneWorld) {
  const auto hash = [](std::uint64_t seed) {
    auto p = plant({});
    p.seed = seed;
    for (std::uint32_t i = 1; i <= 40; ++i) {
      auto d = device("d" + std::to_string(i), i, static_cast<std::uint8_t>(i));
      d.response = {microseconds(100), milliseconds(3), 50'000, milliseconds(20)};
      d.heartbeat = milliseconds(50 + i);
      p.devices.push_back(d);
    }
    Scene s(p);
    for (unsigned i = 0; i < 50; ++i) {
      s.ask("1F940000#80000000", milliseconds(7));
      s.ask("000#0100", milliseconds(3));
    }
    return s.world->sim().trace_hash();
  };
  EXPECT_EQ(hash(1), hash(1));
  EXPECT_NE(hash(1), hash(2));
}

}  // namespace
}  // namespace berth::plant::world_tests
