// A plant file's device on a port of somebody else's; here the port is a controller of a simulated bus without a world
// of devices around it, so that it can be compared with the same device in one.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <algorithm>
#include <chrono>
#include <fstream>
#include <string>
#include <vector>

#include <filesystem>

#include "../pch.hpp"
#include "berth/plant/port_device.hpp"
#include "berth/plant/world.hpp"
#include "record.hpp"

namespace berth::plant {
namespace {

using std::chrono::milliseconds;

/// What is said to the devices in both worlds.
void talk(sim::World& world, sim::Controller& me) {
  world.run_for(milliseconds(50));
  for (const char* const frame : {"000#0105", "605#4018100400000000", "605#2B17100064000000", "7E5#0401000000000000",
                                  "7E5#1107000000000000", "7E5#1700000000000000", "7E5#0400000000000000"}) {
    me.send(*can::parse_frame(frame), 0);
    world.run_for(milliseconds(150));
  }
}

struct Scene {
  explicit Scene(const std::vector<PlantDevice>& plans, PortDevices::Observer* observer = nullptr)
      : bus(world.add_bus("b", 250'000)), devices(world.executor(), observer) {
    for (const auto& plan : plans) devices.add(plan, bus.attach(), 250'000, Random(1), findings);
    me = bus.attach();
    record = std::make_unique<Record>(bus);
  }
  void start() {
    for (const auto& d : devices.all()) d->power(true);
    world.run_for(milliseconds(50));
  }
  void ask(std::string_view frame) {
    me->send(*can::parse_frame(frame), 0);
    world.run_for(milliseconds(100));
  }
  sim::World world{1};
  sim::Bus& bus;
  Findings findings;
  PortDevices devices;
  std::unique_ptr<sim::Controller> me;
  std::unique_ptr<Record> record;
};

TEST(PortDevices, IsToTheNanosecondTheDeviceOfASimulatedBus) {
  PlantFile file;
  file.buses.push_back({"b", 250'000});
  file.devices.push_back(device("a", 9, 5));
  Findings findings;
  const auto world = World::make(file, {}, findings);
  ASSERT_TRUE(world);
  std::vector<std::string> want;
  std::vector<rt::Time> when;
  {
    Record record(*world->bus("b"));
    const auto me = world->attach_master("b");
    world->start();
    talk(world->sim(), *me);
    want = record.text;
    when = record.times;
  }
  Scene s(file.devices);
  for (const auto& d : s.devices.all()) d->power(true);
  talk(s.world, *s.me);
  EXPECT_TRUE(s.record->has("585#4318100409000000"));
  EXPECT_TRUE(s.record->has("7E4#1700000000000000"));
  EXPECT_EQ(s.record->text, want);
  EXPECT_EQ(s.record->times, when);
}

TEST(PortDevices, WhatTheyRememberOutlivesThemAndOthersLinesStay) {
  std::string state;
  {
    Scene s({device("a", 9), device("b", 10, 6)});
    s.start();
    for (const char* const frame : {"7E5#4001000000000000", "7E5#4102000000000000", "7E5#4203000000000000",
                                    "7E5#4309000000000000", "7E5#1107000000000000", "7E5#1700000000000000"}) {
      s.ask(frame);
    }
    EXPECT_TRUE(s.record->has("7E4#4400000000000000"));
    EXPECT_TRUE(s.record->has("7E4#1700000000000000"));
    state = s.devices.state();
  }
  {
    Scene s({device("a", 9)});
    ASSERT_TRUE(s.devices.restore(state));
    EXPECT_EQ(s.devices.state().find("b\n") == std::string::npos, false);
    s.start();
    EXPECT_TRUE(s.record->has("707#00")) << "the stored node-ID counts";
    state = s.devices.state();
  }
  PlantFile file;
  file.buses.push_back({"b", 250'000});
  file.devices = {device("a", 9), device("b", 10, 6)};
  Findings findings;
  const auto world = World::make(file, {}, findings);
  ASSERT_TRUE(world);
  ASSERT_TRUE(world->restore(state)) << "a simulated bus takes the same form";
  EXPECT_EQ(world->find("a")->truth().persistent, NodeId(7));
  EXPECT_EQ(world->find("b")->truth().persistent, NodeId(6));
}

TEST(PortDevices, ADamagedStateIsRefused) {
  Scene s({device("a", 9)});
  EXPECT_FALSE(s.devices.restore(""));
  EXPECT_FALSE(s.devices.restore("something else\n"));
  EXPECT_FALSE(s.devices.restore("berth-plant-state 1\n1 2 3\n"));
  EXPECT_FALSE(s.devices.keep_state("/nowhere/at/all"));
}

struct Notes final : PortDevices::Observer {
  void device_changed(const PortDevice& d) noexcept override { last = d.device().node_id(); }
  void state_not_kept() noexcept override { ++not_kept; }
  void script_told(const PortDevice& d, const script::Message& told) noexcept override {
    said.push_back(d.name() + ": " + to_string(told));
  }
  NodeId last;
  int not_kept = 0;
  std::vector<std::string> said;
};

/// A folder with one script; device "a" with it.
struct WithScript {
  explicit WithScript(const std::string& text) {
    std::filesystem::create_directory(folder);
    std::ofstream(file) << text;
    plan.does.script.file = file;
  }
  ~WithScript() { std::filesystem::remove_all(folder); }
  std::string folder = (std::filesystem::temp_directory_path() / fmt::format("berth-script-{}", ::getpid())).string();
  std::string file = folder + "/a.lua";
  PlantDevice plan = device("a", 9, 5);
};

constexpr const char* lively = R"(device.on_state(function(state)
  if state == "operational" then
    print("runs at", device.now())
    device.every(10, function() device.emcy(0xFF01, 1, 7); device.clear_emcy(0xFF01) end)
  end
end)
)";

TEST(PortDevices, RunTheirScriptsAsOnASimulatedBus) {
  const WithScript scripted(lively);
  PlantFile file;
  file.buses.push_back({"b", 250'000});
  file.devices.push_back(scripted.plan);
  Findings findings;
  std::vector<std::string> want;
  std::vector<rt::Time> when;
  {
    const auto world = World::make(file, {}, findings);
    ASSERT_TRUE(world);
    Record record(*world->bus("b"));
    const auto me = world->attach_master("b");
    world->start();
    talk(world->sim(), *me);
    want = record.text;
    when = record.times;
  }
  Notes notes;
  Scene s(file.devices, &notes);
  ASSERT_EQ(s.devices.all().size(), 1U);
  for (const auto& d : s.devices.all()) d->power(true);
  talk(s.world, *s.me);
  EXPECT_GE(s.record->count("085#01FF010700000000"), 10) << "the script runs";
  EXPECT_EQ(s.record->text, want);
  EXPECT_EQ(s.record->times, when);
  ASSERT_EQ(notes.said.size(), 1U);
  EXPECT_TRUE(notes.said.front().starts_with("a: runs at")) << notes.said.front();
  // Without power it does nothing.
  s.devices.all().front()->power(false);
  const auto before = s.record->text.size();
  s.world.run_for(milliseconds(500));
  EXPECT_EQ(s.record->text.size(), before);
  s.start();
  s.ask("000#0100");
  EXPECT_EQ(notes.said.size(), 2U) << "it begins anew";
}

TEST(PortDevices, AScriptThatFailsIsTold) {
  const WithScript scripted("device.on_state(function(state)\n  if state == 'operational' then nothing() end\nend)\n");
  Notes notes;
  Scene s({scripted.plan}, &notes);
  s.start();
  s.ask("000#0105");
  ASSERT_EQ(notes.said.size(), 1U);
  EXPECT_NE(notes.said.front().find("a.lua:2"), std::string::npos) << notes.said.front();
  EXPECT_TRUE(s.record->has("085#0062010200000000")) << "EMCY 6200h with the line";
}

TEST(PortDevices, AScriptThatDoesNotCompileIsRefused) {
  const WithScript scripted("if 1 print(2)\n");
  Scene s({scripted.plan});
  EXPECT_TRUE(s.devices.all().empty());
  ASSERT_EQ(s.findings.size(), 1U);
  EXPECT_EQ(s.findings.front().severity, Finding::Severity::error);
  EXPECT_EQ(s.findings.front().line, 1);
  PlantDevice lost = device("a", 9, 5);
  lost.does.script.file = scripted.folder + "/none.lua";
  Scene none({lost});
  EXPECT_TRUE(none.devices.all().empty());
  EXPECT_TRUE(has_errors(none.findings));
}

TEST(PortDevices, TheFileIsWrittenWhenADeviceStoresAndALostFolderIsTold) {
  const auto folder = std::filesystem::temp_directory_path() / fmt::format("berth-port-devices-{}", ::getpid());
  std::filesystem::create_directory(folder);
  const auto path = folder / "state";
  Notes notes;
  Scene s({device("a", 9, 5)}, &notes);
  ASSERT_TRUE(s.devices.keep_state(path.string()));
  EXPECT_FALSE(std::filesystem::exists(path)) << "nothing is to be kept yet";
  s.start();
  EXPECT_EQ(notes.last, NodeId(5));
  s.ask("7E5#0401000000000000");
  s.ask("7E5#1107000000000000");
  s.ask("7E5#1700000000000000");
  ASSERT_TRUE(std::filesystem::exists(path));
  EXPECT_EQ(notes.not_kept, 0);
  std::filesystem::remove_all(folder);
  s.ask("7E5#1700000000000000");
  EXPECT_EQ(notes.not_kept, 1);
  s.devices.all().front()->power(false);
  EXPECT_EQ(notes.last, NodeId()) << "without power it has none";
}

}  // namespace
}  // namespace berth::plant
