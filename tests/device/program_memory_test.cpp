// A device's programs in its flash memory: whatever byte a power loss stops at, what is valid afterwards is a whole
// program.
#include "berth/device/program_memory.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <chrono>
#include <cstdint>
#include <vector>

#include "berth/base/crc.hpp"
#include "berth/rt/executor.hpp"

using namespace berth;
using namespace berth::device;
using namespace std::chrono_literals;

namespace {

using Content = std::vector<std::uint8_t>;

Content content_of(std::size_t size, std::uint8_t seed) {
  Content bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(seed + i * 7 + i / 13);
  return bytes;
}

struct Cell final : ProgramMemory::Owner, SimFlash::Watcher {
  explicit Cell(const ProgramLayout& layout) : layout(layout), flash(executor, ProgramMemory::footprint(layout), 0ns) {
    flash.set_times({.byte = 1us, .sector = 1ms, .sector_size = layout.sector});
    flash.watch(this);
    again();
  }
  void memory_ready(bool ok) noexcept override {
    ++told;
    good = ok;
  }
  void write_began() noexcept override {}
  void write_ended() noexcept override {}
  void cut() noexcept override { dead = true; }
  // A new life of the device.
  void again() {
    flash.forget();
    memory.emplace(flash, layout, *this);
    memory->load();
    dead = false;
  }
  void settle() {
    for (auto next = executor.next(); !dead && next; next = executor.next()) executor.advance(*next);
  }
  bool clear(std::uint8_t number) {
    if (!memory->clear(number)) return false;
    settle();
    return !dead;
  }
  bool write(std::uint8_t number, const Content& content, std::size_t piece = 100) {
    const auto begun = memory->begin(number);
    if (begun == ProgramMemory::Begun::soon) settle();
    if (begun == ProgramMemory::Begun::not_cleared || begun == ProgramMemory::Begun::busy) return false;
    for (std::size_t at = 0; at < content.size() && !dead; at += piece) {
      const auto part = std::span(content).subspan(at, std::min(piece, content.size() - at));
      if (memory->put(part) == ProgramMemory::Put::refused) return false;
      if (at / piece % 2 == 1) settle();  // every second one is put while the one before is written
    }
    if (dead) return false;
    const ProgramHead head{.type = {}, .date = 10, .time = 20};
    memory->end(head);
    settle();
    return !dead;
  }
  [[nodiscard]] Content held(std::uint8_t number) const {
    const auto& program = memory->program(number);
    Content bytes(program.valid ? program.length : 0);
    if (program.valid) memory->read(number, 0, bytes);
    return bytes;
  }

  ProgramLayout layout;
  rt::Executor executor;
  SimFlash flash;
  std::optional<ProgramMemory> memory;
  unsigned told = 0;
  bool good = false;
  bool dead = false;
};

constexpr ProgramLayout small(unsigned images, std::uint8_t count = 1) {
  return {.count = count, .images = images, .longest = 300, .sector = 64};
}

}  // namespace

TEST(ProgramMemory, WhatWasWrittenIsThereAfterAPowerCycle) {
  for (const unsigned images : {1U, 2U}) {
    Cell cell(small(images, 3));
    const auto content = content_of(300, 1);
    ASSERT_TRUE(cell.write(2, content));
    EXPECT_TRUE(cell.good);
    cell.again();
    EXPECT_EQ(cell.held(2), content);
    EXPECT_EQ(cell.memory->program(2).identification, crc32(content));
    EXPECT_EQ(cell.memory->program(2).date, 10U);
    EXPECT_EQ(cell.memory->program(2).time, 20U);
    EXPECT_FALSE(cell.memory->program(1).valid || cell.memory->program(3).valid);
    ASSERT_TRUE(cell.clear(2));
    EXPECT_FALSE(cell.memory->program(2).valid);
    cell.again();
    EXPECT_FALSE(cell.memory->program(2).valid);
  }
}

