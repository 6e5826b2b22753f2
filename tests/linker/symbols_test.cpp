// S5.8: network variables as the programming system reads them.
#include <gtest/gtest.h>

#include <algorithm>
#include <pugixml.hpp>
#include <regex>

#include "berth/linker/files.hpp"
#include "berth/linker/symbols.hpp"
#include "tests/linker/devices.hpp"
#include "tests/linker/judge.hpp"

using namespace berth;
using namespace berth::test;
using linker::make_plan;
using linker::wrong_identifier;

namespace {

struct Symbol {
  std::string name;
  std::string type;
  std::string address;
  friend auto operator<=>(const Symbol&, const Symbol&) = default;
};

std::vector<Symbol> read_xml(const std::string& text) {
  pugi::xml_document document;
  EXPECT_TRUE(document.load_string(text.c_str()));
  std::vector<Symbol> made;
  const auto globals =
      document.select_node("/project/instances/configurations/configuration/resource/globalVars").node();
  for (const auto& each : globals.children("variable")) {
    made.push_back(
        {each.attribute("name").value(), each.child("type").first_child().name(), each.attribute("address").value()});
  }
  return made;
}

std::vector<Symbol> read_structured_text(const std::string& text) {
  std::vector<Symbol> made;
  const std::regex line("^  (\\w+)(?: AT (%[A-Z0-9.]+))? : (\\w+); \\(\\*[^*]*\\*\\)$", std::regex::multiline);
  for (auto at = std::sregex_iterator(text.begin(), text.end(), line); at != std::sregex_iterator(); ++at) {
    made.push_back({(*at)[1], (*at)[3], (*at)[2]});
  }
  EXPECT_NE(text.find("\nVAR_GLOBAL\n"), std::string::npos);
  EXPECT_TRUE(text.ends_with("END_VAR\n"));
  return made;
}

}  // namespace

TEST(LinkSymbols, S5_8_TheProgrammingSystemReadsTheVariables) {
  const auto plc = file_of(controller());
  auto network = network_of({{"press <1> & \"2\"", plc}, {"belt", plc}});
  using enum od::DataType;
  const std::string press = "press <1> & \"2\"/";
  add_link(network, press + "speed", {"belt/speed"}, {}, 255, unsigned16);
  add_link(network, press + "count", {"belt/count"}, {}, 255, unsigned16);
  add_link(network, press + "level", {"belt/level"}, {}, 255, real32);
  add_link(network, press + "small", {"belt/small"}, {}, 255, integer8);
  add_link(network, press + "odd", {"belt/odd"}, {}, 255, unsigned24);
  add_link(network, "belt/answer", {press + "answer"}, {}, 255, integer64);
  const auto made = make_plan(network);
  ASSERT_TRUE(made.good());
  // PPOffset of the segments: 0 (INTEGER8), 8000h (UNSIGNED16), C000h (UNSIGNED24), 12000h (REAL32), 14000h
  // (INTEGER64).
  std::vector<Symbol> wanted{{"small", "SINT", "%QB0"}, {"count", "UINT", "%QW16384"}, {"speed", "UINT", "%QW16385"},
                             {"odd", "UDINT", ""},      {"level", "REAL", "%QD18432"}, {"answer", "LINT", "%IL10240"}};
  EXPECT_EQ(read_xml(plcopen_xml(network, made.plan, 0)), wanted);
  EXPECT_EQ(read_structured_text(global_variables(network, made.plan, 0)), wanted);
  const auto files = linker::make_files(network, made.plan);
  ASSERT_TRUE(files);
  for (const char* const name :
       {"press__1_____2_.plcopen.xml", "press__1_____2_.gvl.st", "belt.plcopen.xml", "belt.gvl.st"}) {
    EXPECT_NE(std::ranges::find(*files, name, &linker::MadeFile::name), files->end()) << name;
  }
  // The DCF has the same names for the same objects.
  const Dcf dcf(std::ranges::find(*files, "belt.dcf", &linker::MadeFile::name)->bytes);
  for (const auto& each : made.plan.variables) {
    if (each.node == 1) {
      EXPECT_EQ(dcf.named(each.name), each.object.index << 8U | each.object.sub) << each.name;
    }
  }
}

TEST(LinkSymbols, NamesOfVariables) {
  for (const char* const good : {"speed", "_x", "A1", "belt_2_speed", "ends"})
    EXPECT_EQ(wrong_identifier(good), "") << good;
  for (const char* const bad : {"", "1a", "a b", "a__b", "a_", "BOOL", "if", "é", "a-b", "a.b"}) {
    EXPECT_NE(wrong_identifier(bad), "") << bad;
  }
}
