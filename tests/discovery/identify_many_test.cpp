// Plain LSS, many devices: identify ranges find them at every bit rate, in slices, and say how far they are.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>
#include <vector>

#include "berth/discovery/identify.hpp"
#include "discovery_world.hpp"

namespace berth::discovery::test {
namespace {

constexpr TypeCode type{2, 3};
constexpr std::uint32_t revision = 0x0001'0002;

enum class Serials { consecutive, stepped, random };
constexpr device::Timing equal_latency{.response_min = 1ms, .response_max = 1ms};
constexpr device::Timing usual_latency{.response_min = 200us, .response_max = 4ms};
constexpr device::Timing wide_latency{.response_min = 100us, .response_max = 9ms};
constexpr device::Timing slow_outliers{
    .response_min = 200us, .response_max = 2ms, .outlier_per_million = 5'000, .outlier = 8ms};

void add_devices(World& w, unsigned count, Serials serials, const device::Timing& timing) {
  Random numbers = w.random.fork();
  for (unsigned i = 0; i < count; ++i) {
    std::uint32_t serial = static_cast<std::uint32_t>(numbers.next());
    if (serials == Serials::consecutive) serial = 0x0012'3456 + i;
    if (serials == Serials::stepped) serial = 0x0012'3456 + 10 * i;
    w.add({.address = {type.vendor, type.product, revision, serial}, .fastscan = false, .timing = timing});
  }
}

struct Case {
  unsigned devices;
  std::uint32_t bit_rate;
  Serials serials;
  device::Timing timing;
  const char* what;
  bool configured = false;
};

void expect_all_bound(const Case& c) {
  SCOPED_TRACE(c.what);
  World w(c.devices, c.bit_rate);
  add_devices(w, c.devices, c.serials, c.timing);
  w.known.kinds = {{type, revision}};
  w.options.configured = c.configured;
  Giver giver;
  w.options.assigner = &giver;
  w.bus.reset_statistics();
  const auto report = w.find(Method::identify);
  ASSERT_TRUE(report) << describe(report.error());
  EXPECT_EQ(report->end, Report::End::complete) << name(report->end);
  EXPECT_EQ(addresses(*report), addresses(w));
  w.world.run_for(200ms);
  for (const auto& n : w.nodes) EXPECT_TRUE(n->id().configured()) << to_string(n->options.address);
  w.expect_right(giver);
  const auto time = std::chrono::duration<double>(report->ended - report->began).count();
  fmt::print("  {:3} devices, {:4} kbit/s, {}: {:8.3f} s, {} questions, {} frames\n", c.devices, c.bit_rate / 1000,
             c.what, time, report->requests, w.bus.statistics().frames);
}

TEST(IdentifyMany, EverySizeAndRateInARow) {
  for (const unsigned devices : {1U, 2U, 30U, 120U}) {
    for (const std::uint32_t rate : {10'000U, 125'000U, 1'000'000U}) {
      expect_all_bound({devices, rate, Serials::consecutive, usual_latency, "in a row, 0.2 to 4 ms"});
      if (HasFailure()) return;
    }
  }
}
TEST(IdentifyMany, AtEqualSteps) {
  expect_all_bound({60, 125'000, Serials::stepped, usual_latency, "steps of 10, 0.2 to 4 ms"});
  expect_all_bound({120, 10'000, Serials::stepped, equal_latency, "steps of 10, 1 ms"});
  expect_all_bound({126, 500'000, Serials::stepped, slow_outliers, "steps of 10, outliers"});
}
TEST(IdentifyMany, RandomNumbersAndLatencies) {
  expect_all_bound({2, 10'000, Serials::random, usual_latency, "random, 0.2 to 4 ms"});
  expect_all_bound({30, 10'000, Serials::random, equal_latency, "random, 1 ms"});
  expect_all_bound({30, 125'000, Serials::random, usual_latency, "random, 0.2 to 4 ms"});
  expect_all_bound({30, 125'000, Serials::random, wide_latency, "random, 0.1 to 9 ms"});
  expect_all_bound({30, 1'000'000, Serials::random, slow_outliers, "random, outliers"});
  expect_all_bound({30, 125'000, Serials::random, usual_latency, "random, gaps asked at the end", true});
}
// 120 of them with random numbers: what gave up after ten seconds.
TEST(IdentifyMany, OneHundredAndTwentyRandomNumbers) {
  expect_all_bound({120, 125'000, Serials::random, usual_latency, "random, 0.2 to 4 ms"});
}

struct Slices final : Observer {
  void found(const Found& device) noexcept override { list.push_back(device.address); }
  void progress(const Progress& p) noexcept override {
    EXPECT_GE(p.swept, 0.0);
    EXPECT_LE(p.swept, 1.0);
    EXPECT_LT(p.kind, p.kinds);
    last = p;
  }
  bool goes_on() noexcept override { return questions == 0 || --questions > 0; }
  std::vector<LssAddress> list;
  Progress last;
  unsigned questions = 0;  // left in this slice; 0: no bound
};

// A search that has no end yet goes on where it was; whoever was found is told at once, once, and may be seated.
TEST(IdentifyMany, GoesOnInSlices) {
  for (const bool by_time : {true, false}) {
    World w(5);
    add_devices(w, 30, Serials::random, usual_latency);
    w.known.kinds = {{type, revision}};
    Giver giver;
    Slices watch;
    w.options.assigner = &giver;
    w.options.observer = &watch;
    if (by_time) w.options.most_time = 200ms;  // not even one device
    const auto search = make(Method::identify, w.services());
    unsigned slices = 0;
    unsigned questions = 0;
    auto end = Report::End::more;
    while (end == Report::End::more && slices < 1000) {
      if (!by_time) watch.questions = 50;
      const auto before = w.world.now();
      const auto report = w.run(search->find(w.known, w.options));
      ASSERT_TRUE(report);
      EXPECT_LT(w.world.now() - before, 2s);
      for (const auto& d : report->found) w.known.registered.push_back(d.address);
      questions += report->requests;
      end = report->end;
      ++slices;
      w.world.run_for(20ms);
      for (const auto& n : w.nodes) EXPECT_EQ(n->slave.state(), lss::State::waiting) << "while others are seated";
    }
    EXPECT_EQ(end, Report::End::complete);
    EXPECT_GT(slices, 5U);
    EXPECT_LT(questions, 30U * 40U) << "a slice begins where the one before ended";
    std::ranges::sort(watch.list);
    EXPECT_EQ(watch.list, addresses(w));
    EXPECT_EQ(watch.last.kinds, 1U);
    w.expect_right(giver);
  }
}

// Nobody is seated: all go on answering identify non-configured, so that the gaps between them are asked a second time,
// with pauses. That takes longer than a slice, and goes on in the next one.
TEST(IdentifyMany, GoesOnInSlicesWhereAllStayBlank) {
  for (const unsigned devices : {30U, 120U}) {
    SCOPED_TRACE(devices);
    World w(5);
    add_devices(w, devices, Serials::random, usual_latency);
    w.known.kinds = {{type, revision}};
    w.options.most_time = 2s;
    const auto search = make(Method::identify, w.services());
    auto end = Report::End::more;
    unsigned slices = 0;
    for (; end == Report::End::more && slices < 500; ++slices) {
      const auto report = w.run(search->find(w.known, w.options));
      ASSERT_TRUE(report);
      for (const auto& d : report->found) w.known.registered.push_back(d.address);
      end = report->end;
    }
    EXPECT_EQ(end, Report::End::complete);
    EXPECT_EQ(w.known.registered.size(), devices);
    EXPECT_GT(slices, 5U);
    EXPECT_LT(slices, 100U);
    const auto again = w.run(search->find(w.known, w.options));
    ASSERT_TRUE(again);
    EXPECT_TRUE(again->found.empty());
  }
}

// Numbers in a row are asked for by name: the questions are those to the first one and at the end.
TEST(IdentifyMany, ARowCostsNoQuestions) {
  World w;
  add_devices(w, 60, Serials::consecutive, equal_latency);
  w.known.kinds = {{type, revision}};
  w.options.configured = false;
  Giver giver;
  w.options.assigner = &giver;
  const auto report = w.find(Method::identify);
  ASSERT_TRUE(report);
  EXPECT_EQ(addresses(*report), addresses(w));
  EXPECT_LT(report->requests, 60U);
}

// A row with holes, and a second revision with the same serial numbers.
TEST(IdentifyMany, HolesAndAnOpenRevision) {
  World w(3);
  std::vector<std::uint32_t> serials;
  for (std::uint32_t s = 100; s < 130; ++s) {
    if (s % 7 != 0) serials.push_back(s);
  }
  for (const std::uint32_t s : serials) {
    w.add(
        {.address = {type.vendor, type.product, s % 5 == 0 ? 7U : 9U, s}, .fastscan = false, .timing = usual_latency});
  }
  w.add({.address = {type.vendor, type.product, 1U, 110}, .fastscan = false, .timing = usual_latency});
  w.known.kinds = {{type, std::nullopt}};
  Giver giver;
  w.options.assigner = &giver;
  const auto report = w.find(Method::identify);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, Report::End::complete);
  EXPECT_EQ(addresses(*report), addresses(w));
  w.expect_right(giver);
}

// Somebody answers 4Fh to every question: no address of his is believed, and the search has an end.
TEST(IdentifyMany, WhoAnswersEverythingIsNobody) {
  World w;
  add_devices(w, 3, Serials::consecutive, equal_latency);
  auto forger = w.bus.attach();
  Record record(w.bus);
  record.on_frame = [&](const can::Frame& f) {
    if (f.id == lss::master_cob_id && f.data[0] == 0x4B) forger->send(lss::answer(lss::Command::identified), 0);
  };
  w.known.kinds = {{type, revision}};
  Giver giver;
  w.options.assigner = &giver;
  const auto report = w.find(Method::identify);
  ASSERT_TRUE(report);
  EXPECT_EQ(report->end, Report::End::gave_up);
  EXPECT_GT(report->unproven, 4U);
  const auto real = addresses(w);
  for (const auto& d : report->found) EXPECT_TRUE(std::ranges::binary_search(real, d.address));
  EXPECT_LT(report->requests, 1000U);
}

}  // namespace
}  // namespace berth::discovery::test