TEST(ProgramMemory, TheOnlyImageIsClearedBeforeItIsWritten) {
  Cell one(small(1));
  ASSERT_TRUE(one.write(1, content_of(50, 1)));
  EXPECT_EQ(one.memory->begin(1), ProgramMemory::Begun::not_cleared);
  EXPECT_EQ(one.held(1), content_of(50, 1));
  Cell two(small(2));
  for (std::uint8_t seed = 1; seed < 6; ++seed) {
    ASSERT_TRUE(two.write(1, content_of(40U + seed, seed)));
    two.again();
    EXPECT_EQ(two.held(1), content_of(40U + seed, seed));
  }
}

// Every byte of clearing and writing, with what a torn byte may hold: the program is the old one, none, or the new one.
TEST(ProgramMemory, APowerLossAtAnyByteLeavesAWholeProgramOrNone) {
  const auto before = content_of(250, 3);
  const auto after = content_of(280, 9);
  for (const unsigned images : {1U, 2U}) {
    for (const bool clears : {true, false}) {
      if (images == 1 && !clears) continue;
      std::size_t none = 0, old = 0, fresh = 0;
      for (std::uint64_t at = 0;; ++at) {
        bool ended = false;
        for (const int torn : {-1, 0x00, 0x5A, 0xFF}) {
          Cell cell(small(images));
          ASSERT_TRUE(cell.write(1, content_of(30, 1)));
          ASSERT_TRUE(images == 2 || cell.clear(1));
          ASSERT_TRUE(cell.write(1, before));
          cell.flash.cut_after(at, torn);
          const bool cleared = !clears || cell.clear(1);
          ended = cleared && cell.write(1, after);
          cell.flash.never_cut();
          cell.again();
          const auto held = cell.held(1);
          ASSERT_TRUE(held.empty() || held == before || held == after) << images << " images, cut at " << at;
          ASSERT_TRUE(clears || !held.empty()) << "a device of two images always has one: " << at;
          ASSERT_TRUE(!ended || held == after);
          (held.empty() ? none : held == before ? old : fresh) += 1;
          // And it takes a program again.
          ASSERT_TRUE(cell.clear(1) && cell.write(1, after));
          cell.again();
          ASSERT_EQ(cell.held(1), after);
        }
        if (ended) break;
      }
      EXPECT_GT(fresh, 0U);
      EXPECT_GT(clears ? none : old, 250U);
    }
  }
}

TEST(ProgramMemory, AMediumThatRefusesIsTold) {
  Cell cell(small(2));
  cell.flash.broken(true);
  ASSERT_EQ(cell.memory->begin(1), ProgramMemory::Begun::ready);
  static_cast<void>(cell.memory->put(content_of(10, 1)));
  cell.memory->end({});
  cell.settle();
  EXPECT_EQ(cell.told, 1U);
  EXPECT_FALSE(cell.good || cell.memory->busy());
  cell.again();
  EXPECT_FALSE(cell.memory->program(1).valid);
}

// ---- images

RC_GTEST_PROP(ProgramImage, AHeadComesBack,
              (std::uint32_t vendor, std::uint32_t product, std::uint32_t date, const Content& content)) {
  const auto image = make_program_image({.type = {vendor, product}, .date = date, .time = 5}, content);
  const auto head = read_program_head(image);
  RC_ASSERT(head.has_value());
  RC_ASSERT(head->type == (TypeCode{vendor, product}));
  RC_ASSERT(head->date == date && head->time == 5);
  RC_ASSERT(head->length == content.size() && head->crc == crc32(content));
  RC_ASSERT(image.size() == content.size() + ProgramHead::size);
}

TEST(ProgramImage, AnyBitOfTheHeadCounts) {
  const auto image = make_program_image({.type = {1, 2}}, content_of(20, 1));
  for (std::size_t bit = 0; bit < ProgramHead::size * 8; ++bit) {
    auto damaged = image;
    damaged[bit / 8] = static_cast<std::uint8_t>(damaged[bit / 8] ^ 1U << (bit % 8));
    EXPECT_FALSE(read_program_head(damaged)) << bit;
  }
  for (std::size_t size = 0; size < ProgramHead::size; ++size) {
    EXPECT_FALSE(read_program_head(std::span(image).first(size)));
  }
}
