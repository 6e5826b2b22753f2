// `berth note`: notes that a person writes, and where they show.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "../pch.hpp"
#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

// A drive with a description of its own, beside which notes can stand. No process runs the machine.
class NoteVerb : public ::testing::Test {
 protected:
  NoteVerb() {
    fs::copy_file(example("eds/belt.eds"), folder_.file("belt.eds"));
    machine_ = folder_.write("machine.toml", R"([machine]
name = "noted"
[bus.field]
port    = "socketcan:nowhere0"
bitrate = 250_000
[[slot]]
bus  = "field"
id   = 5
name = "belt"
eds  = "belt.eds"
[[slot]]
bus  = "field"
id   = 6
name = "bare"
type = { vendor = 1, product = 1 }
)");
  }
  [[nodiscard]] Outcome note(Words words) const {
    words.insert(words.begin(), "note");
    words.insert(words.end(), {"-m", machine_, "--json"});
    return berth(words);
  }
  [[nodiscard]] Json told(const Words& words) const {
    const Outcome outcome = note(words);
    EXPECT_EQ(outcome.status, 0) << outcome.out << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  }
  [[nodiscard]] std::string held() const { return exists(file()) ? contents(file()) : "none"; }
  [[nodiscard]] std::string file() const { return folder_.file("belt.notes"); }

  Folder folder_;
  std::string machine_;
};

TEST_F(NoteVerb, IsWrittenBesideTheDescriptionAndReadAgain) {
  const Json before = told({"read", "belt", "6000h:01"});
  EXPECT_EQ(before.at("note").at("text"), "Digital inputs, 8 a byte") << "built in for CiA 401";
  EXPECT_FALSE(before.contains("own"));
  EXPECT_EQ(before.at("file"), file());
  EXPECT_EQ(held(), "none") << "reading writes nothing";

  const Json after =
      told({"write", "belt", "6000h:01", "--bit", "0=light barrier", "--bit", "7=door", "--value", "0xFF=all"});
  EXPECT_EQ(held(), "[\"6000h:01\"]\nvalues = { 255 = \"all\" }\nbits = { 0 = \"light barrier\", 7 = \"door\" }\n");
  EXPECT_EQ(after.at("note").at("text"), "Digital inputs, 8 a byte") << "what is not given stays as it is built in";
  EXPECT_EQ(after.at("note").at("bits").at("7"), "door");
  EXPECT_EQ(after.at("own"), Json({{"values", {{"255", "all"}}}, {"bits", {{"0", "light barrier"}, {"7", "door"}}}}));

  static_cast<void>(told({"write", "belt", "6000h:01", "--text", "Belt", "--bit", "7="}));
  EXPECT_EQ(told({"read", "belt", "6000h:01"}).at("own"),
            Json({{"text", "Belt"}, {"values", {{"255", "all"}}}, {"bits", {{"0", "light barrier"}}}}));
  static_cast<void>(told({"write", "belt", "6000h:01", "--anew", "--unit", "inputs", "--scale", "0.5"}));
  EXPECT_EQ(held(), "[\"6000h:01\"]\nunit = \"inputs\"\nscale = 0.5\n");
  static_cast<void>(told({"remove", "belt", "6000h:01"}));
  EXPECT_EQ(held(), "");
}

TEST_F(NoteVerb, WhatIsWrongIsToldAndNothingIsWritten) {
  const auto refused = [&](const Words& words, int status, const std::string& why) {
    const Outcome outcome = note(words);
    EXPECT_EQ(outcome.status, status) << outcome.out;
    EXPECT_NE((outcome.out + outcome.err).find(why), std::string::npos) << outcome.out << outcome.err;
    EXPECT_EQ(held(), "none");
  };
  refused({"write", "belt", "6000h:01"}, 2, "would be empty");
  refused({"write", "belt", "6000h:01", "--scale", "0", "--unit", "V"}, 2, "not a number greater than 0");
  refused({"write", "belt", "6000h:01", "--scale", "0.1"}, 2, "a scale needs a unit");
  refused({"write", "belt", "6000h:01", "--bit", "64=x"}, 2, "from 0 to 63");
  refused({"write", "belt", "6000h:01", "--value", "on"}, 2, "N=NAME");
  refused({"write", "belt", "6000h:01", "--text", "two\nlines"}, 2, "one line");
  refused({"write", "belt", "6000h:01", "--text", std::string(1001, 'x')}, 2, "1000 bytes");
  refused({"write", "bare", "6000h:01", "--text", "x"}, 1, "no description");
  refused({"remove", "belt", "6000h:01"}, 3, "has no note");
  refused({"write", "belt", "no such object", "--text", "x"}, 2, "no such object");
  fs::create_directory(file());
  const Outcome outcome = note({"write", "belt", "6000h:01", "--text", "x"});
  EXPECT_EQ(outcome.status, 3);
  EXPECT_NE((outcome.out + outcome.err).find("not a plain file"), std::string::npos) << outcome.out << outcome.err;
}

