// berth eds: check, convert, diff, show; and a description compared with a device on a bus.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "machines.hpp"
#include "process.hpp"
#include "tests/eds_folder.hpp"

namespace berth::test::eds_command_tests {
namespace {

using Json = nlohmann::json;

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// A minimal device that `berth eds check` has nothing to say about.
constexpr const char* sound_eds = R"(; written by hand
[FileInfo]
FileName=sensor.eds
FileVersion=1
FileRevision=1
EDSVersion=4.0

[DeviceInfo]
VendorName=Maker
VendorNumber=1
ProductName=Sensor
ProductNumber=7
RevisionNumber=3
BaudRate_250=1
BaudRate_500=1
Granularity=8
NrOfRXPDO=0
NrOfTXPDO=0
LSS_Supported=1

[MandatoryObjects]
SupportedObjects=3
1=0x1000
2=0x1001
3=0x1018

[OptionalObjects]
SupportedObjects=1
1=0x1017

[ManufacturerObjects]
SupportedObjects=1
1=0x2000

[1000]
ParameterName=Device type
ObjectType=7
DataType=7
AccessType=ro
DefaultValue=0

[1001]
ParameterName=Error register
ObjectType=7
DataType=5
AccessType=ro

[1017]
ParameterName=Producer heartbeat time
ObjectType=7
DataType=6
AccessType=rw
DefaultValue=0

[1018]
ParameterName=Identity
ObjectType=9
SubNumber=5

[1018sub0]
ParameterName=Highest sub-index
DataType=5
AccessType=const
DefaultValue=4

[1018sub1]
ParameterName=Vendor-ID
DataType=7
AccessType=ro
DefaultValue=1

[1018sub2]
ParameterName=Product code
DataType=7
AccessType=ro
DefaultValue=7

[1018sub3]
ParameterName=Revision number
DataType=7
AccessType=ro
DefaultValue=3

[1018sub4]
ParameterName=Serial number
DataType=7
AccessType=ro

[2000]
ParameterName=Limit <mm>
ObjectType=7
DataType=6
AccessType=rw
DefaultValue=$NODEID+0x10
LowLimit=1
HighLimit=900
)";

std::string changed(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

/// The same device with two values and a place in a network.
std::string sound_dcf() {
  std::string text = changed(sound_eds, "DefaultValue=$NODEID+0x10", "DefaultValue=$NODEID+0x10\nParameterValue=0x20");
  text = changed(text, "AccessType=rw\nDefaultValue=0\n", "AccessType=rw\nDefaultValue=0\nParameterValue=500\n");
  return text +
         "\n[DeviceComissioning]\nNodeID=9\nNodeName=left\nBaudrate=250\nNetNumber=1\nNetworkName=line\nCANopenManager="
         "0\n";
}

class EdsCommand : public ::testing::Test {
 protected:
  [[nodiscard]] Outcome eds(Words words) const {
    words.insert(words.begin(), "eds");
    return berth(words);
  }
  [[nodiscard]] Json json(Words words, int status) const {
    words.emplace_back("--json");
    const Outcome outcome = eds(std::move(words));
    EXPECT_EQ(outcome.status, status) << outcome.out << outcome.err;
    EXPECT_TRUE(outcome.err.empty()) << "with --json everything is in the object: " << outcome.err;
    return Json::parse(outcome.out, nullptr, false);
  }

  Folder folder;
  std::string sensor = folder.write("sensor.eds", sound_eds);
};

// ---- check ----

TEST_F(EdsCommand, CheckOfASoundFileSaysSo) {
  const Outcome outcome = eds({"check", sensor});
  EXPECT_EQ(outcome.status, 0);
  EXPECT_EQ(
      outcome.out,
      sensor + ": EDS of Sensor (vendor 00000001h, product 00000007h), 5 objects: 0 errors, 0 warnings, 0 notes\n");
  EXPECT_TRUE(outcome.err.empty());
}

TEST_F(EdsCommand, CheckNamesPlaceReasonAndFix) {
  const std::string text =
      changed(changed(sound_eds, "DefaultValue=3", "DefaultValue=4"), "ParameterName=Error register\n", "");
  const std::string file = folder.write("odd.eds", text);
  const Outcome outcome = eds({"check", file});
  EXPECT_EQ(outcome.status, 0) << "warnings only";
  const auto line =
      1 + std::count(text.begin(),
                     text.begin() + static_cast<std::ptrdiff_t>(text.find("DefaultValue=4\n\n[1018sub4]")), '\n');
  EXPECT_TRUE(contains(outcome.out, file + ":" + std::to_string(line) +
                                        ":14: warning: [1018sub3] DefaultValue: the revision number is 00000004h here "
                                        "and 00000003h in RevisionNumber"))
      << outcome.out;
  EXPECT_TRUE(contains(outcome.out, "[1001]: ParameterName is missing")) << outcome.out;
  EXPECT_TRUE(contains(outcome.out, "0 errors, 2 warnings")) << outcome.out;
  EXPECT_EQ(eds({"check", "--strict", file}).status, 1);
}

TEST_F(EdsCommand, CheckOfABrokenFileFails) {
  const std::string file =
      folder.write("bad.eds", changed(sound_eds, "DefaultValue=$NODEID+0x10", "ParameterValue=ten"));
  const Json report = json({"check", sensor, file}, 1);
  EXPECT_EQ(report.at("errors"), 1);
  EXPECT_EQ(report.at("files").at(0).at("errors"), 0);
  const Json& finding = report.at("files").at(1).at("findings").at(0);
  EXPECT_EQ(finding.at("severity"), "error");
  EXPECT_EQ(finding.at("key"), "[2000] ParameterValue");
  EXPECT_GT(finding.at("line"), 90);
}

TEST_F(EdsCommand, CheckOfWhatIsNoDescription) {
  for (const std::string& file : {folder.write("a.txt", "hello"), folder.write("b.xdd", "<html></html>"),
                                  std::string("/no such file"), std::string("/tmp")}) {
    const Outcome outcome = eds({"check", file, sensor});
    EXPECT_EQ(outcome.status, 2) << outcome.out;
    EXPECT_TRUE(contains(outcome.out, file)) << outcome.out;
    EXPECT_TRUE(contains(outcome.out, "Sensor")) << "the other file is checked all the same";
  }
  EXPECT_EQ(eds({"check"}).status, 2);
  EXPECT_EQ(json({"check", "/no such file"}, 2).at("files").at(0).at("readable"), false);
}

TEST_F(EdsCommand, CheckOfAProjectChecksItsNodes) {
  folder.write("left.dcf", sound_dcf());
  folder.write("right.dcf", changed(sound_dcf(), "ParameterValue=500", "ParameterValue=many"));
  const std::string project =
      folder.write("line.cpj",
                   "[Topology]\nNetName=line\nNodes=0x03\nNode9Present=0x01\nNode9Name=left\nNode9DCFName=left.dcf\n"
                   "Node10Present=0x01\nNode10DCFName=right.dcf\nNode11Present=0x01\nNode11DCFName=../../etc/passwd\n");
  const Json report = json({"check", project}, 1);
  ASSERT_EQ(report.at("files").size(), 3U) << report;
  EXPECT_EQ(report.at("files").at(0).at("format"), "CPJ");
  EXPECT_EQ(report.at("files").at(0).at("nodes"), 3);
  EXPECT_TRUE(contains(report.at("files").at(0).at("findings").dump(), "node 11")) << report.at("files").at(0);
  EXPECT_EQ(report.at("files").at(1).at("errors"), 0);
  EXPECT_EQ(report.at("files").at(2).at("errors"), 1);
  EXPECT_EQ(eds({"check", folder.write("no.cpj", "hello")}).status, 2);
}

// berth eds check reads every real file there is.
TEST_F(EdsCommand, CheckReadsAllRealFiles) {
  namespace fs = std::filesystem;
  const fs::path place = berth::test::eds_folder();
  if (!fs::is_directory(place)) GTEST_SKIP() << "no folder of real device descriptions; set BERTH_EDS_DIR";
  Words words{"check"};
  for (const auto& entry : fs::directory_iterator(place)) {
    if (entry.path().extension() != ".md") words.push_back(entry.path().string());
  }
  const Json report = json(words, 0);
  ASSERT_EQ(report.at("files").size(), words.size() - 1);
  for (const Json& file : report.at("files")) {
    EXPECT_EQ(file.at("readable"), true) << file.at("file");
    EXPECT_EQ(file.at("errors"), 0) << file;
    EXPECT_GE(file.at("objects"), 20) << file.at("file");
  }
}

// ---- convert ----

TEST_F(EdsCommand, ConvertThereAndBackIsTheSame) {
  const std::string xdd = folder.file("sensor.xdd");
  const std::string back = folder.file("back.eds");
  const Outcome there = eds({"convert", sensor, xdd});
  EXPECT_EQ(there.status, 0) << there.err;
  EXPECT_TRUE(contains(there.out, "comment lines of the file are left out")) << there.out;
  EXPECT_TRUE(contains(there.out, xdd + ": XDD, ")) << there.out;
  EXPECT_TRUE(contains(contents(xdd), "name=\"Limit &lt;mm"));
  EXPECT_EQ(eds({"convert", xdd, back}).status, 0);
  EXPECT_EQ(eds({"diff", sensor, xdd}).status, 0);
  const Outcome same = eds({"diff", sensor, back});
  EXPECT_EQ(same.status, 0) << same.out;
  EXPECT_EQ(eds({"check", "--strict", xdd, back}).status, 0);
}

TEST_F(EdsCommand, ConvertDcfToConciseAndBack) {
  const std::string dcf = folder.write("left.dcf", sound_dcf());
  const std::string concise = folder.file("left.cdcf");
  ASSERT_EQ(eds({"convert", dcf, concise}).status, 0);
  // CiA 302-3: number of entries; index, sub-index, size, data.
  EXPECT_EQ(contents(concise), std::string("\x02\0\0\0"
                                           "\x17\x10\0\x02\0\0\0\xF4\x01"
                                           "\0\x20\0\x02\0\0\0\x20\0",
                                           22));
  const std::string back = folder.file("back.dcf");
  EXPECT_EQ(eds({"convert", concise, back}).status, 2) << "a concise DCF has no types";
  const Outcome converted = eds({"convert", concise, back, "--eds", sensor, "--node", "9"});
  ASSERT_EQ(converted.status, 0) << converted.err;
  EXPECT_TRUE(contents(back).starts_with("; written by hand")) << "made from the EDS, whose comments stay";
  const Outcome diff = eds({"diff", dcf, back});
  for (const char* value : {"1017h", "2000h"}) EXPECT_FALSE(contains(diff.out, value)) << diff.out;
  const std::string xdc = folder.file("left.xdc");
  EXPECT_EQ(eds({"convert", dcf, xdc}).status, 0);
  EXPECT_EQ(eds({"diff", dcf, xdc}).status, 0) << eds({"diff", dcf, xdc}).out;
  EXPECT_EQ(eds({"convert", xdc, concise, "--to", "cdcf", "--force"}).status, 0);
  EXPECT_EQ(contents(concise).size(), 22U);
}

TEST_F(EdsCommand, ConvertSaysWhatTheFormatCannotHold) {
  const std::string dcf = folder.write("left.dcf", sound_dcf());
  const Json report = json({"convert", dcf, folder.file("left.xdd")}, 0);
  EXPECT_EQ(report.at("format"), "XDD");
  EXPECT_TRUE(contains(report.at("findings").dump(), "2 values")) << report;
  EXPECT_TRUE(contains(report.at("findings").dump(), "[DeviceComissioning]")) << report;
}

// Named with the file that was read, as its line is that one's.
TEST_F(EdsCommand, ConvertSaysAtItsLineWhatWasDropped) {
  const std::string record =
      "\n[2100]\nParameterName=R\nObjectType=9\nDataType=0x23\nDefaultValue=7\nSubNumber=1\n[2100sub1]\n"
      "ParameterName=s\nObjectType=7\nDataType=6\nAccessType=rw\n";
  const std::string text = std::string(sound_eds) + record;
  const std::string from = folder.write("record.eds", text);
  const auto line_of = [&](const std::string& what) {
    return std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(text.find(what)), '\n') + 1;
  };
  const std::string value_at = fmt::format("{}:{}:", from, line_of("DefaultValue=7\nSubNumber"));
  const std::string type_at = fmt::format("{}:{}:", from, line_of("DataType=0x23"));
  for (const char* const form : {"dcf", "xdd", "xdc"}) {
    const Outcome converted = eds({"convert", from, folder.file(std::string("record.") + form)});
    EXPECT_EQ(converted.status, 0) << converted.err;
    EXPECT_TRUE(contains(converted.out, value_at)) << converted.out;
    EXPECT_TRUE(contains(converted.out, "no value of its own")) << converted.out;
    EXPECT_EQ(contains(converted.out, type_at), std::string(form) == "dcf") << converted.out;
  }
}

TEST_F(EdsCommand, ConvertRefusesInWords) {
  struct Case {
    Words words;
    int status;
    const char* says;
  };
  const std::string bad =
      folder.write("bad.eds", changed(sound_eds, "DefaultValue=$NODEID+0x10", "ParameterValue=ten"));
  const std::string broken = folder.write("broken.cdcf", "\x05");
  for (const Case& each :
       {Case{{sensor, folder.file("x.pdf")}, 2, "does not say the format"},
        Case{{sensor, folder.file("x"), "--to", "pdf"}, 2, "is not a format"},
        Case{{sensor, sensor}, 2, "name another"}, Case{{bad, folder.file("x.xdd")}, 2, "[2000] ParameterValue"},
        Case{{sensor, folder.file("x.cdcf")}, 1, "sets no value"},
        Case{{sensor, "/no such folder/x.xdd"}, 3, "No such file or directory"},
        Case{{broken, folder.file("x.dcf"), "--eds", sensor, "--node", "5"}, 2, "at byte"},
        Case{{broken, folder.file("x.eds"), "--eds", sensor}, 2, "is a configuration"},
        Case{{sensor}, 2, "see berth eds convert --help"}}) {
    Words words = each.words;
    words.insert(words.begin(), "convert");
    const Outcome outcome = eds(words);
    EXPECT_EQ(outcome.status, each.status) << each.says << outcome.out << outcome.err;
    EXPECT_TRUE(contains(outcome.err, each.says)) << outcome.err;
  }
  EXPECT_FALSE(exists(folder.file("x.xdd")));
  EXPECT_EQ(contents(sensor), sound_eds);
}

TEST_F(EdsCommand, ConvertNeedsANodeIdOnlyForFormulas) {
  const std::string fixed = changed(sound_eds, "HighLimit=900", "HighLimit=900\nParameterValue=0x20");
  EXPECT_EQ(eds({"convert", folder.write("fixed.dcf", fixed), folder.file("fixed.cdcf")}).status, 0);
  const std::string formula =
      folder.write("formula.dcf", changed(sound_eds, "HighLimit=900", "HighLimit=900\nParameterValue=$NODEID+0x20"));
  const Outcome outcome = eds({"convert", formula, folder.file("formula.cdcf")});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_TRUE(contains(outcome.err, "2000h:00")) << outcome.err;
  EXPECT_TRUE(contains(outcome.err, "give --node N")) << outcome.err;
  EXPECT_EQ(eds({"convert", formula, folder.file("formula.cdcf"), "--node", "5"}).status, 0);
  // 1 entry: 2000h:00, 2 bytes, 5 + 20h.
  EXPECT_EQ(contents(folder.file("formula.cdcf")), std::string("\x01\0\0\0\0\x20\0\x02\0\0\0\x25\0", 13));
}

TEST_F(EdsCommand, ConvertToStandardOutput) {
  const Outcome outcome = eds({"convert", sensor, "-", "--to", "xdd"});
  EXPECT_EQ(outcome.status, 0);
  EXPECT_TRUE(outcome.out.starts_with("<?xml"));
  EXPECT_TRUE(outcome.out.ends_with("</ISO15745ProfileContainer>\n"));
}

// ---- diff ----

TEST_F(EdsCommand, DiffNamesEachDifference) {
  const std::string other = folder.write("other.eds", changed(changed(sound_eds, "HighLimit=900", "HighLimit=1000"),
                                                              "ProductNumber=7", "ProductNumber=8"));
  const Outcome outcome = eds({"diff", sensor, other});
  EXPECT_EQ(outcome.status, 1);
  EXPECT_EQ(outcome.out, "ProductNumber             0x00000007 | 0x00000008\n2000h:00  high limit      900 | 1000\n" +
                             sensor + " (first) and " + other + " (second): 2 differences\n");
  const Json report = json({"diff", sensor, other}, 1);
  EXPECT_EQ(report.at("same"), false);
  EXPECT_EQ(report.at("differences").at(1).at("what"), "high limit");
  EXPECT_EQ(report.at("differences").at(1).at("index"), "0x2000");
  EXPECT_EQ(eds({"diff", sensor}).status, 2);
  EXPECT_EQ(eds({"diff", sensor, "/no such file"}).status, 2);
  EXPECT_EQ(eds({"diff", sensor, other, "--node", "5", "--machine", other}).status, 2);
}

TEST_F(EdsCommand, DiffWithALiveDevice) {
  const std::string plant = changed(small_plant, "type = { vendor = 1, product = 7, revision = 3 }\nserial = 0x30",
                                    "eds = \"device.xdd\"\nserial = 0x30");
  const std::string device =
      folder.write("device.eds", changed(sound_eds, "DefaultValue=$NODEID+0x10", "DefaultValue=25"));
  // A plant's devices are described in any form.
  ASSERT_EQ(eds({"convert", device, folder.file("device.xdd")}).status, 0);
  const Words world{"--node",    "9",
                    "--machine", folder.write("machine.toml", small_machine),
                    "--sim",     folder.write("plant.toml", plant),
                    "--up"};
  const auto live = [&](const std::string& text) {
    Words words{"diff", folder.write("claimed.eds", text)};
    words.insert(words.end(), world.begin(), world.end());
    return words;
  };
  const Json same = json(live(sound_eds), 0);
  EXPECT_EQ(same.at("same"), true) << same;
  std::string wrong =
      changed(sound_eds, "[1018sub2]\nParameterName=Product code\nDataType=7\nAccessType=ro\nDefaultValue=7",
              "[1018sub2]\nParameterName=Product code\nDataType=7\nAccessType=ro\nDefaultValue=8");
  wrong = changed(wrong, "ObjectType=7\nDataType=6\nAccessType=rw\nDefaultValue=$NODEID+0x10",
                  "ObjectType=7\nDataType=7\nAccessType=rw\nDefaultValue=$NODEID+0x10");
  wrong +=
      "[2001]\nParameterName=More\nObjectType=7\nDataType=5\nAccessType=rw\n[1018sub5]\nParameterName=Fifth\nDataType="
      "7\nAccessType=ro\n";
  const Outcome outcome = eds(live(wrong));
  EXPECT_EQ(outcome.status, 1) << outcome.err;
  EXPECT_TRUE(contains(outcome.out, "1018h:02  identity        0x00000008 | 0x00000007")) << outcome.out;
  EXPECT_TRUE(contains(outcome.out, "1018h:05  only in first   Fifth")) << outcome.out;
  EXPECT_TRUE(contains(outcome.out, "2000h:00  data type       UNSIGNED32 | a value of 2 bytes")) << outcome.out;
  EXPECT_TRUE(contains(outcome.out, "2001h     only in first   More")) << outcome.out;
  EXPECT_TRUE(contains(outcome.out, "4 differences")) << outcome.out;
  // Values of a configuration, when asked for: 0x20 is set, the device has 25.
  Words values =
      live(changed(sound_eds, "DefaultValue=$NODEID+0x10", "DefaultValue=$NODEID+0x10\nParameterValue=0x20"));
  values.emplace_back("--values");
  const Json report = json(values, 1);
  EXPECT_EQ(report.at("differences").size(), 1U) << report;
  EXPECT_EQ(report.at("differences").at(0).at("second"), "25");
}

TEST_F(EdsCommand, DiffWithADeviceThatIsNotThere) {
  const Outcome outcome = eds({"diff", sensor, "--node", "77", "--machine", folder.write("machine.toml", small_machine),
                               "--sim", folder.write("plant.toml", small_plant), "--up"});
  EXPECT_EQ(outcome.status, 1) << outcome.out;
  EXPECT_TRUE(contains(outcome.err, "node 77")) << outcome.err;
  EXPECT_TRUE(contains(outcome.err, "berth scan")) << outcome.err;
  EXPECT_EQ(eds({"diff", sensor, "--node", "5"}).status, 2);
  EXPECT_EQ(eds({"diff", sensor, "--node", "200", "--machine", "m"}).status, 2);
}

// ---- show ----

TEST_F(EdsCommand, ShowPrintsTheDictionary) {
  const Outcome all = eds({"show", sensor});
  EXPECT_EQ(all.status, 0);
  EXPECT_TRUE(contains(all.out, "EDS of Sensor (vendor 00000001h, product 00000007h), 5 objects\n"));
  EXPECT_TRUE(contains(all.out, "1018h     Identity                             RECORD\n")) << all.out;
  EXPECT_TRUE(
      contains(all.out, "  :01       Vendor-ID                          UNSIGNED32     ro     no  0x00000001\n"))
      << all.out;
  EXPECT_TRUE(
      contains(all.out, "2000h     Limit <mm>                           UNSIGNED16     rw     no  $NODEID+0x10\n"))
      << all.out;
  const Outcome one = eds({"show", sensor, "0x2000"});
  EXPECT_EQ(one.out,
            "2000h  Limit <mm>\n  object type   VAR\n  2000h:00  Limit <mm>\n    type        UNSIGNED16\n    access    "
            "  rw\n    PDO mapping no\n    default     $NODEID+0x10\n    low limit   1\n    high limit  900\n");
  for (const char* word : {"1018h/2", "0x1018:0x02", "1018h:02", "1018sub2", "Identity/Product code"})
    EXPECT_TRUE(contains(eds({"show", sensor, word}).out, "1018h:02  Product code")) << word;
  EXPECT_TRUE(contains(eds({"show", sensor, "HEARTBEAT"}).out, "1017h  Producer heartbeat time"));
  EXPECT_EQ(eds({"show", sensor, "3000h"}).status, 1);
  EXPECT_EQ(eds({"show", sensor, "1018h:9"}).status, 1);
  const Outcome bare = eds({"show", sensor, "1018:2"});
  EXPECT_EQ(bare.status, 2);
  EXPECT_TRUE(contains(bare.err, "1018h:02") && contains(bare.err, "03FAh:02")) << bare.err;
  EXPECT_EQ(eds({"show", "/no such file"}).status, 2);
  const Json report = json({"show", folder.write("left.dcf", sound_dcf()), "2000h"}, 0);
  EXPECT_EQ(report.at("format"), "DCF");
  const Json& value = report.at("objects").at(0).at("subs").at(0);
  EXPECT_EQ(value.at("default"), "$NODEID+0x10");
  EXPECT_EQ(value.at("value"), "32");
  EXPECT_EQ(value.at("low"), "1");
}

TEST_F(EdsCommand, HelpHasExamples) {
  for (const char* verb : {"check", "convert", "diff", "show"}) {
    const Outcome outcome = eds({verb, "--help"});
    EXPECT_EQ(outcome.status, 0);
    EXPECT_TRUE(contains(outcome.out, "Examples:")) << outcome.out;
    EXPECT_TRUE(contains(outcome.out, std::string("berth eds ") + verb)) << outcome.out;
  }
}

}  // namespace
}  // namespace berth::test::eds_command_tests
