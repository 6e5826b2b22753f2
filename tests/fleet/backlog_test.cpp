// What is kept on the disk: over a restart, a full disk, a damaged file.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <fstream>

#include "berth/fleet/keeping.hpp"
#include "tests/mqtt/folder.hpp"

namespace berth::fleet {
namespace {

using mqtt::test::Folder;
using sparkplug::DataType;
using sparkplug::Kept;
using sparkplug::Quality;
using sparkplug::Value;

constexpr std::uint64_t plenty = 1U << 20U;

Kept change(std::uint64_t number, const std::string& device = "left") {
  return {device, "Signals/Position", DataType::uint32, Value(number), {1000 + number}, Quality::good};
}

std::vector<Kept> all_of(const sparkplug::Backlog& backlog) {
  std::vector<Kept> kept;
  for (const auto& entry : backlog.after(0, 100'000)) kept.push_back(entry.kept);
  return kept;
}

/// While it lives, files of this process grow to so many bytes only, as on a full disk.
class FullDisk {
 public:
  explicit FullDisk(rlim_t bytes) {
    std::signal(SIGXFSZ, SIG_IGN);
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit small{bytes, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &small);
  }
  ~FullDisk() { ::setrlimit(RLIMIT_FSIZE, &before_); }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit before_{};
};

}  // namespace

TEST(FleetBacklog, KeepsEachKindOfValueOverARestart) {
  Folder folder;
  const auto file = folder.file("m.db.mqtt");
  const std::vector<Kept> kept{{"left", "a", DataType::int16, Value(std::int64_t{-7}), {5}, Quality::good},
                               {"left", "b", DataType::float64, Value(2.5), {6}, Quality::stale},
                               {"", "c", DataType::string, Value(std::string("ä\n")), {7}, Quality::bad},
                               {"left", "d", DataType::boolean, Value(true), {8}, Quality::good},
                               {"left", "e", DataType::uint32, Value(sparkplug::Null{}), {9}, Quality::good}};
  {
    auto disk = DiskBacklog::open(file, plenty).value();
    for (const auto& each : kept) ASSERT_TRUE(disk->append(each));
    ASSERT_TRUE(disk->settle());
    ASSERT_TRUE(disk->keep_bd_seq(17));
  }
  auto disk = DiskBacklog::open(file, plenty).value();
  EXPECT_EQ(all_of(*disk), kept);
  EXPECT_EQ(disk->size(), kept.size());
  EXPECT_EQ(disk->bd_seq(), 17);
}

TEST(FleetBacklog, WhatIsDroppedStaysGoneAndNumbersAreNotUsedAgain) {
  Folder folder;
  const auto file = folder.file("m.db.mqtt");
  std::uint64_t last = 0;
  {
    auto disk = DiskBacklog::open(file, plenty).value();
    for (std::uint64_t i = 0; i < 3; ++i) ASSERT_TRUE(disk->append(change(i)));
    const auto entries = disk->after(0, 10);
    last = entries.back().id;
    const std::vector<std::uint64_t> ids{entries[0].id, entries[2].id, 4711};
    disk->drop(ids);
    EXPECT_EQ(all_of(*disk), std::vector<Kept>{change(1)});
  }
  auto disk = DiskBacklog::open(file, plenty).value();
  ASSERT_TRUE(disk->append(change(9)));
  EXPECT_EQ(all_of(*disk), (std::vector<Kept>{change(1), change(9)}));
  EXPECT_GT(disk->after(0, 10).back().id, last);
}

TEST(FleetBacklog, IsReadInPortions) {
  Folder folder;
  auto disk = DiskBacklog::open(folder.file("m"), plenty).value();
  for (std::uint64_t i = 0; i < 10; ++i) ASSERT_TRUE(disk->append(change(i)));
  const auto first = disk->after(0, 4);
  ASSERT_EQ(first.size(), 4U);
  const auto second = disk->after(first.back().id, 4);
  ASSERT_EQ(second.size(), 4U);
  EXPECT_EQ(second.front().kept, change(4));
}

TEST(FleetBacklog, ItsBoundRefusesTheNewest) {
  Folder folder;
  auto disk = DiskBacklog::open(folder.file("m"), 2000).value();
  std::uint64_t taken = 0;
  while (taken < 1000 && disk->append(change(taken))) ++taken;
  EXPECT_GT(taken, 5U);
  EXPECT_LT(taken, 100U);
  EXPECT_LE(disk->bytes(), 2000U);
  EXPECT_EQ(disk->trouble(), "");
  EXPECT_EQ(all_of(*disk).front(), change(0)) << "what was promised stays";
  const auto first = disk->after(0, 1).front().id;
  disk->drop(std::vector<std::uint64_t>{first});
  EXPECT_TRUE(disk->append(change(5000)));
}

TEST(FleetBacklog, ADamagedFileIsLeftAsItIsAndMemoryKeeps) {
  Folder folder;
  const std::vector<std::string> contents{"this is no database at all, whatever its name says",
                                          std::string("SQLite format 3") + '\0' + " and then nothing that fits"};
  for (const auto& content : contents) {
    const auto file = folder.write("m.db.mqtt", content);
    Keeping keeping(file, plenty);
    EXPECT_TRUE(keeping.append(change(1)));
    keeping.settle();
    EXPECT_EQ(keeping.size(), 1U);
    const auto words = keeping.take_trouble();
    EXPECT_NE(words.find(file), std::string::npos) << words;
    EXPECT_NE(words.find("in memory alone"), std::string::npos) << words;
    EXPECT_EQ(keeping.take_trouble(), "") << "once";
    EXPECT_EQ(folder.read("m.db.mqtt"), content);
  }
}

TEST(FleetBacklog, AnotherProgramsDatabaseIsRefused) {
  Folder folder;
  const auto file = folder.file("m");
  { auto disk = DiskBacklog::open(file, plenty).value(); }
  auto bytes = folder.read("m");
  bytes[68] = 'X';  // its application number
  folder.write("m", bytes);
  const auto opened = DiskBacklog::open(file, plenty);
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().find("no backlog of Berth"), std::string::npos) << opened.error();
}

TEST(FleetBacklog, WhileTheDiskIsFullMemoryKeepsAndNothingIsLost) {
  Folder folder;
  const auto file = folder.file("m.db.mqtt");
  Keeping keeping(file, 64U << 20U);
  ASSERT_TRUE(keeping.append(change(0)));
  keeping.settle();
  std::vector<Kept> kept{change(0)};
  {
    const FullDisk full(256U << 10U);
    for (std::uint64_t i = 1; i < 3000 && !keeping.disk_fails(); ++i) {
      kept.push_back(change(i, std::string(200, 'd')));
      ASSERT_TRUE(keeping.append(kept.back()));
      if (i % 20 == 0) keeping.settle();
    }
    ASSERT_TRUE(keeping.disk_fails());
    EXPECT_NE(keeping.take_trouble().find("in memory alone"), std::string::npos);
    kept.push_back(change(5000));
    ASSERT_TRUE(keeping.append(kept.back()));
    EXPECT_EQ(all_of(keeping), kept);
  }
  keeping.try_disk_again();
  EXPECT_FALSE(keeping.disk_fails());
  EXPECT_NE(keeping.take_trouble().find("takes what hosts have not got again"), std::string::npos);
  EXPECT_EQ(all_of(keeping), kept) << "in its order";
  keeping.settle();
}

TEST(FleetBacklog, EntriesOfMemoryAreDroppedToo) {
  Keeping keeping("", plenty);
  for (std::uint64_t i = 0; i < 3; ++i) ASSERT_TRUE(keeping.append(change(i)));
  const auto entries = keeping.after(0, 10);
  ASSERT_EQ(entries.size(), 3U);
  EXPECT_EQ(keeping.after(entries[0].id, 10).size(), 2U);
  keeping.drop(std::vector<std::uint64_t>{entries[1].id});
  EXPECT_EQ(all_of(keeping), (std::vector<Kept>{change(0), change(2)}));
}

}  // namespace berth::fleet
