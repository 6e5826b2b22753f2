// A file that is there whole or not at all.
#include "berth/base/part_file.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "tests/pch.hpp"

namespace berth {
namespace {

namespace fs = std::filesystem;

class PartFileTest : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }
  [[nodiscard]] std::string path() const { return (folder_ / "file").string(); }
  [[nodiscard]] std::string part() const { return fmt::format("{}.{}.part", path(), ::getpid()); }
  [[nodiscard]] std::string text() const {
    std::ifstream in(path());
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void put(const std::string& path, const std::string& text) const { std::ofstream(path) << text; }

 private:
  fs::path folder_ = fs::temp_directory_path() / fmt::format("berth-part-file-{}", ::getpid());
};

TEST_F(PartFileTest, TheOldOneIsThereUntilTheNewOneIs) {
  put(path(), "old");
  PartFile file(path());
  ASSERT_EQ(file.write("new"), 0);
  EXPECT_EQ(text(), "old");
  ASSERT_EQ(file.replace(), 0);
  EXPECT_EQ(text(), "new");
  EXPECT_FALSE(fs::exists(part()));
}

TEST_F(PartFileTest, WhatDoesNotGetThereIsTakenAway) {
  {
    PartFile file(path());
    ASSERT_EQ(file.write("new"), 0);
    EXPECT_TRUE(fs::exists(part()));
  }
  EXPECT_FALSE(fs::exists(part()));
  EXPECT_FALSE(fs::exists(path()));
}

TEST_F(PartFileTest, ANewOneNeverTakesAPlaceThatIsTaken) {
  PartFile file(path());
  ASSERT_EQ(file.write("new"), 0);
  put(path(), "meanwhile");
  EXPECT_EQ(file.place_new(), EEXIST);
  EXPECT_EQ(text(), "meanwhile");
}

// In a container a process has one number at every start.
TEST_F(PartFileTest, WhatACrashLeftIsInNobodysWay) {
  put(part(), "half of");
  PartFile file(path());
  ASSERT_EQ(file.write("new"), 0);
  ASSERT_EQ(file.place_new(), 0);
  EXPECT_EQ(text(), "new");
}

TEST_F(PartFileTest, PermissionsAreKeptWhereThatIsSaid) {
  put(path(), "old");
  ASSERT_EQ(::chmod(path().c_str(), 0664), 0);
  PartFile file(path());
  file.keep_permissions();
  ASSERT_EQ(file.write("new"), 0);
  ASSERT_EQ(file.replace(), 0);
  struct stat now {};
  ASSERT_EQ(::stat(path().c_str(), &now), 0);
  EXPECT_EQ(now.st_mode & 0777U, 0664U);
}

TEST_F(PartFileTest, AFolderThatIsNotThereIsAnErrno) {
  PartFile file(path() + "/none/file");
  EXPECT_EQ(file.write("new"), ENOENT);
}

}  // namespace
}  // namespace berth
