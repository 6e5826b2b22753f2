// Which files a file may name (docs/security.md).
#include "berth/text/reach.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "../pch.hpp"

namespace berth::text {
namespace {

namespace fs = std::filesystem;

class ReachOf : public testing::Test {
 protected:
  void SetUp() override {
    home_ = fs::temp_directory_path() / ("berth-reach-" + std::to_string(::getpid()));
    fs::remove_all(home_);
    for (const char* const each : {"plants/line/eds", "plants/shared", "elsewhere"})
      fs::create_directories(home_ / each);
    for (const char* const each : {"plants/line/eds/a.eds", "plants/shared/b.eds", "elsewhere/secret"}) touch(each);
  }
  void TearDown() override { fs::remove_all(home_); }
  void touch(const std::string& name) const { std::ofstream(home_ / name) << "x"; }
  std::string machine() const { return (home_ / "plants/line/machine.toml").string(); }
  std::string at(const std::string& name) const { return (home_ / name).string(); }
  bool reaches(const std::string& name, const std::vector<std::string>& allowed = {}) const {
    return Reach(machine(), allowed).path(name).has_value();
  }
  fs::path home_;
};

}  // namespace

TEST_F(ReachOf, AFileAreItsFolderAndThoseBeneath) {
  const auto found = Reach(machine()).path("eds/a.eds");
  ASSERT_TRUE(found);
  EXPECT_TRUE(fs::equivalent(*found, at("plants/line/eds/a.eds")));
  for (const std::string& name : {std::string("new.eds"), std::string("not/there/yet.eds"), std::string("./eds/a.eds"),
                                  std::string("eds/../eds/a.eds"), at("plants/line/eds/a.eds")})
    EXPECT_TRUE(reaches(name)) << name;
  for (const std::string& name : {std::string("../shared/b.eds"), std::string("eds/../../shared/b.eds"),
                                  std::string("../line2/x.eds"), at("elsewhere/secret"), std::string("/etc/passwd"),
                                  std::string(".."), std::string("../../elsewhere/not-there")})
    EXPECT_FALSE(reaches(name)) << name;
}

TEST_F(ReachOf, ALinkCountsAsWhatItLeadsTo) {
  fs::create_symlink(at("elsewhere/secret"), at("plants/line/one.eds"));
  fs::create_symlink(at("elsewhere"), at("plants/line/folder"));
  fs::create_symlink(at("plants/line/eds/a.eds"), at("plants/line/inner.eds"));
  fs::create_symlink(at("elsewhere/not-there"), at("plants/line/dangling.eds"));
  EXPECT_FALSE(reaches("one.eds"));
  EXPECT_FALSE(reaches("folder/secret"));
  EXPECT_FALSE(reaches("folder/not-there"));
  EXPECT_FALSE(reaches("dangling.eds"));
  EXPECT_TRUE(reaches("inner.eds"));
}

TEST_F(ReachOf, AProjectIsReachedAsAWhole) {
  touch("plants/berth-project.toml");
  EXPECT_TRUE(reaches("../shared/b.eds"));
  EXPECT_FALSE(reaches("../../elsewhere/secret"));
  EXPECT_TRUE(fs::equivalent(Reach(machine()).folder(), at("plants")));
  // The nearest one counts.
  touch("plants/line/berth-project.toml");
  EXPECT_FALSE(reaches("../shared/b.eds"));
}

// In a folder that several users write to, another one could make all of it a project.
TEST_F(ReachOf, AProjectOfAnotherUserIsNone) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root: only root gives a file away";
  touch("plants/berth-project.toml");
  ASSERT_EQ(::chown(at("plants/berth-project.toml").c_str(), 12345, 12345), 0);
  // Root's own files may be marked by root alone.
  EXPECT_FALSE(reaches("../shared/b.eds"));
}

// The system reads a name up to its first NUL, and TOML can write one. (Found by libFuzzer.)
TEST_F(ReachOf, ANameWithANulReachesNothing) {
  using namespace std::string_view_literals;
  for (const auto name : {"..\0/shared/b.eds"sv, "../shared/a.eds\0/../../line/b.eds"sv,
                          "sub/../../shared/a.eds\0/../../line/b.eds"sv, "b.eds\0"sv, "\0"sv}) {
    EXPECT_FALSE(reaches(std::string(name))) << name.size();
  }
}

// Two million folders deep it would take 271 MB to follow.
TEST_F(ReachOf, ANameThatNoSystemOpensIsNotFollowed) {
  std::string name;
  while (name.size() < 1000) name += "x/";
  EXPECT_TRUE(reaches(name));
  EXPECT_FALSE(reaches(std::string(Reach::longest + 1, 'x')));
}

TEST_F(ReachOf, APersonAllowsFolders) {
  for (const char* const slash : {"", "/"}) {
    const std::vector<std::string> allowed{at("plants/shared") + slash};
    EXPECT_TRUE(reaches("../shared/b.eds", allowed));
    EXPECT_TRUE(reaches("eds/a.eds", allowed));
    EXPECT_FALSE(reaches("../sharedx/b.eds", allowed));
    EXPECT_FALSE(reaches("../../elsewhere/secret", allowed));
  }
}

// `berth up machine.toml` in the machine's folder, and a text that is no file.
TEST_F(ReachOf, ANameWithoutAFolderIsInTheWorkingFolder) {
  const auto before = fs::current_path();
  fs::current_path(at("plants/line"));
  EXPECT_TRUE(Reach("machine.toml").path("eds/a.eds"));
  EXPECT_TRUE(Reach("").path("eds/a.eds"));
  EXPECT_FALSE(Reach("machine.toml").path("../shared/b.eds"));
  fs::current_path(before);
}

}  // namespace berth::text
