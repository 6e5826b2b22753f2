// The process image: what is declared, whole snapshots across two threads, and a device's dictionary behind it.
#include <gtest/gtest.h>

#include <chrono>
#include <thread>
#include <vector>

#include "../pch.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/process/device_image.hpp"
#include "berth/process/image.hpp"
#include "berth/sim/world.hpp"
#include "scene.hpp"

namespace berth::process {
namespace {

using od::DataType;
using std::chrono::milliseconds;

TEST(Layout, VariablesStandAtMultiplesOfTheirSizeByDirection) {
  Layout layout;
  const auto a = layout.output<bool>("a");
  const auto b = layout.output<std::int32_t>("b");
  const auto c = layout.input<std::uint16_t>("c");
  EXPECT_EQ(a.offset(), 0U);
  EXPECT_EQ(b.offset(), 4U);
  EXPECT_EQ(c.offset(), 0U);
  EXPECT_EQ(layout.size(Direction::output), 8U);
  EXPECT_EQ(layout.size(Direction::input), 2U);
  EXPECT_EQ(layout.find("b")->type, DataType::integer32);
}

TEST(Layout, WhatCannotBeDeclaredIsToldAndReadsZero) {
  Layout layout;
  (void)layout.output<std::uint32_t>("a");
  const auto twice = layout.output<std::uint8_t>("a");
  EXPECT_FALSE(twice.valid());
  EXPECT_FALSE(layout.declare_at("b", DataType::unsigned16, Direction::output, 3));
  EXPECT_TRUE(layout.declare_at("b", DataType::unsigned16, Direction::output, 4));
  EXPECT_TRUE(layout.declare_at("c", DataType::unsigned16, Direction::input, 3)) << "another part";
  EXPECT_FALSE(layout.declare("d", DataType::visible_string, Direction::output));
  EXPECT_FALSE(layout.declare_at("e", DataType::unsigned8, Direction::output, 0xFFFF'FFFF));
  const std::vector<std::string> told(layout.problems().begin(), layout.problems().end());
  const std::vector<std::string> expected{
      "\"a\" is declared already; declare it once", "\"b\" at offset 3 has bytes of \"a\" at 0",
      "\"d\": a variable of the image is a number or BOOLEAN", "\"e\": offset 4294967295 is beyond 1 MiB"};
  EXPECT_EQ(told, expected);
  Image image(layout);
  image.network().set(twice, std::uint8_t{9});
  image.network().publish();
  EXPECT_TRUE(image.application().refresh());
  EXPECT_EQ(image.application().get(twice), 0);
}

TEST(Image, TheApplicationSeesOnlyWhatWasPublished) {
  Layout layout;
  const auto level = layout.output<std::int16_t>("level");
  Image image(layout);
  image.network().set(level, std::int16_t{-5});
  EXPECT_FALSE(image.application().refresh());
  EXPECT_EQ(image.application().get(level), 0);
  image.network().publish();
  image.network().set(level, std::int16_t{7});
  EXPECT_TRUE(image.application().refresh());
  EXPECT_EQ(image.application().get(level), -5);
  EXPECT_FALSE(image.application().refresh()) << "once";
}

TEST(Image, ASnapshotStaysAsItIsUntilTheNextRefresh) {
  Layout layout;
  const auto level = layout.output<std::int16_t>("level");
  Image image(layout);
  for (std::int16_t n = 1; n <= 9; ++n) {
    const std::int16_t before = image.application().get(level);
    for (std::int16_t i = 0; i < 5; ++i) {
      image.network().set(level, static_cast<std::int16_t>(10 * n + i));
      image.network().publish();
      ASSERT_EQ(image.application().get(level), before);
    }
    ASSERT_TRUE(image.application().refresh());
    ASSERT_EQ(image.application().get(level), 10 * n + 4) << "the newest";
  }
}

// S5.25: both ways at once: every snapshot is of one publication, none is older than the one before, and the last one
// arrives.
TEST(Image, SnapshotsAcrossThreadsAreNeverTorn) {
  constexpr std::uint64_t last = 20'000;
  constexpr int many = 280;
  Layout layout;
  std::vector<Output<std::uint64_t>> out;
  std::vector<Input<std::uint64_t>> in;
  for (int i = 0; i < many; ++i) {
    out.push_back(layout.output<std::uint64_t>("out " + std::to_string(i)));
    in.push_back(layout.input<std::uint64_t>("in " + std::to_string(i)));
  }
  Image image(layout);
  std::uint64_t torn = 0;
  std::uint64_t old = 0;
  std::thread application([&] {
    auto& mine = image.application();
    for (std::uint64_t seen = 0; seen < last;) {
      if (!mine.refresh()) {
        std::this_thread::yield();
        continue;
      }
      const auto now = mine.get(out[0]);
      for (const auto& variable : out) torn += mine.get(variable) != now ? 1 : 0;
      if (now <= seen) ++old;
      seen = now;
      for (const auto& variable : in) mine.set(variable, now);
      mine.commit();
    }
  });
  auto& mine = image.network();
  std::uint64_t torn_inputs = 0;
  for (std::uint64_t n = 1; n <= last; ++n) {
    for (const auto& variable : out) mine.set(variable, n);
    mine.publish();
    if (!mine.take()) continue;
    for (const auto& variable : in) torn_inputs += mine.get(variable) != mine.get(in[0]) ? 1 : 0;
  }
  application.join();
  EXPECT_EQ(torn, 0U);
  EXPECT_EQ(torn_inputs, 0U);
  EXPECT_EQ(old, 0U);
  mine.take();
  EXPECT_EQ(mine.get(in[many - 1]), last);
}

// Direction as the network sees it: an input variable goes out by a TPDO, an output variable comes by an RPDO (S5.7).
TEST(DeviceImage, S5_7_InputVariablesAreSentAndOutputVariablesReceived) {
  Scene s;
  Layout layout;
  const auto first = layout.output<std::uint8_t>("first");
  const auto second = layout.output<std::uint8_t>("second");
  const auto motor = layout.input<std::uint8_t>("motor");
  Image image(layout);
  const std::vector<Bound> bound{{"first", {0xA4C0, 1}}, {"second", {0xA4C0, 2}}, {"motor", {0xA040, 1}}};
  DeviceImage link(*s.device, s.world.executor(), image.network(), bound, {.cycle = milliseconds(2)});
  EXPECT_TRUE(link.problems().empty());
  Scene::Tap tap;
  s.bus.add_tap(tap);
  s.device->power_on();
  s.run();
  s.send("000#0105");
  s.send("205#1122");
  EXPECT_TRUE(image.application().refresh());
  EXPECT_EQ(image.application().get(first), 0x11);
  EXPECT_EQ(image.application().get(second), 0x22);
  image.application().set(motor, std::uint8_t{0x33});
  s.run();
  EXPECT_EQ(std::ranges::count(tap.text, "185#33"), 0) << "not committed yet";
  image.application().commit();
  s.run();
  EXPECT_EQ(std::ranges::count(tap.text, "185#33"), 1);
  image.application().commit();
  s.run();
  EXPECT_EQ(std::ranges::count(tap.text, "185#33"), 1) << "nothing has changed";
  s.bus.remove_tap(tap);
}

TEST(DeviceImage, WhatDoesNotFitIsTold) {
  Scene s;
  Layout layout;
  (void)layout.output<std::uint16_t>("wide");
  Image image(layout);
  const std::vector<Bound> bound{{"wide", {0xA4C0, 1}}, {"none", {0xA4C0, 1}}, {"wide", {0xA4C0, 9}}};
  DeviceImage link(*s.device, s.world.executor(), image.network(), bound, {});
  const std::vector<std::string> told(link.problems().begin(), link.problems().end());
  const std::vector<std::string> expected{"\"wide\" is UNSIGNED16, A4C0h:01 is UNSIGNED8; declare it so",
                                          "\"none\" is not a variable of the image; declare it",
                                          "\"wide\": the device has no object A4C0h:09"};
  EXPECT_EQ(told, expected);
}

}  // namespace
}  // namespace berth::process
