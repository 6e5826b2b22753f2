// What an application learns beside the values: whether and when each was received, its device's diagnosis, and what
// becomes of an application that ends.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <vector>

#include "../pch.hpp"
#include "berth/process/device_image.hpp"
#include "scene.hpp"

namespace berth::process {
namespace {

using std::chrono::milliseconds;

/// When the last frame of this text was on the bus.
struct Times final : can::Tap {
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    if (can::to_string(frame) == wanted) last = at;
  }
  std::string wanted;
  rt::Time last = rt::never;
};

struct Linked {
  explicit Linked(std::uint16_t deadline_ms, const DeviceImage::Options& options) : scene(deadline_ms) {
    auto with = options;
    with.port = scene.port.get();
    const std::vector<Bound> bound{{"first", {0xA4C0, 1}}, {"second", {0xA4C0, 2}}, {"motor", {0xA040, 1}}};
    link.emplace(*scene.device, scene.world.executor(), image.network(), bound, with);
    scene.bus.add_tap(tap);
    scene.device->power_on();
    scene.run();
  }
  ~Linked() { scene.bus.remove_tap(tap); }
  [[nodiscard]] auto frames(std::string_view text) const { return std::ranges::count(tap.text, text); }
  void to(rt::Duration time) { scene.world.run_until(rt::Time(time)); }

