// What a machine file and a device library name stays in their folder, by every key (docs/security.md).
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "../pch.hpp"
#include "berth/design/machine.hpp"

namespace berth::design {
namespace {

const std::string every_key =
    "[machine]\nname = \"m\"\n"
    "{machine}"
    "[bus.a]\nport = \"sim\"\nbitrate = 125000\n"
    "[bus.b]\nport = \"gateway\"\nbitrate = 125000\nmaster_id = 1\n"
    "gateway = { bus = \"a\", slot = 3{gateway} }\n"
    "[[slot]]\nbus = \"a\"\nid = 3\nname = \"g\"\n{slot}"
    "{rest}";

std::string text_of(const std::string& key, const std::string& name) {
  std::string text = every_key;
  const auto put = [&](const std::string& where, const std::string& what) {
    const auto at = text.find(where);
    if (at != std::string::npos) text.replace(at, where.size(), what);
  };
  const std::string type = "type = { vendor = 1, product = 2 }\n";
  const std::string quoted = "\"" + name + "\"";
  put("{machine}", key == "devices" || key == "link_plan" ? key + " = " + quoted + "\n" : "");
  put("{gateway}", key == "gateway" ? ", eds = " + quoted : "");
  put("{slot}", key == "eds"      ? "eds = " + quoted + "\n"
                : key == "config" ? type + "config = " + quoted + "\n"
                : key == "file"   ? type + "programs = [{ file = " + quoted + ", identification = 1 }]\n"
                                  : type);
  put("{rest}", key == "device-type" ? "[[device-type]]\nname = \"d\"\neds = " + quoted + "\n" : "");
  return text;
}

}  // namespace

TEST(Reach, NoKeyOfAMachineFileLeadsOut) {
  unsigned opened = 0;
  const TypeLoader types = [&](const std::string&, Findings&) -> std::optional<DeviceType> {
    ++opened;
    return DeviceType{{1, 2}, std::nullopt, nullptr};
  };
  const ConfigLoader configs = [&](const std::string&, Findings&) -> std::optional<ConfigType> {
    ++opened;
    return std::nullopt;
  };
  const TextLoader texts = [&](const std::string&, Findings&) -> std::optional<std::string> {
    ++opened;
    return "";
  };
  for (const char* const key : {"devices", "link_plan", "gateway", "eds", "config", "file", "device-type"}) {
    for (const char* const name : {"/etc/hostname", "../outside", "eds/../../outside"}) {
      SCOPED_TRACE(std::string(key) + " " + name);
      const auto result = read_machine(text_of(key, name), "/tmp/machines/m.toml", types, configs, texts);
      EXPECT_FALSE(result.machine);
      EXPECT_EQ(opened, 0U);
      ASSERT_EQ(result.findings.size(), 1U);
      const auto& finding = result.findings.front();
      EXPECT_EQ(finding.message, "\"" + std::string(name) + "\" leads out of /tmp/machines");
      EXPECT_GT(finding.line, 1);
      EXPECT_GT(finding.column, 1);
      const std::vector<std::string> allowed{"/etc", "/tmp"};
      const auto permitted = read_machine(text_of(key, name), "/tmp/machines/m.toml", types, configs, texts, allowed);
      for (const auto& each : permitted.findings) EXPECT_EQ(each.message.find("leads out"), std::string::npos);
      opened = 0;
    }
  }
}

// Each is followed on the disk: a file of names that lead out would take long.
TEST(Reach, OfManyNamesThatLeadOutTheFirstHundredAreFollowed) {
  std::string text = "[machine]\nname = \"m\"\n[bus.a]\nport = \"sim\"\nbitrate = 125000\n";
  for (int i = 1; i <= 120; ++i) {
    const std::string number = std::to_string(i);
    text += "[[slot]]\nbus = \"a\"\nid = " + number + "\nname = \"s" + number + "\"\neds = \"../" + number + "\"\n";
  }
  const TypeLoader none = [](const std::string&, Findings&) -> std::optional<DeviceType> { return std::nullopt; };
  const auto result = read_machine(text, "/tmp/machines/m.toml", none);
  EXPECT_FALSE(result.machine);
  EXPECT_EQ(std::ranges::count_if(result.findings,
                                  [](const auto& f) { return f.message.find("leads out") != std::string::npos; }),
            100);
}

}  // namespace berth::design