// In a trace, in documents, and on the way to another computer.
TEST_F(NoteVerb, ShowsWhereTheObjectDoes) {
  static_cast<void>(told({"write", "belt", "6000h:01", "--unit", "boxes", "--scale", "0.5", "--value", "4=two"}));
  const std::string log = folder_.write("run.log",
                                        "(1.000000) field 185#040000\n(1.100000) field 605#4000600100000000\n"
                                        "(1.110000) field 585#4F00600103000000\n");
  const Outcome trace = berth({"trace", log, "-m", machine_});
  ASSERT_EQ(trace.status, 0) << trace.err;
  EXPECT_NE(trace.out.find(" = 4 (2 boxes, two)"), std::string::npos) << trace.out;
  EXPECT_NE(trace.out.find(" = 3 = 1.5 boxes"), std::string::npos) << trace.out;
  const Outcome rows = berth({"trace", log, "-m", machine_, "--json"});
  EXPECT_NE(rows.out.find("\"meaning\":\"1.5 boxes\""), std::string::npos) << rows.out;

  ASSERT_EQ(berth({"document", machine_, "-o", folder_.file("made")}).status, 0);
  const std::string page = contents(folder_.file("made/device-1.html"));
  EXPECT_NE(page.find("<td>0.5 boxes</td><td>Digital inputs, 8 a byte; 4 = two"), std::string::npos) << page;
  const std::string dbc = contents(folder_.file("made/field.dbc"));
  EXPECT_NE(dbc.find("@1+ (0.5,0) [0|0] \"boxes\""), std::string::npos) << dbc;
  EXPECT_NE(dbc.find(" 4 \"two\" ;"), std::string::npos) << dbc;

  ASSERT_EQ(berth({"export", machine_, folder_.file("out.berth")}).status, 0);
  ASSERT_EQ(berth({"import", folder_.file("out.berth"), folder_.file("there")}).status, 0);
  EXPECT_EQ(contents(folder_.file("there/belt.notes")), held());
}

// An XDD says units and names of values: they count before what is built in, and give way to the file beside it.
TEST_F(NoteVerb, AnXddSaysItsOwn) {
  ASSERT_EQ(berth({"eds", "convert", example("eds/sensor.eds"), folder_.file("heater.xdd")}).status, 0);
  std::string xdd = contents(folder_.file("heater.xdd"));
  xdd.insert(xdd.find("</ProfileBody>"),
             "<co:ApplicationProcess><co:parameterList>"
             "<co:parameter uniqueID=\"P1\" access=\"readWrite\"><label lang=\"en\">Set point</label>"
             "<description lang=\"en\">Wanted\n  temperature</description><INT/>"
             "<co:allowedValues><co:value value=\"-1\"><label lang=\"en\">no sensor</label></co:value><co:range/>"
             "</co:allowedValues><co:unit multiplier=\"0.1\"><label lang=\"en\">°C</label></co:unit></co:parameter>"
             "</co:parameterList></co:ApplicationProcess>");
  xdd.insert(xdd.find("</co:CANopenObjectList>"),
             "<CANopenObject index=\"5F00\" name=\"Set point\" objectType=\"7\" uniqueIDRef=\"P1\"/>");
  (void)folder_.write("heater.xdd", xdd);
  const std::string machine = folder_.write("heater.toml",
                                            "[machine]\nname = \"one\"\n[bus.line]\nport = \"sim\"\n"
                                            "bitrate = 500_000\n[[slot]]\nbus = \"line\"\nid = 5\n"
                                            "name = \"heater\"\neds = \"heater.xdd\"\n");
  const Outcome bare = berth({"note", "read", "heater", "Set point", "-m", machine});
  EXPECT_EQ(bare.status, 0) << bare.err;
  EXPECT_NE(bare.out.find("5F00h:00  Set point: Wanted temperature, 0.1 °C; -1 = no sensor\n"), std::string::npos)
      << bare.out;
  const std::string log = folder_.write("run.log",
                                        "(1.000000) can0 605#2B005F00EB000000\n(1.010000) can0 585#60005F0000000000\n"
                                        "(1.100000) can0 605#2B005F00FFFF0000\n(1.110000) can0 585#60005F0000000000\n");
  const Outcome trace = berth({"trace", log, "-m", machine});
  EXPECT_EQ(trace.status, 0) << trace.err;
  EXPECT_NE(trace.out.find("= 235 = 23.5 °C"), std::string::npos) << trace.out;
  EXPECT_NE(trace.out.find("= -1 = -0.1 °C, no sensor"), std::string::npos) << trace.out;
  ASSERT_EQ(berth({"note", "write", "heater", "5F00h", "--unit", "K", "-m", machine}).status, 0);
  const Outcome own = berth({"trace", log, "-m", machine});
  EXPECT_NE(own.out.find("= 235 = 235 K"), std::string::npos) << own.out;
  EXPECT_NE(own.out.find("= -1 = -1 K, no sensor"), std::string::npos) << own.out;
}

// What is wrong with the notes is told, and the trace is read without them.
TEST_F(NoteVerb, OfAFileThatIsWrongATraceIsReadAllTheSame) {
  (void)folder_.write("belt.notes", "[\"6000h:01\"]\nscale = 0\n");
  const std::string log = folder_.write("run.log", "(1.000000) field 185#040000\n");
  const Outcome trace = berth({"trace", log, "-m", machine_});
  EXPECT_EQ(trace.status, 0);
  EXPECT_NE(trace.err.find("belt.notes:2"), std::string::npos) << trace.err;
  EXPECT_NE(trace.out.find("TPDO 1 of node 5"), std::string::npos) << trace.out;
}

}  // namespace
}  // namespace berth::test
