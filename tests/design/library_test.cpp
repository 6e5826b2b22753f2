// The device library, and what slots take from it: recipes, successor types, listed spares.
#include <gtest/gtest.h>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/design/machine.hpp"
#include "tests/pch.hpp"

namespace berth::design {
namespace {

using places::Recipe;

const std::string head =
    "[machine]\nname = \"m\"\ndevices = \"lib.toml\"\n[bus.b]\nport = \"sim\"\nbitrate = 125_000\n";

MachineResult read(const std::string& text, const std::string& library = "") {
  const TypeLoader loader = [](const std::string& path, Findings& findings) -> std::optional<DeviceType> {
    if (path.ends_with("sensor.eds")) return DeviceType{{0x11, 0x22}, 0x00010002};
    findings.push_back({Finding::Severity::error, path, 0, 0, "", "cannot be read", ""});
    return std::nullopt;
  };
  const TextLoader libraries = [&](const std::string& path, Findings&) -> std::optional<std::string> {
    EXPECT_EQ(path, "some/where/lib.toml");
    return library;
  };
  return read_machine(text, "some/where/m.toml", loader, {}, libraries);
}

/// All errors of the two texts, a line each.
std::string errors(const std::string& text, const std::string& library = "") {
  const auto result = read(text, library);
  std::string all;
  for (const auto& finding : result.findings) all += to_string(finding) + "\n";
  EXPECT_EQ(result.machine.has_value(), all.empty());
  return all;
}

std::string slot(const std::string& more, const std::string& type = "type = { vendor = 1, product = 2 }") {
  return "[[slot]]\nbus = \"b\"\nid = 2\nname = \"left\"\n" + type + "\n" + more + "\n";
}

const std::string drive_library = R"(
[[device-type]]
name = "old drive"
type = { vendor = 1, product = 2, revision = 0x0001_0000 }
[device-type.recipe]
from = [1, 127]
then = "power-cycle"
[[device-type.recipe.write]]
object = "2000h:01"
value  = "{id}"
[[device-type.recipe.write]]
object = "0x2001:FF"
value  = 0x1234
size   = 2
[[device-type.recipe.write]]
object = "2002h"
value  = "save"
[[device-type]]
name = "sensor"
eds  = "sensor.eds"
)";

}  // namespace

TEST(Library, ReadsRecipesAndTypes) {
  const auto result = read(head + slot("assign = \"recipe\"", "device = \"old drive\""), drive_library);
  ASSERT_TRUE(result.machine) << to_string(result.findings.at(0));
  const auto& m = *result.machine;
  ASSERT_EQ(m.library.size(), 2U);
  EXPECT_EQ(m.library[1].type, (TypeCode{0x11, 0x22}));
  EXPECT_EQ(m.library[1].revision, 0x00010002U);
  EXPECT_EQ(m.library[1].eds_path, "some/where/sensor.eds");
  EXPECT_EQ(m.library[1].recipe, nullptr);
  const auto& spec = m.slots.at(0).spec;
  EXPECT_EQ(spec.type, (TypeCode{1, 2}));
  EXPECT_EQ(spec.revision, 0x10000U);
  ASSERT_NE(spec.recipe, nullptr);
  const auto& r = *spec.recipe;
  EXPECT_EQ(r.name, "old drive");
  EXPECT_EQ(r.from, (std::vector{NodeId(1), NodeId(127)}));
  EXPECT_EQ(r.after, Recipe::After::power_cycle);
  ASSERT_EQ(r.writes.size(), 3U);
  EXPECT_EQ(r.writes[0], (Recipe::Write{0x2000, 1, 1, 0, true}));
  EXPECT_EQ(r.writes[1], (Recipe::Write{0x2001, 0xFF, 2, 0x1234, false}));
  EXPECT_EQ(r.writes[2], (Recipe::Write{0x2002, 0, 4, 0x65766173, false})) << "73h 61h 76h 65h on the wire";
}

TEST(Library, ASlotsRecipeIsFoundByItsType) {
  const auto result = read(head + slot("assign = \"recipe\""), drive_library);
  ASSERT_TRUE(result.machine) << to_string(result.findings.at(0));
  EXPECT_NE(result.machine->slots.at(0).spec.recipe, nullptr);
  const auto by_lss = read(head + slot(""), drive_library);
  ASSERT_TRUE(by_lss.machine);
  EXPECT_EQ(by_lss.machine->slots.at(0).spec.recipe, nullptr) << "assign = \"lss\": nothing is written by SDO";
}

TEST(Library, StandsInTheMachineFileToo) {
  const auto result =
      read(head + "[[device-type]]\nname = \"x\"\ntype = { vendor = 3, product = 4 }\n" + slot("", "device = \"x\""));
  ASSERT_TRUE(result.machine) << to_string(result.findings.at(0));
  EXPECT_EQ(result.machine->slots.at(0).spec.type, (TypeCode{3, 4}));
}

