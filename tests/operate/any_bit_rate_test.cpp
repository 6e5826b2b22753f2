// A bus has the bit rate that its devices have, whether CiA 301 knows it or not.
#include <gtest/gtest.h>
#include <string>

#include "berth/design/machine.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;

namespace bit_rate_tests {
namespace {

design::MachineResult read(const std::string& rate) {
  return design::read_machine("[machine]\nname = \"m\"\n[bus.b]\nport = \"sim\"\nbitrate = " + rate +
                                  "\n[[slot]]\nbus = \"b\"\nid = 5\nname = \"d\"\ntype = { vendor = 1, product = 1 }\n",
                              "m.toml", {});
}

}  // namespace

TEST(AnyBitRate, OneThatCia301DoesNotHaveIsTakenWithAWarning) {
  for (const std::uint32_t rate : {5'000U, 33'333U, 83'333U, 100'000U, 615'384U}) {
    const auto result = read(std::to_string(rate));
    ASSERT_TRUE(result.machine) << rate;
    EXPECT_EQ(result.machine->buses.front().bitrate, rate);
    ASSERT_EQ(result.findings.size(), 1U) << rate;
    EXPECT_EQ(result.findings.front().severity, Finding::Severity::warning);
    EXPECT_NE(to_string(result.findings.front()).find("none of CiA 301's bit rates"), std::string::npos);
  }
  for (const char* const rate : {"10_000", "125_000", "1_000_000"}) EXPECT_TRUE(read(rate).findings.empty()) << rate;
}

TEST(AnyBitRate, WhatClassicCanCannotDoIsRefused) {
  for (const char* const rate : {"0", "-5", "4_999", "1_000_001", "8_000_000"})
    EXPECT_FALSE(read(rate).machine) << rate;
  const auto kilo = read("100");
  ASSERT_FALSE(kilo.machine);
  EXPECT_NE(to_string(kilo.findings.front()).find("write 100_000"), std::string::npos);
}

TEST(AnyBitRate, MachinesRunAtEach) {
  for (const std::uint32_t rate : {33'333U, 83'333U, 100'000U, 615'384U}) {
    design::Machine machine = one_bus(rate);
    auto p = one_bus_plant(1);
    for (unsigned id = 1; id <= 5; ++id) {
      add_slot(machine, id, type_b);
      add_device(p, "d" + std::to_string(id), type_b, 100 + id);
    }
    Rig rig(machine, p);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << rate << rig.log();
    rig.run_for(20s);
    EXPECT_TRUE(rig.operational()) << rate << rig.log();
  }
}

// ---- a bus on which no extended frame may be sent ----

namespace {

class ExtendedFrames final : public can::Tap {
 public:
  unsigned count = 0;

 private:
  void frame(const can::Frame& frame, rt::Time, int) noexcept override { count += frame.extended ? 1U : 0U; }
};

}  // namespace

TEST(ExtendedFrames, NoneIsSentWhereTheMachineFileSaysSo) {
  for (const bool allowed : {false, true}) {
    design::Machine machine = one_bus(125'000);
    machine.buses.front().extended_frames = allowed;
    auto p = one_bus_plant(1);
    for (unsigned id = 1; id <= 5; ++id) {
      add_slot(machine, id, type_b);
      add_device(p, "d" + std::to_string(id), type_b, 100 + id).speaks = {plant::Speaks::lss, plant::Speaks::fastscan};
    }
    Rig rig(machine, p);
    ExtendedFrames heard;
    rig.world().bus("backbone")->add_tap(heard);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    rig.device("d3").unplug();
    rig.run_for(10s);
    rig.device("d3").plug();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    rig.kill();
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    rig.run_for(10s);
    const bool any = heard.count > 0;
    EXPECT_EQ(any, allowed) << heard.count;
    rig.world().bus("backbone")->remove_tap(heard);
  }
}

// A controller of CAN 2.0A answers each with an error frame. The first one tells it, and is the only one.
TEST(ExtendedFrames, ABusThatTakesNoneIsFoundOut) {
  for (const std::uint32_t rate : {10'000U, 125'000U, 1'000'000U}) {
    auto p = one_bus_plant(1);
    design::Machine machine = one_bus(rate);
    for (unsigned id = 2; id <= 5; ++id) {
      add_slot(machine, id, type_b);
      auto& d = add_device(p, "d" + std::to_string(id), type_b, 100 + id);
      if (id == 3) d.controller.extended_frames = false;
    }
    Rig rig(machine, p);
    ExtendedFrames heard;
    rig.world().bus("backbone")->add_tap(heard);
    rig.begin();
    ASSERT_TRUE(rig.until_operational(200s)) << rate << "\n" << rig.log();
    rig.device("d4").unplug();
    rig.run_for(10s);
    rig.device("d4").plug();
    ASSERT_TRUE(rig.until_operational(100s)) << rate << "\n" << rig.log();
    rig.run_for(10s);
    EXPECT_EQ(heard.count, 0U) << rate;
    const std::string log = rig.log();
    EXPECT_NE(log.find("a device with a controller of CAN 2.0A is on the bus"), std::string::npos) << log;
    const auto off = log.find("this port is bus-off");
    ASSERT_NE(off, std::string::npos) << log;
    EXPECT_EQ(log.find("this port is bus-off", off + 1), std::string::npos) << log;
    rig.world().bus("backbone")->remove_tap(heard);
  }
}

TEST(ExtendedFrames, AMethodThatIsMadeOfThemIsRefusedBeside) {
  for (const char* const method : {"rand", "planner-rand", "fastscan-feedback-29", "planner-feedback"}) {
    const auto result = design::read_machine(
        "[machine]\nname = \"m\"\n[bus.b]\nport = \"sim\"\nbitrate = 125_000\n"
        "extended_frames = false\ndiscovery = \"" +
            std::string(method) + "\"\n",
        "m.toml", {});
    ASSERT_FALSE(result.machine) << method;
    EXPECT_EQ(to_string(result.findings.front()).find("m.toml:6:19: error: bus.b.extended_frames:"), 0U)
        << to_string(result.findings.front());
  }
}

}  // namespace bit_rate_tests
