// A file that was given in place of another.
#include "berth/text/taken_for.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <optional>
#include <string>

#include "../paths.hpp"
#include "berth/text/file.hpp"

namespace berth::text {
namespace {

std::string said(FileKind wanted, std::string_view text) {
  const auto other = taken_for(wanted, text, "a.file");
  return other ? to_string(*other) : "";
}

TEST(TakenFor, ADescriptionIsNeitherMachineNorPlant) {
  for (const FileKind wanted : {FileKind::machine, FileKind::plant}) {
    const std::string eds = said(wanted, "; made by hand\r\n[FileInfo]\r\nFileName=a\r\n[DeviceInfo]\r\n");
    EXPECT_EQ(
        eds,
        "a.file: error: this is a device description (EDS, DCF or XDD); `berth init --eds a.file` makes a machine "
        "file and a plant file of it");
    EXPECT_EQ(said(wanted, "<?xml version=\"1.0\"?>\n<ISO15745ProfileContainer/>"), eds);
  }
}

TEST(TakenFor, MachineAndPlantAreToldApart) {
  const std::string machine = "[machine]\nname = \"a\"\n[[slot]]\nid = 1\n";
  const std::string plant = "# devices\n[bus.a]\nbitrate = 1\n  [[device]]\nname = \"x\"\n";
  EXPECT_EQ(said(FileKind::machine, machine), "");
  EXPECT_EQ(said(FileKind::plant, plant), "");
  EXPECT_NE(said(FileKind::machine, plant).find("this is a plant file"), std::string::npos);
  EXPECT_NE(said(FileKind::machine, plant).find("--sim a.file"), std::string::npos);
  EXPECT_NE(said(FileKind::plant, machine).find("this is a machine file"), std::string::npos);
}

TEST(TakenFor, WhatMayBeEitherIsReadLineByLine) {
  for (const char* const text : {"", "nonsense", "[bus.a]", "# [plant]\n", "[FileInfo]\n", "name = \"[machine]\"\n",
                                 "[machine]\n[plant]\n", "[[slot]]\n[[device]]\n"}) {
    EXPECT_EQ(said(FileKind::machine, text), "") << text;
    EXPECT_EQ(said(FileKind::plant, text), "") << text;
  }
}

TEST(TakenFor, NoExampleIsTakenForAnother) {
  unsigned files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(test::source_dir() + "/examples")) {
    const std::string path = entry.path().string();
    if (!path.ends_with(".toml")) continue;
    Findings none;
    const auto text = read_file(path, none);
    ASSERT_TRUE(text) << path;
    const bool is_plant = path.ends_with("plant.toml");
    const bool is_machine = text->find("\n[machine]") != std::string::npos;
    if (!is_plant && !is_machine) continue;
    ++files;
    EXPECT_EQ(said(is_plant ? FileKind::plant : FileKind::machine, *text), "") << path;
    EXPECT_NE(said(is_plant ? FileKind::machine : FileKind::plant, *text), "") << path;
  }
  EXPECT_GE(files, 20U);
}

}  // namespace
}  // namespace berth::text
