// The heartbeats that Berth asks for fit the bus, or the machine file is refused before anything is sent.
#include <gtest/gtest.h>
#include <chrono>
#include <string>

#include "berth/design/machine.hpp"
#include "tests/pch.hpp"

namespace berth::design {
namespace {

using namespace std::chrono_literals;

std::string machine_of(unsigned slots, unsigned kbit, const std::string& timing = {}) {
  return "[machine]\nname = \"m\"\n" + timing + "[bus.b]\nport = \"sim\"\nbitrate = " + std::to_string(kbit * 1000) +
         "\n[[slot]]\nbus = \"b\"\nids = \"1.." + std::to_string(slots) +
         "\"\nname = \"s{id}\"\ntype = { vendor = 1, product = 2 }\n";
}

Timing timing_of(const std::string& text) {
  const auto result = read_machine(text, "m.toml", {});
  for (const auto& f : result.findings) ADD_FAILURE() << to_string(f);
  return result.machine ? result.machine->buses.front().timing : Timing{};
}

// By hand: 127 nodes of 65 bits are 8,255 bits; a fifth of 10 kbit/s is 2,000 bits a second.
TEST(Heartbeats, ThePeriodFollowsFromRateAndNumberOfNodes) {
  EXPECT_EQ(timing_of(machine_of(126, 10)).heartbeat_period, 4200ms);
  EXPECT_EQ(timing_of(machine_of(126, 10)).heartbeat_timeout, 12600ms);
  EXPECT_EQ(timing_of(machine_of(126, 50)).heartbeat_period, 900ms);
  EXPECT_EQ(timing_of(machine_of(126, 125)).heartbeat_period, 500ms);
  EXPECT_EQ(timing_of(machine_of(10, 10)).heartbeat_period, 500ms);
  EXPECT_EQ(timing_of(machine_of(10, 10)).heartbeat_timeout, 1500ms);
}

TEST(Heartbeats, AGivenPeriodStandsWhenTheBusCarriesIt) {
  const auto timing = timing_of(machine_of(126, 50, "[timing]\nheartbeat_period = \"400 ms\"\n"));
  EXPECT_EQ(timing.heartbeat_period, 400ms);
  EXPECT_EQ(timing.heartbeat_timeout, 1200ms);
}

TEST(Heartbeats, APeriodThatTheBusCannotCarryIsRefusedInWords) {
  const auto result = read_machine(machine_of(126, 10, "[timing]\nheartbeat_period = \"500 ms\"\n"), "m.toml", {});
  EXPECT_FALSE(result.machine);
  ASSERT_EQ(result.findings.size(), 1U);
  const std::string text = to_string(result.findings.front());
  EXPECT_NE(text.find("127 heartbeats every 500 ms take 165 % of a bus at 10 kbit/s"), std::string::npos) << text;
  EXPECT_NE(text.find("at least 4200 ms"), std::string::npos) << text;
}

}  // namespace
}  // namespace berth::design
