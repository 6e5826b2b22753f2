// How long the default waits for answers to RAND, where devices are slow or the bus is: what it asks is counted.
#include <gtest/gtest.h>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;

namespace rand_windows_tests {
namespace {

// Three types as a plant has them: neighbours, and one serial number under each upper half.
Rig plant_of(unsigned count, std::uint32_t bit_rate, plant::Latency response) {
  design::Machine m = one_bus(bit_rate);
  auto p = one_bus_plant(1045);
  constexpr std::array<TypeCode, 3> types{TypeCode{0x64, 1}, TypeCode{0x64, 2}, TypeCode{0x65, 3}};
  for (unsigned i = 0; i < count; ++i) {
    const auto kind = i % types.size();
    add_slot(m, i + 1, types.at(kind));
    const auto serial = kind == 0 ? 0x110E'C0A8 + 16 * i : 0x3C7A'46E5 + 0x1'0000 * i;
    auto& device = add_device(p, "d" + std::to_string(i), types.at(kind), serial);
    device.speaks = {plant::Speaks::lss, plant::Speaks::rand};
    device.response = response;
  }
  return {m, p};
}

// The requests of the first search when it found every device; 0: it did not.
unsigned requests_for_all(unsigned count, std::uint32_t bit_rate, plant::Latency response) {
  Rig rig = plant_of(count, bit_rate, response);
  std::string log;
  rig.on_event([&](const operate::Event& e) {
    if (e.text.starts_with("discovery: ") && log.empty()) log = e.text;
  });
  rig.begin();
  if (!rig.run_until([&] { return !log.empty(); }, 600s)) return 0;
  const std::string all = "discovery: " + std::to_string(count) + " found by planner-rand, ";
  const auto at = log.find(all);
  if (at == std::string::npos) return 0;
  return static_cast<unsigned>(std::strtoul(log.c_str() + at + all.size(), nullptr, 10));
}

constexpr plant::Latency slow{.min = 6ms, .max = 9ms};
constexpr plant::Latency wide{.min = 100us, .max = 9ms};

void expect_fewer_than_published(unsigned count, std::uint32_t bit_rate, plant::Latency response) {
  const auto requests = requests_for_all(count, bit_rate, response);
  EXPECT_GT(requests, 0U) << count << " devices, " << bit_rate << " bit/s: not found at once";
  EXPECT_LE(requests, 9 * count + 3) << count << " devices, " << bit_rate << " bit/s";
}

// An answer is heard at its end, 8 ms after the device was ready at 10 kbit/s.
TEST(RandWindows, AnAnswersOwnFrameIsWaitedFor) {
  for (const std::uint32_t bit_rate : {10'000, 20'000, 50'000}) expect_fewer_than_published(2, bit_rate, slow);
}

// Among many answers the gaps are short, and the next request is for two devices only. Answers to earlier requests hold
// up the awaited one.
TEST(RandWindows, ManySlowDevicesTakeNoMoreRequestsThanPublished) {
  expect_fewer_than_published(60, 10'000, wide);
  expect_fewer_than_published(60, 125'000, wide);
  expect_fewer_than_published(60, 500'000, wide);
}

}  // namespace
}  // namespace rand_windows_tests
