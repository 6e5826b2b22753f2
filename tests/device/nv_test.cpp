// Non-volatile memory: a power loss at any byte of a write leaves the old record or the new one.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>
#include <set>

#include "../pch.hpp"
#include "berth/base/random.hpp"
#include "berth/device/nv_memory.hpp"

namespace berth::device {
namespace {

using Payload = std::array<std::uint8_t, 4>;

struct Told final : NvMemory::Done {
  void written(bool good) noexcept override {
    ++count;
    ok = good;
  }
  int count = 0;
  bool ok = false;
};

struct Cutter final : SimFlash::Watcher {
  explicit Cutter(NvRecord*& r) : record(r) {}
  void write_began() noexcept override { ++began; }
  void write_ended() noexcept override { ++ended; }
  void cut() noexcept override {
    ++cuts;
    record->forget();
  }
  NvRecord*& record;
  int began = 0;
  int ended = 0;
  int cuts = 0;
};

TEST(NvRecord, BlankMemoryHoldsNothing) {
  rt::Executor executor;
  SimFlash flash(executor, 64, rt::Duration(0));
  NvRecord record(flash, 0, 4);
  Payload out{1, 2, 3, 4};
  EXPECT_FALSE(record.load(out));
  EXPECT_EQ(out, (Payload{1, 2, 3, 4}));
}

TEST(NvRecord, KeepsTheNewestOfManyWrites) {
  rt::Executor executor;
  SimFlash flash(executor, 64, std::chrono::milliseconds(3));
  Told told;
  for (std::uint8_t i = 1; i <= 50; ++i) {
    NvRecord record(flash, 0, 4);  // a new start before each write
    Payload old{};
    EXPECT_EQ(record.load(old), i > 1);
    EXPECT_EQ(old[0], i - 1);
    ASSERT_TRUE(record.save(Payload{i, 0, 0, 0}, told));
    EXPECT_TRUE(record.busy());
    EXPECT_FALSE(record.save(Payload{99, 0, 0, 0}, told)) << "one write at a time";
    executor.advance(executor.now() + std::chrono::milliseconds(3));
    EXPECT_EQ(told.count, i);
    EXPECT_TRUE(told.ok);
  }
  EXPECT_EQ(flash.writes_begun(), 50U);
  EXPECT_EQ(flash.writes_ended(), 50U);
}

// Every cut point of a write, with every kind of byte left at the cut, after each of four histories. The next start
// finds old or new, and a write after the recovery is whole.
TEST(NvRecord, CutAtEveryByteLeavesOldOrNew) {
  const Payload before{0x11, 0x22, 0x33, 0x44};
  const Payload after{0x55, 0x22, 0x33, 0x45};
  constexpr std::size_t written = 4 + 9;
  unsigned old_seen = 0;
  unsigned new_seen = 0;
  for (unsigned history = 0; history < 4; ++history) {
    for (std::size_t cut = 0; cut <= written; ++cut) {
      for (int torn = -1; torn <= 255; torn += cut == written ? 1000 : 1) {
        rt::Executor executor;
        SimFlash flash(executor, 64, std::chrono::milliseconds(1));
        NvRecord record(flash, 8, 4);
        NvRecord* current = &record;
        Cutter cutter(current);
        flash.watch(&cutter);
        Told told;
        Payload out{};
        (void)record.load(out);
        for (unsigned i = 0; i < history; ++i) {
          ASSERT_TRUE(record.save(i + 1 == history ? before : Payload{0xEE, 0xEE, 0xEE, 0xEE}, told));
          executor.advance(executor.now() + std::chrono::milliseconds(1));
        }
        flash.cut_after(cut, torn);
        ASSERT_TRUE(record.save(after, told));
        executor.advance(executor.now() + std::chrono::milliseconds(1));
        EXPECT_EQ(cutter.cuts, cut < written ? 1 : 0);
        EXPECT_EQ(told.count, static_cast<int>(history) + (cut < written ? 0 : 1)) << "nobody is told of a cut write";
        flash.never_cut();

        NvRecord again(flash, 8, 4);
        out = {};
        const bool found = again.load(out);
        if (cut == written) {
          ASSERT_TRUE(found);
          ASSERT_EQ(out, after);
          ++new_seen;
        } else if (found) {
          // A torn byte that happens to be right at the very end makes the new record whole.
          ASSERT_TRUE(out == before || out == after) << "history " << history << " cut " << cut << " torn " << torn;
          ASSERT_TRUE(history != 0 || out == after) << "nothing was there before";
          (out == after ? new_seen : old_seen) += 1;
        } else {
          ASSERT_EQ(history, 0U) << "a record was lost at cut " << cut << " torn " << torn;
        }
        // And recovery can be cut as well: write again, cut again at the same byte.
        flash.cut_after(cut, torn);
        current = &again;
        const Payload third{0x77, 0x77, 0x77, 0x77};
        ASSERT_TRUE(again.save(third, told));
        executor.advance(executor.now() + std::chrono::milliseconds(1));
        NvRecord last(flash, 8, 4);
        Payload end{};
        const bool still = last.load(end);
        ASSERT_TRUE(!found || (still && (end == out || end == third)));
        flash.never_cut();
        current = &last;
        ASSERT_TRUE(last.save(Payload{9, 9, 9, 9}, told));
        executor.advance(executor.now() + std::chrono::milliseconds(1));
        ASSERT_TRUE(NvRecord(flash, 8, 4).load(end));
        ASSERT_EQ(end, (Payload{9, 9, 9, 9}));
      }
    }
  }
  EXPECT_GT(old_seen, 1000U);
  EXPECT_GT(new_seen, 4U);
}

TEST(SimFlash, PowerLossInTimeWritesAPrefix) {
  rt::Executor executor;
  SimFlash flash(executor, 16, std::chrono::microseconds(800));
  Told told;
  const std::array<std::uint8_t, 8> bytes{1, 2, 3, 4, 5, 6, 7, 8};
  ASSERT_TRUE(flash.write(4, bytes, told));
  executor.advance(executor.now() + std::chrono::microseconds(350));
  flash.forget();
  executor.advance(executor.now() + std::chrono::seconds(1));
  EXPECT_EQ(told.count, 0);
  const std::array<std::uint8_t, 8> expected{0xFF, 0xFF, 0xFF, 0xFF, 1, 2, 3, 0xFF};
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), flash.image().begin()));
  EXPECT_EQ(flash.writes_begun(), 1U);
  EXPECT_EQ(flash.writes_ended(), 0U);
}

