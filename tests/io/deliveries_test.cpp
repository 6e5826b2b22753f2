// What a port has noted for its listener, and delivers between two looks at its descriptors.
#include "berth/io/deliveries.hpp"

#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <vector>

#include "berth/rt/executor.hpp"

namespace berth::io {
namespace {

struct Receiver final : can::Listener {
  void received(const can::Frame& frame, rt::Time) noexcept override { ids.push_back(frame.id); }
  void sent(std::uint32_t, rt::Time) noexcept override {}
  void changed(const can::Status&, rt::Time) noexcept override {}
  std::vector<std::uint32_t> ids;
};

constexpr std::array all_identifiers{can::IdRange{0, 0xFFFF'FFFF}};

}  // namespace

TEST(Deliveries, WhatWasHeardForOneListenerIsNotDeliveredToTheNext) {
  rt::Executor executor;
  Deliveries deliveries(executor);
  Receiver first, second;
  deliveries.listen(&first, all_identifiers);
  deliveries.received(can::Frame::base(0x701, {0x05}), rt::Time{});
  deliveries.listen(&second, all_identifiers);
  deliveries.received(can::Frame::base(0x702, {0x05}), rt::Time{});
  executor.advance(executor.now());
  EXPECT_TRUE(first.ids.empty());
  EXPECT_EQ(second.ids, std::vector<std::uint32_t>{0x702});
}

TEST(Deliveries, ErrorsComeAmongTheFramesWhateverTheRanges) {
  struct Log final : can::Listener {
    void received(const can::Frame& frame, rt::Time) noexcept override { told.push_back(frame.id); }
    void sent(std::uint32_t, rt::Time) noexcept override {}
    void changed(const can::Status&, rt::Time) noexcept override {}
    void error(const can::Frame& report, rt::Time) noexcept override { told.push_back(0x20000000 | report.id); }
    std::vector<std::uint32_t> told;
  };
  rt::Executor executor;
  Deliveries deliveries(executor);
  Log ear;
  deliveries.listen(&ear, std::array{can::IdRange{0x700, 0x77F}});
  deliveries.received(can::Frame::base(0x701, {0x05}), rt::Time{});
  can::Frame report;
  report.id = 0x88;
  deliveries.error(report, rt::Time{});
  deliveries.received(can::Frame::base(0x702, {0x05}), rt::Time{});
  executor.advance(executor.now());
  EXPECT_EQ(ear.told, (std::vector<std::uint32_t>{0x701, 0x20000088, 0x702}));
}

// The same listener with other ranges: what is noted stays, as far as they hold it.
TEST(Deliveries, OtherRangesCountForWhatIsNoted) {
  rt::Executor executor;
  Deliveries deliveries(executor);
  Receiver ear;
  deliveries.listen(&ear, all_identifiers);
  deliveries.received(can::Frame::base(0x701, {0x05}), rt::Time{});
  deliveries.received(can::Frame::base(0x081, {0x05}), rt::Time{});
  deliveries.listen(&ear, std::array{can::IdRange{0x700, 0x77F}});
  executor.advance(executor.now());
  EXPECT_EQ(ear.ids, std::vector<std::uint32_t>{0x701});
}

// Read late, all at once: each comes at its own time, between the timers that were due meanwhile, and none is told
// before it was on the wire.
TEST(Deliveries, WhatWasReadLateComesAmongTheTimersAtItsTime) {
  using namespace std::chrono_literals;
  struct Log final : can::Listener, rt::Job {
    explicit Log(rt::Executor& of) : executor(of) {}
    void received(const can::Frame& frame, rt::Time at) noexcept override {
      told.push_back(frame.id);
      EXPECT_LT(at, executor.now());
      EXPECT_GE(at, executor.now() - 1ns);
    }
    void sent(std::uint32_t, rt::Time) noexcept override {}
    void changed(const can::Status&, rt::Time) noexcept override {}
    void run() noexcept override { told.push_back(0); }
    rt::Executor& executor;
    std::vector<std::uint32_t> told;
  };
  rt::Executor executor;
  Log log(executor);
  Deliveries one(executor), other(executor);
  one.listen(&log, all_identifiers);
  other.listen(&log, all_identifiers);
  const auto begin = executor.now();
  executor.at(begin + 700ms, log);
  one.received(can::Frame::base(0x701, {0x05}), begin + 500ms);
  one.received(can::Frame::base(0x702, {0x05}), begin + 1s);
  other.received(can::Frame::base(0x703, {0x05}), begin + 600ms);
  executor.advance(begin);
  EXPECT_TRUE(log.told.empty());
  executor.advance(begin + 2s);
  EXPECT_EQ(log.told, (std::vector<std::uint32_t>{0x701, 0x703, 0, 0x702}));
}

}  // namespace berth::io