  Scene scene;
  Layout layout;
  Output<std::uint8_t> first = layout.output<std::uint8_t>("first");
  Output<std::uint8_t> second = layout.output<std::uint8_t>("second");
  Input<std::uint8_t> motor = layout.input<std::uint8_t>("motor");
  Image image{layout};
  ApplicationSide& mine = image.application();
  std::optional<DeviceImage> link;
  Scene::Tap tap;
};

TEST(DeviceImage, AnOutputSaysWhetherAndWhenItWasReceived) {
  Linked l(20, {.cycle = milliseconds(2)});
  Times times;
  times.wanted = "205#1122";
  l.scene.bus.add_tap(times);
  l.scene.send("000#0105");
  EXPECT_TRUE(l.mine.refresh());
  EXPECT_EQ(l.mine.validity(l.first), BERTH_WAITING);
  EXPECT_EQ(l.mine.age(l.first), std::nullopt);

  l.scene.send("205#1122");
  l.to(milliseconds(16));  // a cycle
  EXPECT_TRUE(l.mine.refresh());
  EXPECT_EQ(l.mine.validity(l.first), BERTH_GOOD);
  EXPECT_EQ(l.mine.validity(l.second), BERTH_GOOD);
  EXPECT_EQ(l.mine.age(l.second), rt::Time(milliseconds(16)) - times.last);

  // Its deadline passes: 20 ms behind the frame.
  l.to(times.last.time_since_epoch() + milliseconds(20) - std::chrono::microseconds(1));
  l.mine.refresh();
  EXPECT_EQ(l.mine.validity(l.first), BERTH_GOOD);
  l.to(times.last.time_since_epoch() + milliseconds(20));
  EXPECT_TRUE(l.mine.refresh());
  EXPECT_EQ(l.mine.validity(l.first), BERTH_SILENT);
  EXPECT_EQ(l.mine.get(l.first), 0x11) << "the value stays";
  EXPECT_EQ(l.mine.age(l.first), milliseconds(20));

  l.scene.send("205#1122");
  EXPECT_TRUE(l.mine.refresh());
  EXPECT_EQ(l.mine.validity(l.first), BERTH_GOOD);

  // Nothing is received in other states than operational.
  l.scene.send("000#8005");
  EXPECT_TRUE(l.mine.refresh());
  EXPECT_EQ(l.mine.validity(l.first), BERTH_WAITING);
  l.scene.send("000#0105");
  l.mine.refresh();
  EXPECT_EQ(l.mine.validity(l.first), BERTH_WAITING) << "not since then";
  l.scene.bus.remove_tap(times);
}

TEST(DeviceImage, AnApplicationThatEndsIsToldAndItsValuesEnd) {
  Linked l(0, {.cycle = milliseconds(2), .application_timeout = milliseconds(10)});
  l.scene.send("000#0105");
  l.scene.run(milliseconds(50));
  EXPECT_EQ(l.frames("085#0061010000000000"), 0) << "there was none yet";
  for (int i = 0; i < 20; ++i) {
    l.mine.set(l.motor, std::uint8_t{7});
    l.mine.commit();
    l.scene.run(milliseconds(9));
  }
  EXPECT_EQ(l.frames("185#07"), 1);
  EXPECT_EQ(l.frames("085#0061010000000000"), 0) << "late, and in time";
  EXPECT_FALSE(l.link->lost());

  l.scene.run(milliseconds(20));
  EXPECT_TRUE(l.link->lost());
  EXPECT_EQ(l.frames("085#0061010000000000"), 1);
  EXPECT_EQ(l.frames("185#00"), 2) << "as operational was entered, and now";
  l.scene.run(milliseconds(100));
  EXPECT_EQ(l.frames("085#0061010000000000"), 1) << "once";

  l.mine.commit();
  l.scene.run(milliseconds(4));
  EXPECT_FALSE(l.link->lost());
  EXPECT_EQ(l.frames("085#0000000000000000"), 1);
  EXPECT_EQ(l.frames("185#07"), 2);
}

TEST(DeviceImage, WhoSaysHoldKeepsTheValuesOfALostApplication) {
  Linked l(0, {.cycle = milliseconds(2), .application_timeout = milliseconds(10), .hold = true});
  l.scene.send("000#0105");
  l.mine.set(l.motor, std::uint8_t{7});
  l.mine.commit();
  l.scene.run(milliseconds(40));
  EXPECT_TRUE(l.link->lost());
  EXPECT_EQ(l.frames("085#0061010000000000"), 1);
  EXPECT_EQ(l.scene.device->values().get_or<std::uint8_t>({0xA040, 1}, 0), 7);
}

TEST(DeviceImage, AnErrorOfTheApplicationIsTheDevices) {
  Linked l(0, {.cycle = milliseconds(2), .application_timeout = milliseconds(30)});
  l.scene.send("000#0105");
  l.mine.set_error(0xFF01, 0x81);
  l.scene.run();
  EXPECT_EQ(l.frames("085#01FF810000000000"), 0) << "not committed yet";
  for (int i = 0; i < 3; ++i) {
    l.mine.commit();
    l.scene.run();
  }
  EXPECT_EQ(l.frames("085#01FF810000000000"), 1) << "once";
  EXPECT_EQ(l.scene.device->values().get_or<std::uint8_t>({0x1001, 0}, 0), 0x81);
  // Reset: no error is active any more, and the application still has it.
  auto told = 1;
  for (const auto* const reset : {"000#8105", "000#8205"}) {
    l.scene.send(reset);
    l.scene.run(milliseconds(20));
    l.mine.commit();
    l.scene.run();
    EXPECT_EQ(l.frames("085#01FF810000000000"), ++told) << reset;
  }
  l.mine.set_error(0, 0);
  l.mine.commit();
  l.scene.run();
  EXPECT_EQ(l.frames("085#0000000000000000"), 1);
  EXPECT_EQ(l.scene.device->values().get_or<std::uint8_t>({0x1001, 0}, 0xFF), 0);
}

// S5.23: the diagnosis and error interface: the own device, its bus, the nodes that it supervises.
TEST(DeviceImage, S5_23_TheDiagnosisHasTheDeviceAndItsNodes) {
  Linked l(0, {.cycle = milliseconds(2)});
  l.scene.send("605#2316100132000900");  // 1016h:01: node 9, 50 ms
  l.mine.refresh();
  EXPECT_EQ(l.mine.diagnosis().node_id, 5);
  EXPECT_EQ(l.mine.diagnosis().nmt_state, 127);
  EXPECT_EQ(l.mine.diagnosis().bus_up, 1);
  EXPECT_EQ(l.mine.diagnosis().bus_off, 0);
  EXPECT_EQ(l.mine.diagnosis().nodes[9].nmt_state, 255);
  l.scene.send("000#0105");
  l.scene.send("709#05");
  l.scene.send("089#0042090000000000");
  l.mine.refresh();
  EXPECT_EQ(l.mine.diagnosis().nmt_state, 5);
  EXPECT_EQ(l.mine.diagnosis().nodes[9].nmt_state, 5);
  EXPECT_EQ(l.mine.diagnosis().nodes[9].error_control, BERTH_ALIVE);
  EXPECT_EQ(l.mine.diagnosis().nodes[9].emcy, 0x4200);
  EXPECT_EQ(l.mine.diagnosis().nodes[9].error_register, 9);
  EXPECT_EQ(l.mine.diagnosis().nodes[9].emcy_count, 1U);
  EXPECT_EQ(l.mine.diagnosis().nodes[8].error_control, BERTH_NOT_WATCHED);
  l.scene.run(milliseconds(100));
  l.mine.refresh();
  EXPECT_EQ(l.mine.diagnosis().nodes[9].error_control, BERTH_LOST);
  EXPECT_EQ(l.mine.diagnosis().nodes[9].nmt_state, 255);
  EXPECT_EQ(l.mine.diagnosis().error_register & 0x10, 0x10) << "EMCY 8130h";
}

TEST(DeviceImage, AReactionIsFromTheFirstFrameOfItsSnapshot) {
  Linked l(0, {.cycle = milliseconds(2)});
  Times times;
  times.wanted = "205#0101";
  l.scene.bus.add_tap(times);
  l.scene.send("000#0105");
  l.scene.send("205#0101");
  l.to(milliseconds(20));
  l.mine.refresh();
  l.to(milliseconds(29));
  EXPECT_EQ(l.link->reactions().count, 0U);
  l.mine.commit();
  l.to(milliseconds(30));  // a cycle takes it
  EXPECT_EQ(l.link->reactions().count, 1U);
  EXPECT_EQ(l.link->reactions().longest, rt::Time(milliseconds(30)) - times.last);
  l.mine.commit();
  l.to(milliseconds(40));
  EXPECT_EQ(l.link->reactions().count, 1U) << "to nothing new";
  l.scene.bus.remove_tap(times);
}

}  // namespace
}  // namespace berth::process
