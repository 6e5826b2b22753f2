// `GET /metrics` of a running `berth … --studio`: numbers that follow from what was done to its simulated machine.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <functional>
#include <optional>
#include <string>

#include "../pch.hpp"
#include "../shell.hpp"
#include "../studio/metrics_reader.hpp"
#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

/// Where the page is, by what the program printed.
struct Scraped {
  std::string address;  // http://HOST:PORT/metrics
  std::string token;
};

std::optional<Scraped> scraped(Background& up) {
  if (!up.says("/#token=") || !up.says([](const std::string& said) {
        const auto at = said.find("/#token=");
        return said.find_first_of(" \n", at) != std::string::npos;
      }))
    return std::nullopt;
  const std::string& said = up.said();
  const auto at = said.find("http://"), hash = said.find("/#token=");
  return Scraped{said.substr(at, hash - at) + "/metrics",
                 said.substr(hash + 8, said.find_first_of(" \n", hash) - hash - 8)};
}

/// As a scraper asks. Empty: no answer with status 200.
std::string asked(const std::string& address, const std::string& header) {
  const auto ran = shell(fmt::format("curl -sf -H '{}' '{}'", header, address));
  return ran.status == 0 ? ran.out : std::string();
}

class MetricsCommand : public ::testing::Test {
 protected:
  void begin(const Words& words) {
    up_.emplace(words);
    const auto where = scraped(*up_);
    ASSERT_TRUE(where) << up_->said();
    where_ = *where;
  }
  MetricsPage page() const {
    const auto text = asked(where_.address, "Authorization: Bearer " + where_.token);
    EXPECT_FALSE(text.empty());
    return MetricsPage(text);
  }
  bool until(const std::function<bool(const MetricsPage& page)>& so) const {
    return eventually([&] { return so(page()); });
  }
  std::optional<Background> up_;
  Scraped where_;
};

MetricsPage::Labels of_slot(const std::string& bus, const std::string& name) { return {{"bus", bus}, {"slot", name}}; }

// The plant unplugs s2 and s4 once and plugs two new devices in: one heartbeat lost at each, and one restart, because a
// second device boots at that node-ID.
TEST_F(MetricsCommand, TheDemoLosesTwoHeartbeatsAndGetsTwoDevices) {
  begin({"demo", "--pace", "--studio=127.0.0.1:0"});
  EXPECT_TRUE(asked(where_.address, "Accept: */*").empty()) << "without the token";
  ASSERT_TRUE(until([](const auto& page) {
    return page.value("berth_slot_heartbeats_lost_total", of_slot("field", "s2")) == 1 &&
           page.value("berth_slot_heartbeats_lost_total", of_slot("field", "s4")) == 1 &&
           page.value("berth_slots", {{"bus", "field"}, {"state", "operational"}}) == 5;
  }));
  const auto last = page();
  for (const std::string name : {"s1", "s2", "s3", "s4", "s5"}) {
    const bool replaced = name == "s2" || name == "s4";
    EXPECT_EQ(last.value("berth_slot_heartbeats_lost_total", of_slot("field", name)), replaced ? 1 : 0) << name;
    EXPECT_EQ(last.value("berth_slot_restarts_total", of_slot("field", name)), replaced ? 1 : 0) << name;
    EXPECT_EQ(last.value("berth_slot_emergencies_total", of_slot("field", name)), 0) << name;
    EXPECT_EQ(last.value("berth_slot_operational", of_slot("field", name)), 1) << name;
    EXPECT_EQ(last.value("berth_slot_state", {{"bus", "field"}, {"slot", name}, {"state", "operational"}}), 1) << name;
  }
  EXPECT_EQ(last.value("berth_bus_offs_total", {{"bus", "field"}}), 0);
  EXPECT_GT(last.value("berth_bus_frames_total", {{"bus", "field"}}), 100);
  EXPECT_GT(last.value("berth_bus_busy_seconds_total", {{"bus", "field"}}), 0);
  EXPECT_EQ(last.value("berth_machine_info", {{"machine", "five slaves"}, {"simulated", "true"}}), 1);
}

TEST_F(MetricsCommand, WhatIsDoneToADeviceIsCountedOnce) {
  const Folder folder;
  const std::string socket = folder.file("control");
  begin({"up", folder.write("machine.toml", small_machine), "--sim", folder.write("plant.toml", small_plant),
         "--control", socket, "--studio=127.0.0.1:0", "--studio-open-metrics"});
  EXPECT_FALSE(asked(where_.address, "Accept: */*").empty()) << "--studio-open-metrics";
  const auto right = of_slot("line", "right");
  const auto is_operational = [&](const MetricsPage& page) { return page.value("berth_slot_operational", right) == 1; };
  ASSERT_TRUE(until(is_operational));
  const auto first = page();
  EXPECT_EQ(first.value("berth_slot_heartbeats_lost_total", right), 0);
  const double restarts = *first.value("berth_slot_restarts_total", right);
  const double aborts = *first.value("berth_slot_sdo_aborts_total", right);
  EXPECT_EQ(berth({"sdo", "read", "right", "5555h:00", "--control", socket}).status, 1);
  EXPECT_TRUE(until([&](const auto& page) { return page.value("berth_slot_sdo_aborts_total", right) == aborts + 1; }));
  ASSERT_EQ(berth({"nmt", "reset", "right", "--control", socket}).status, 0);
  EXPECT_TRUE(until([&](const auto& page) {
    return is_operational(page) && page.value("berth_slot_restarts_total", right) == restarts + 1;
  }));
  ASSERT_EQ(berth({"sim", "unplug", "right", "--control", socket}).status, 0);
  EXPECT_TRUE(until([&](const auto& page) { return page.value("berth_slot_heartbeats_lost_total", right) == 1; }));
  EXPECT_EQ(page().value("berth_slot_state", {{"bus", "line"}, {"slot", "right"}, {"state", "absent"}}), 1);
  EXPECT_EQ(page().value("berth_slot_heartbeats_lost_total", of_slot("line", "left")), 0);
}

TEST(MetricsOption, BelongsToStudio) {
  const Folder folder;
  const auto out = berth({"up", folder.write("machine.toml", small_machine), "--sim",
                          folder.write("plant.toml", small_plant), "--studio-open-metrics"});
  EXPECT_EQ(out.status, 2);
  EXPECT_NE(out.err.find("--studio-open-metrics are for --studio"), std::string::npos) << out.err;
}

}  // namespace
}  // namespace berth::test
