// The file of a campaign: appended to, torn, locked, full, not ours.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <cerrno>
#include <string>

#include "berth/campaign/line_file.hpp"
#include "tests/campaign/folder.hpp"

namespace berth::campaign {
namespace {

std::string text_of(std::uint64_t seed) {
  Line line;
  line.key = {.kind = Kind::trees, .options = {}, .version = "0.1.0", .seed = seed};
  return to_json(line);
}

TEST(CampaignFile, IsMadeAndGoesOn) {
  const test::Folder folder;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    Results known;
    auto file = LineFile::open(folder.file("a"), known);
    ASSERT_TRUE(file);
    EXPECT_EQ(known.lines().size(), seed - 1);
    EXPECT_TRUE(file->append(text_of(seed)));
    EXPECT_TRUE(file->sync());
  }
  EXPECT_EQ(test::contents(folder.file("a")), text_of(1) + "\n" + text_of(2) + "\n" + text_of(3) + "\n");
}

TEST(CampaignFile, ATornLastLineIsTakenOffAtEveryByte) {
  const test::Folder folder;
  const std::string one = text_of(1) + "\n", two = text_of(2);
  for (std::size_t size = 0; size <= two.size(); ++size) {
    for (const std::string& before : {std::string(), one}) {
      Results known;
      auto file = LineFile::open(folder.write("a", before + two.substr(0, size)), known);
      ASSERT_TRUE(file) << size;
      ASSERT_TRUE(file->append(text_of(9)));
      const std::string kept = size == two.size() ? two + "\n" : "";
      EXPECT_EQ(test::contents(folder.file("a")), before + kept + text_of(9) + "\n") << size;
    }
  }
}

TEST(CampaignFile, AnotherFileIsNotTouched) {
  const test::Folder folder;
  for (const std::string& text : {std::string("a thesis"), std::string("a thesis\n"), text_of(1) + "\na thesis\n",
                                  std::string(R"({"kinds":1})"), std::string("{\"kind\":\"log\",\"text\":1}\n")}) {
    Results known;
    const auto file = LineFile::open(folder.write("a", text), known);
    ASSERT_FALSE(file) << text;
    EXPECT_EQ(file.error().code, Errc::invalid);
    EXPECT_EQ(test::contents(folder.file("a")), text);
  }
  Results known;
  EXPECT_EQ(LineFile::open("/dev/null", known).error().code, Errc::invalid);
  EXPECT_EQ(LineFile::open(folder.file("none/a"), known).error().detail, static_cast<std::uint32_t>(ENOENT));
}

TEST(CampaignFile, OneProcessWritesIt) {
  const test::Folder folder;
  Results known;
  const auto file = LineFile::open(folder.file("a"), known);
  ASSERT_TRUE(file);
  Results other;
  const auto second = LineFile::open(folder.file("a"), other);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Errc::duplicate);
}

// In a process of its own: the limit is of the process. It stands for a full disk, as write(2) writes a part and then
// nothing.
TEST(CampaignFile, WhatDoesNotFitLeavesNoHalfLine) {
  const test::Folder folder;
  const std::string path = folder.file("a");
  const rlim_t room = text_of(1).size() + 1 + text_of(2).size() / 2;
  const pid_t child = ::fork();
  if (child == 0) {
    ::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{room, room};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    Results known;
    auto file = LineFile::open(path, known);
    const bool first = file && file->append(text_of(1)).has_value();
    const auto second = first ? file->append(text_of(2)) : Result<void>();
    const bool told = !second && second.error().code == Errc::io && second.error().detail == EFBIG;
    ::_exit(first && told ? 0 : 1);
  }
  int status = -1;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(test::contents(path), text_of(1) + "\n");
}

}  // namespace
}  // namespace berth::campaign
