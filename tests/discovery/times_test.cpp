// SX.4: the papers' time-outs (4 ms and 40 ms of paper 1, 10 ms and 100 ms of paper 2, 10 and 20 ms of paper 4) are
// parameters. Each is set to several values, the papers' among them; what is measured is the bus, from the end of a
// request that nobody answers to what comes next.
#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/lss/fastscan.hpp"
#include "berth/research/and_master.hpp"
#include "berth/research/negotiator.hpp"
#include "berth/nodeid/rand_master.hpp"
#include "discovery_world.hpp"

namespace berth::discovery::test {
namespace {

constexpr LssAddress somebody{1, 2, 3, 4};
const std::vector<rt::Duration> values{4ms, 10ms, 20ms, 40ms, 100ms, 1s};

// From the end of the last frame on the bus, which is the question, to the end of the task.
template <class T>
rt::Duration waited(World& w, rt::Task<T> task) {
  const Record record(w.bus);
  const auto result = w.run(std::move(task));
  EXPECT_TRUE(result);
  return record.times.empty() ? rt::Duration{-1} : w.world.now() - record.times.back();
}

// Frames are short and bits exact: a window is what was asked for, to the bit.
void expect_equal(rt::Duration found, rt::Duration asked) {
  EXPECT_GE(found, asked);
  EXPECT_LE(found, asked + 10us);
}

TEST(Times, SX_4_RandCollects) {
  for (const auto value : values) {
    World w;
    nodeid::RandMaster rand(w.dispatcher);
    nodeid::DiscoveryOptions options;
    options.window = nodeid::DiscoveryOptions::Window::fixed;
    options.collect = value;
    expect_equal(waited(w, rand.discover(options)), value);
    options.window = nodeid::DiscoveryOptions::Window::quiet;
    options.collect = 7ms;
    options.t_resp = value;
    options.most = 2s;
    expect_equal(waited(w, rand.discover(options)), value);
    expect_equal(waited(w, rand.any_unknown(options)), value);
  }
}

TEST(Times, SX_4_AndCollects) {
  for (const auto value : values) {
    World w;
    research::AndMaster way(w.dispatcher);
    research::AndOptions options;
    options.discovery.window = nodeid::DiscoveryOptions::Window::fixed;
    options.discovery.collect = value;
    expect_equal(waited(w, way.discover(options)), value);
  }
}

rt::Task<Result<void>> one_request(lss::Master& master, lss::ServiceOptions how) {
  const lss::FastscanRequest anybody{};
  const auto reply = co_await master.fastscan(anybody, how);
  if (!reply) co_return fail(reply.error());
  co_return Result<void>{};
}
rt::Task<Result<void>> one_selection(lss::Master& master, lss::ServiceOptions how) {
  const auto reply = co_await master.switch_selective(somebody, how);
  if (reply || reply.error().code != Errc::timeout) ADD_FAILURE() << "nobody is there";
  co_return Result<void>{};
}

TEST(Times, SX_4_LssAndFastscanWait) {
  for (const auto value : values) {
    World w;
    const lss::ServiceOptions how{.timeout = value, .retries = 0};
    expect_equal(waited(w, one_request(w.lss, how)), value);
    // Four frames; the time counts from the last of them.
    const Record record(w.bus);
    ASSERT_TRUE(w.run(one_selection(w.lss, how)));
    ASSERT_EQ(record.times.size(), 4U);
    expect_equal(w.world.now() - record.times.back(), value);
  }
}

// The published search of a bus where nobody is: one request and the window that its option says.
TEST(Times, SX_4_EveryMethodsWindow) {
  for (const auto value : values) {
    for (const auto method : {Method::rand, Method::and_protocol, Method::fastscan, Method::feedback_29}) {
      World w;
      w.options.window = value;
      const auto way = make(method, w.services());
      expect_equal(waited(w, way->find(w.known, w.options)), value);
    }
  }
}

// HU.1: "Fastscan of a large network takes minutes": bit by bit it does, 129 windows at least for each device; the walk
// asks each bit of what they share once.
TEST(Times, HU_1_ManyDevicesDoNotTakeMinutes) {
  rt::Duration took[2];
  for (const auto method : {Method::fastscan, Method::planner_fastscan}) {
    World w;
    for (std::uint32_t i = 0; i < 30; ++i) w.add({.address = {1, 2, 3, 1000 + 7 * i}});
    Giver giver;
    w.options.assigner = &giver;
    if (method == Method::fastscan) w.options.window = 10ms;
    const auto report = w.find(method);
    ASSERT_TRUE(report);
    ASSERT_EQ(addresses(*report), addresses(w));
    took[method == Method::fastscan ? 0 : 1] = report->ended - report->began;
  }
  EXPECT_GT(took[0], 30 * 129 * 10ms);
  EXPECT_LT(took[1], 4s);
}

// Paper 2's 100 ms three times, and its 5 ms.
struct Owner final : research::NegotiatorOwner {
  bool send(const can::Frame& frame) noexcept override {
    frames.push_back(can::to_string(frame));
    at.push_back(executor.now());
    return true;
  }
  void withdraw() noexcept override {}
  [[nodiscard]] bool nothing_queued() const noexcept override { return true; }
  [[nodiscard]] std::uint32_t bit_rate() const noexcept override { return 1'000'000; }
  void node_id_taken(NodeId) noexcept override {}
  void node_id_lost(NodeId, research::IdLoss) noexcept override {}
  void all_taken() noexcept override {}
  void node_id_kept(NodeId) noexcept override {}
  rt::Executor executor;
  std::vector<std::string> frames;
  std::vector<rt::Time> at;
};

TEST(Times, SX_4_NegotiationWaits) {
  struct Row {
    rt::Duration quiet, answers, pause, spacing;
  };
  for (const Row& row : {Row{100ms, 100ms, 100ms, 5ms}, Row{30ms, 100ms, 100ms, 5ms}, Row{100ms, 250ms, 100ms, 5ms},
                         Row{100ms, 100ms, 700ms, 5ms}, Row{100ms, 100ms, 100ms, 17ms}}) {
    Owner owner;
    research::NegotiatorOptions options;
    options.address = somebody;
    options.literal = true;  // without the random times of Berth's own rules
    options.quiet = row.quiet;
    options.answers = row.answers;
    options.pause = row.pause;
    options.spacing = row.spacing;
    research::Negotiator negotiator(owner.executor, owner, options);
    const auto begin = owner.executor.now();
    negotiator.start();
    for (int i = 0; i < 18; ++i) {
      // `sent` is told when the frame is on the wire, not within `send`.
      const auto before = owner.frames.size();
      while (owner.frames.size() == before && owner.executor.step(begin + 10s)) {
      }
      ASSERT_EQ(owner.frames.size(), before + 1);
      negotiator.sent();
    }
    ASSERT_EQ(owner.frames.size(), 18U);
    expect_equal(owner.at[0] - begin, row.quiet);
    expect_equal(owner.at[1] - owner.at[0], row.answers);
    for (std::size_t i = 2; i < 17; ++i) {
      EXPECT_NEAR(std::chrono::duration<double>(owner.at[i] - owner.at[i - 1]).count(),
                  std::chrono::duration<double>(row.spacing).count(), 100e-6);
    }
    expect_equal(owner.at[17] - owner.at[16], row.pause);
  }
}

}  // namespace
}  // namespace berth::discovery::test