TEST(SimFlash, RefusesWhatDoesNotFitAndSaysWhenTheMediumIsBroken) {
  rt::Executor executor;
  SimFlash flash(executor, 16, rt::Duration(0));
  Told told;
  const std::array<std::uint8_t, 8> bytes{};
  EXPECT_FALSE(flash.write(9, bytes, told));
  EXPECT_FALSE(flash.write(~std::size_t{0}, bytes, told));
  flash.broken(true);
  ASSERT_TRUE(flash.write(8, bytes, told));
  executor.advance(executor.now());
  EXPECT_EQ(told.count, 1);
  EXPECT_FALSE(told.ok);
  EXPECT_EQ(flash.image()[8], 0xFF);
}

// Random writes, power losses in time and new starts: what is found is what was written last whole, or the one under
// way.
RC_GTEST_PROP(NvRecord, AnyMixOfWritesAndPowerLosses, (std::uint64_t seed)) {
  Random random(seed);
  rt::Executor executor;
  SimFlash flash(executor, 64, std::chrono::microseconds(1000));
  std::optional<Payload> certain;
  for (int round = 0; round < 40; ++round) {
    NvRecord record(flash, 0, 4);
    Payload found{};
    const bool has = record.load(found);
    if (certain) RC_ASSERT(has);
    if (has && certain) RC_ASSERT(found == *certain);
    Payload next{};
    for (auto& byte : next) byte = static_cast<std::uint8_t>(random.next());
    Told told;
    RC_ASSERT(record.save(next, told));
    executor.advance(executor.now() + std::chrono::microseconds(random.below(1300)));
    const auto done = told.count == 1;
    record.forget();
    NvRecord after(flash, 0, 4);
    const bool still = after.load(found);
    if (done) {
      RC_ASSERT(still && found == next);
      certain = next;
    } else if (certain) {
      RC_ASSERT(still && (found == *certain || found == next));
      certain = found;
    }
  }
}

}  // namespace
}  // namespace berth::device
