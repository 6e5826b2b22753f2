// S2.1, S2.5: negotiation on FD controllers beside FD traffic. Paper 2's frames are classic extended ones; FD base
// frames that have the same numbers (100h, 200h + n) are no part of it, nor are FD extended ones.
#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/harness/negotiation_world.hpp"

namespace berth::harness {
namespace {

using namespace std::chrono_literals;

can::Frame fd_frame(std::uint32_t id, std::uint8_t size, std::uint8_t value) {
  can::Frame f;
  f.id = id;
  f.fd = true;
  f.brs = true;
  f.size = size;
  f.data.fill(value);
  return f;
}

/// Hears a whole bus: what is negotiation and what is other traffic.
struct Watch final : can::Tap {
  unsigned fd = 0;
  unsigned long_fd = 0;
  unsigned negotiation = 0;
  unsigned wrong = 0;  ///< FD frames that no stranger sent
  int stranger = -1;
  void frame(const can::Frame& frame, rt::Time, int sender) noexcept override {
    if (frame.fd) ++fd;
    if (frame.fd && frame.size == 64) ++long_fd;
    if (frame.fd && sender != stranger) ++wrong;
    if (!frame.fd && frame.extended) ++negotiation;
  }
};

PlantFile fd_plant(unsigned count) {
  auto file = negotiation_plant(250'000);
  file.buses.front().fd_bitrate = 2'000'000;
  for (unsigned i = 0; i < count; ++i) {
    file.devices.push_back(negotiating_device(fmt::format("d{}", i + 1), {0x319, 2, 0x10000, 0x1000 + i}));
    file.devices.back().heartbeat = 1s;
  }
  return file;
}

/// A plant and a stranger that sends FD frames, one each `spacing`, in turn.
struct FdWorld {
  explicit FdWorld(const PlantFile& file) : world(plant::World::make(file, {}, findings)) {
    bus = world->sim().find_bus("line");
    stranger = bus->attach({.name = "stranger", .fd = true});
    watch.stranger = stranger->number();
    bus->add_tap(watch);
  }
  ~FdWorld() { bus->remove_tap(watch); }
  void run(rt::Duration time, std::span<const can::Frame> frames, rt::Duration spacing) {
    const auto end = world->sim().now() + time;
    while (world->sim().now() < end) {
      if (!frames.empty()) stranger->send(frames[next++ % frames.size()], 0);
      world->sim().run_for(spacing);
    }
  }
  Findings findings;
  std::unique_ptr<plant::World> world;
  sim::Bus* bus = nullptr;
  std::unique_ptr<sim::Controller> stranger;
  Watch watch;
  std::size_t next = 0;
};

std::vector<can::Frame> look_alikes(bool extended) {
  std::vector<can::Frame> frames;
  for (const std::uint8_t size : std::array<std::uint8_t, 3>{0, 8, 64}) {
    frames.push_back(fd_frame(0x100, size, 0));
    for (std::uint32_t n = 1; n <= 127; ++n) frames.push_back(fd_frame(0x200 + n, size, 0));
    frames.push_back(fd_frame(0x6FF, 64, 0x55));
  }
  for (auto& frame : frames) frame.extended = extended;
  return frames;
}

// Six devices take 1 to 6, as they do without the strangers: no look-alike counts as a node-ID in use, none as a
// request that is to be answered.
TEST(NegotiationFdWorld, BesideLookAlikes) {
  FdWorld quiet(fd_plant(6));
  quiet.world->start();
  quiet.run(5s, {}, 1ms);
  ASSERT_EQ(negotiation_fault(*quiet.world), "");
  for (const bool extended : {false, true}) {
    SCOPED_TRACE(extended ? "extended" : "base");
    FdWorld w(fd_plant(6));
    w.world->start();
    w.run(1ms, {}, 1ms);  // the devices' controllers take part: they acknowledge
    w.run(15s, look_alikes(extended), 5ms);
    EXPECT_EQ(negotiation_fault(*w.world), "");
    EXPECT_EQ(held(*w.world), held(*quiet.world));
    EXPECT_GT(w.watch.long_fd, 800U);
    EXPECT_EQ(w.watch.wrong, 0U) << "S2.5: a device sends classic frames only";
    EXPECT_GT(w.watch.negotiation, 6U);
    EXPECT_EQ(w.bus->statistics().fd_destroyed, 0U);
  }
}

// All have their node-IDs: an FD 100h, base or extended, is no request; the classic extended one is answered by all.
TEST(NegotiationFdWorld, OnlyTheClassicExtendedRequestIsAnswered) {
  FdWorld w(fd_plant(4));
  w.world->start();
  w.run(6s, {}, 1ms);
  ASSERT_EQ(negotiation_fault(*w.world), "");
  auto extended = fd_frame(0x100, 0, 0);
  extended.extended = true;
  const auto before = w.watch.negotiation;
  w.run(100ms, std::vector{fd_frame(0x100, 0, 0), extended, can::Frame::base(0x100, {})}, 10ms);
  EXPECT_EQ(w.watch.negotiation, before) << "nobody answered";
  w.stranger->send(can::Frame::ext(0x100, {}), 0);
  w.run(100ms, {}, 10ms);
  EXPECT_GE(w.watch.negotiation, before + 5) << "the request and four answers";
}

// The plant file says which bus is an FD bus.
TEST(NegotiationFdWorld, PlantFile) {
  Findings findings;
  const auto world = plant::World::make(fd_plant(1), {}, findings);
  ASSERT_TRUE(world);
  EXPECT_TRUE(world->sim().find_bus("line")->fd());
  EXPECT_EQ(world->sim().find_bus("line")->data_bit_rate(), 2'000'000U);
  ASSERT_NE(world->attach_master("line", {}), nullptr);
  const auto text = plant::write_plant(fd_plant(1));
  EXPECT_NE(text.find("fd_bitrate = 2"), std::string::npos) << text;
}

}  // namespace
}  // namespace berth::harness
