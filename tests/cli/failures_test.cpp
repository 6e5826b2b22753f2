// What fails names its file or its bus, the cause and what to do about it: a disk that is full or read-only, a port
// that is not there, a bus on which nothing acknowledges.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "command_fixture.hpp"

namespace berth::test {
namespace {

/// A disk of its own, of 64 KiB; root alone can have one.
class SmallDisk {
 public:
  SmallDisk() : path_(folder_.file("disk")) {
    ::mkdir(path_.c_str(), 0755);
    mounted_ = ::mount("tmpfs", path_.c_str(), "tmpfs", 0, "size=64k") == 0;
  }
  ~SmallDisk() {
    if (mounted_) ::umount2(path_.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  [[nodiscard]] bool there() const noexcept { return mounted_; }
  [[nodiscard]] std::string file(const std::string& name) const { return path_ + "/" + name; }
  void fill() const {
    std::ofstream all(file("filler"), std::ios::binary);
    const std::string page(4096, 'x');
    while (all.write(page.data(), static_cast<std::streamsize>(page.size())).flush()) continue;
  }
  void empty() const { ::unlink(file("filler").c_str()); }
  void make_read_only() const {
    ASSERT_EQ(::mount("tmpfs", path_.c_str(), "tmpfs", MS_REMOUNT | MS_RDONLY, nullptr), 0);
  }

 private:
  Folder folder_;
  std::string path_;
  bool mounted_ = false;
};

TEST_F(Command, AStoreOnAFullDiskNamesFileCauseAndRemedy) {
  const SmallDisk disk;
  if (!disk.there()) GTEST_SKIP() << "needs root: only root mounts a disk";
  disk.fill();
  const std::string store = disk.file("slots.db");
  const Outcome run = berth({"up", machine, "--sim", plant, "--store", store});
  EXPECT_EQ(run.status, 3) << run.out;
  EXPECT_TRUE(contains(run.err, store)) << run.err;
  EXPECT_TRUE(contains(run.err, "No space left on device") || contains(run.err, "the disk is full")) << run.err;
  EXPECT_TRUE(contains(run.err, "make room on")) << run.err;
}

std::ptrdiff_t lines_in(const std::string& text) { return std::ranges::count(text, '\n'); }

TEST_F(Command, ARecordThatNoLongerFitsHasWholeLinesAndTellsHowManyFramesAreMissing) {
  const SmallDisk disk;
  if (!disk.there()) GTEST_SKIP() << "needs root: only root mounts a disk";
  const auto listen = [&](const std::string& record) {
    return berth({"doctor", machine, "--sim", plant, "--up", "--for", "2000 s", "--record", record});
  };
  const std::string whole = folder.file("whole.log");
  const Outcome roomy = listen(whole);
  EXPECT_EQ(contents(whole).find("No space"), std::string::npos);
  const std::string all = contents(whole);
  ASSERT_GT(all.size(), std::size_t{1} << 20U) << "more than is kept for later";
  const std::string record = disk.file("frames.log");
  const Outcome full = listen(record);
  EXPECT_EQ(full.status, 3) << full.out << full.err;
  EXPECT_EQ(full.out, roomy.out) << "and nothing else is wrong";
  const std::string kept = contents(record);
  ASSERT_FALSE(kept.empty());
  EXPECT_TRUE(kept.ends_with('\n'));
  EXPECT_EQ(kept, all.substr(0, kept.size()));
  const std::string told = record + ": No space left on device: the record is paused";
  const auto first = full.err.find(told);
  EXPECT_NE(first, std::string::npos) << full.err;
  EXPECT_EQ(full.err.find(told, first + 1), std::string::npos) << "once: " << full.err;
  EXPECT_TRUE(contains(full.err, "make room")) << full.err;
  const std::string missing = std::to_string(lines_in(all) - lines_in(kept)) + " frames are missing in this record";
  EXPECT_TRUE(contains(full.err, missing)) << missing << "\n" << full.err;
}

TEST_F(Command, ARecordGoesOnWhenThereIsRoomAgain) {
  const SmallDisk disk;
  if (!disk.there()) GTEST_SKIP() << "needs root: only root mounts a disk";
  const std::string record = disk.file("frames.log");
  disk.fill();
  Background up({"up", machine, "--sim", plant, "--control", folder.file("s"), "--record", record},
                OnTerminal{300, 40});
  ASSERT_TRUE(up.says("the record is paused")) << "at once: " << up.said();
  EXPECT_EQ(contents(record), "");
  disk.empty();
  ASSERT_TRUE(eventually([&] { return contains(contents(record), " 709#05\n"); })) << contents(record);
  EXPECT_TRUE(contains(contents(record), "(0000000000.")) << "those that waited";
  up.signal(SIGTERM);
  const Outcome end = up.end();
  EXPECT_EQ(end.status, 0) << "none is missing: " << end.err;
  EXPECT_TRUE(contents(record).ends_with('\n'));
}

// A limit of the shell's is a full disk, and no end.
TEST_F(Command, AFileThatMayNotGrowIsAFullDisk) {
  const std::string record = folder.file("frames.log");
  const Words words{"doctor", machine, "--sim", plant, "--up", "--for", "2000 s", "--record", record};
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit small{64 * 1024, before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  const Outcome full = berth(words);
  ::setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_EQ(full.status, 3) << full.out << full.err;
  EXPECT_TRUE(contains(full.err, "frames are missing in this record")) << full.err;
  EXPECT_TRUE(contents(record).ends_with('\n'));
}

// Room for the lock file's entry, and none for the table.
TEST_F(Command, AStoreThatNoLongerFitsNamesFileCauseAndRemedy) {
  const SmallDisk disk;
  if (!disk.there()) GTEST_SKIP() << "needs root: only root mounts a disk";
  const std::string store = disk.file("slots.db");
  std::ofstream(store + ".lock") << "1\n";
  disk.fill();
  const Outcome run = berth({"up", machine, "--sim", plant, "--store", store});
  EXPECT_EQ(run.status, 3) << run.out;
  EXPECT_TRUE(contains(run.err, store + ": ")) << run.err;
  EXPECT_TRUE(contains(run.err, "the disk is full; make room on it")) << run.err;
}

TEST_F(Command, AStoreInAReadOnlyFolderNamesFileCauseAndRemedy) {
  const SmallDisk disk;
  if (!disk.there()) GTEST_SKIP() << "needs root: only root mounts a disk";
  disk.make_read_only();
  const std::string store = disk.file("slots.db");
  const Outcome run = berth({"up", machine, "--sim", plant, "--store", store});
  EXPECT_EQ(run.status, 3) << run.out;
  EXPECT_TRUE(contains(run.err, store)) << run.err;
  EXPECT_TRUE(contains(run.err, "Read-only file system; make its folder writable, or name another file with --store"))
      << run.err;
}

TEST_F(Command, WhereThePortIsNotThereNoStoreIsMade) {
  std::string text = small_machine;
  text.replace(text.find("\"sim\""), 5, "\"socketcan:no-can0\"");
  const std::string real = folder.write("real.toml", text);
  const Outcome run = berth({"up", real, "--yes"});
  EXPECT_EQ(run.status, 3) << run.out;
  EXPECT_TRUE(contains(run.err, "socketcan:no-can0") || contains(run.err, "no-can0")) << run.err;
  EXPECT_FALSE(exists(folder.file("real.db")));
  EXPECT_FALSE(exists(folder.file("real.db.lock")));
}

// Whoever gives --sim a file that is no plant file is told of the plant file that lies beside it.
TEST_F(Command, AWrongPlantFileNamesTheOneThatIsThere) {
  const std::string conveyor = folder.write("conveyor.toml", small_machine);
  const std::string meant = folder.write("conveyor.plant.toml", small_plant);
  for (const std::string& wrong : {conveyor, folder.file("conveyor"), folder.file("conveyor.plant"),
                                   folder.file("conveyer.plant.toml"), folder.file("plant")}) {
    for (const Words& words :
         std::vector<Words>{{"up", conveyor, "--sim", wrong}, {"scan", conveyor, "--sim", wrong}}) {
      const Outcome run = berth(words);
      EXPECT_EQ(run.status, 2) << wrong << run.out;
      EXPECT_TRUE(contains(run.err, "did you mean " + meant + "?")) << wrong << ": " << run.err;
    }
  }
  const Outcome alone = berth({"plant", conveyor, "--for", "1s"});
  EXPECT_EQ(alone.status, 2);
  EXPECT_TRUE(contains(alone.err, "did you mean " + meant + "?")) << alone.err;
  // A plant file with a mistake of its own is the one that is meant, and where none is near none is named.
  const std::string broken = folder.write("other.plant.toml", "[bus.line]\nspeed = 3\n");
  EXPECT_FALSE(contains(berth({"up", conveyor, "--sim", broken}).err, "conveyor.plant.toml"));
  const std::string elsewhere = folder.write("lonely.toml", small_machine);
  EXPECT_FALSE(contains(berth({"up", elsewhere, "--sim", folder.file("nothing")}).err, "did you mean"));
}

TEST_F(Command, ABusOnWhichNothingAcknowledgesSaysWhatToLookAt) {
  const std::string empty = folder.write("empty.toml", "[bus.line]\n");
  const std::string cable = "is the bit rate right, is the cable plugged in, do the devices have power";
  const Outcome up = berth({"up", machine, "--sim", empty, "--timeout", "20"});
  EXPECT_EQ(up.status, 1);
  EXPECT_TRUE(contains(up.out, "no device acknowledges what Berth sends: " + cable)) << up.out;
  const Outcome heard = berth({"scan", machine, "--sim", empty});
  EXPECT_EQ(heard.status, 0) << heard.err;
  EXPECT_TRUE(contains(heard.out, "no device was heard in 2 s, and none was asked; `berth scan --all` asks"))
      << heard.out;
  const Outcome scan = berth({"scan", "--all", machine, "--sim", empty});
  EXPECT_EQ(scan.status, 3);
  EXPECT_TRUE(contains(scan.err, "no device acknowledges what Berth sends: " + cable)) << scan.err;
  const Outcome doctor = berth({"doctor", machine, "--sim", empty, "--json"});
  EXPECT_EQ(doctor.status, 1);
  const Json findings = Json::parse(doctor.out).at("findings");
  ASSERT_EQ(findings.size(), 1U) << "the cause of all is told once: " << findings;
  EXPECT_EQ(findings.at(0).at("kind"), "silent-bus");
  EXPECT_TRUE(contains(findings.at(0).at("do"), "is the cable plugged in")) << findings;
  const Outcome asked = berth({"doctor", machine, "--sim", empty, "--active"});
  EXPECT_EQ(asked.status, 1);
  EXPECT_TRUE(contains(asked.out, "silent-bus (certain)")) << asked.out;
  EXPECT_TRUE(contains(asked.out, "no device answered the questions")) << asked.out;
}

// What --on-exit told the devices is what the last table shows.
TEST_F(Command, AtTheEndTheSlotsAreWhatTheyWereTold) {
  std::string text = patient(small_machine);
  const std::string quick = "\"100 ms\"";
  text.replace(text.find(quick), quick.size(), "\"2 s\"");  // no heartbeat tells of it before the end
  const Outcome run = berth({"up", folder.write("calm.toml", text), "--sim", plant, "--on-exit", "stop", "--json"});
  EXPECT_EQ(run.status, 0) << run.out << run.err;
  for (const auto& slot : Json::parse(run.out).at("slots")) {
    EXPECT_EQ(slot.at("state"), "present") << slot;
    EXPECT_TRUE(contains(slot.value("reason", ""), "NMT stopped by command")) << slot;
  }
}

}  // namespace
}  // namespace berth::test