TEST(Library, MistakesAreNamedWithTheirPlace) {
  const auto line = [](const std::string& library) { return errors(head + slot(""), library); };
  const auto has = [](const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  };
  EXPECT_TRUE(has(line("[[device-type]]\ntype = { vendor = 1, product = 2 }\n"), "some/where/lib.toml:1:1"));
  EXPECT_TRUE(has(line("[[device-type]]\nname = \"a\"\n"), "no type code"));
  EXPECT_TRUE(has(line("[[device-typ]]\nname = \"a\"\n"), "device-type"));
  const std::string a = "[[device-type]]\nname = \"a\"\ntype = { vendor = 1, product = 2 }\n";
  EXPECT_TRUE(has(line(a + a), "is taken"));
  const auto recipe = [&](const std::string& text) { return line(a + "recipe = " + text + "\n"); };
  EXPECT_TRUE(has(recipe("{ write = [{ object = \"2000h\", value = \"{id}\" }] }"), "from"));
  EXPECT_TRUE(has(recipe("{ from = [], write = [{ object = \"2000h\", value = \"{id}\" }] }"), "empty"));
  EXPECT_TRUE(has(recipe("{ from = [128], write = [{ object = \"2000h\", value = \"{id}\" }] }"), "recipe.from"));
  EXPECT_TRUE(has(recipe("{ from = [1] }"), "write"));
  EXPECT_TRUE(has(recipe("{ from = [1], write = [{ object = \"2000h\", value = \"save\" }] }"), "no object gets"));
  EXPECT_TRUE(has(recipe("{ from = [1], write = [{ object = \"2000\", value = \"{id}\" }] }"), "no object"));
  EXPECT_TRUE(has(recipe("{ from = [1], write = [{ object = \"2000h:100\", value = \"{id}\" }] }"), "no object"));
  const std::string id = "{ from = [1], write = [{ object = \"2000h\", value = \"{id}\" }, ";
  EXPECT_TRUE(has(recipe(id + "{ object = \"2001h\", value = 5 }] }"), "size"));
  EXPECT_TRUE(has(recipe(id + "{ object = \"2001h\", value = 256, size = 1 }] }"), "does not fit"));
  EXPECT_TRUE(has(recipe(id + "{ object = \"2001h\", value = -1, size = 8 }] }"), "does not fit"));
  EXPECT_TRUE(has(recipe(id + "{ object = \"2001h\", value = \"nine chars\" }] }"), "1 to 8 bytes"));
  EXPECT_TRUE(has(recipe(id + "{ object = \"2001h\", value = \"save\", size = 2 }] }"), "1 to 8 bytes"));
}

TEST(Library, SlotsThatTheLibraryCannotServe) {
  EXPECT_NE(errors(head + slot("assign = \"recipe\"")).find("no recipe for type"), std::string::npos);
  EXPECT_NE(errors(head + slot("assign = \"recipe\"", "device = \"sensor\""), drive_library).find("no recipe"),
            std::string::npos);
  EXPECT_NE(errors(head + slot("", "device = \"old drivee\""), drive_library).find("did you mean \"old drive\""),
            std::string::npos);
  EXPECT_NE(errors(head + slot("device = \"sensor\""), drive_library).find("exclude each other"), std::string::npos);
}

// SX: revision = exact | major | any, further types and spares of a slot.
TEST(SlotTypes, SuccessorsAndSparesAreRead) {
  const std::string more =
      "revision = \"major\"\n"
      "also = [{ vendor = 1, product = 3, revision = 0x0002_0000 }, { device = \"old drive\" }]\nspares = [7, "
      "0xFFFF_FFFF]";
  const auto result =
      read(head + slot(more, "type = { vendor = 1, product = 9, revision = 0x0001_0001 }"), drive_library);
  ASSERT_TRUE(result.machine) << to_string(result.findings.at(0));
  const auto& spec = result.machine->slots.at(0).spec;
  EXPECT_EQ(spec.also, (std::vector<places::AlsoType>{{{1, 3}, 0x20000U}, {{1, 2}, 0x10000U}}));
  EXPECT_EQ(spec.spares, (std::vector<std::uint32_t>{7, 0xFFFFFFFF}));
}

TEST(SlotTypes, WhatCannotBeMeantIsAnError) {
  const auto has = [](const std::string& more, const std::string& part) {
    const auto said = errors(head + slot(more), drive_library);
    return said.find(part) != std::string::npos;
  };
  EXPECT_TRUE(has("spares = [7, 7]", "appears twice"));
  EXPECT_TRUE(has("spares = [-1]", "spares"));
  EXPECT_TRUE(has("also = [{ vendor = 1, product = 2 }]", "appears twice"));
  EXPECT_TRUE(has("also = [{ vendor = 1, product = 5 }, { vendor = 1, product = 5 }]", "appears twice"));
  EXPECT_TRUE(has("also = [{ vendor = 1 }]", "product"));
  EXPECT_TRUE(has("also = [{ device = \"nothing\" }]", "has no"));
  const std::string other = "[[slot]]\nbus = \"b\"\nid = 3\nname = \"right\"\ntype = { vendor = 1, product = 2 }\n";
  EXPECT_TRUE(has("spares = [7]\n" + other + "spares = [7]", "is kept for slot \"left\" too"));
  const std::string range =
      "[[slot]]\nbus = \"b\"\nids = \"1..2\"\nname = \"x{id}\"\ntype = { vendor = 1, product = 2 }\n";
  EXPECT_NE(errors(head + range + "spares = [7]").find("kept for one slot"), std::string::npos);
}

}  // namespace berth::design
