// What has no place in a description is said at its line, once; where it is many, they are counted.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <string>

#include "berth/eds/write.hpp"
#include "xdd_support.hpp"

namespace berth::eds::test {
namespace {

std::string record(unsigned index, const std::string& lines, const std::string& code = "9") {
  const std::string name = fmt::format("{:04X}", index);
  return "[" + name + "]\nParameterName=Record\nObjectType=" + code + "\n" + lines + "SubNumber=2\n[" + name +
         "sub0]\nParameterName=n\nObjectType=7\nDataType=5\nAccessType=const\nDefaultValue=1\n[" + name +
         "sub1]\nParameterName=first\nObjectType=7\nDataType=6\nAccessType=rw\nDefaultValue=3\n";
}

Findings about(const Findings& all, std::string_view what) {
  Findings found;
  for (const auto& each : all) {
    if (each.message.find(what) != std::string::npos) found.push_back(each);
  }
  return found;
}

}  // namespace

TEST(LeftOut, AValueAtAnObjectWithSubObjectsIsSaidAtItsLine) {
  for (const bool array : {false, true}) {
    for (const char* const key : {"DefaultValue", "ParameterValue"}) {
      const std::string text = file_with(record(0x2000, std::string(key) + "=7\n", array ? "8" : "9"));
      const Reading reading = read_text(text);
      const Findings told = about(reading.findings, "own: left out");
      ASSERT_EQ(told.size(), 1U) << all_findings(reading.findings);
      EXPECT_EQ(told.front().line, line_of(text, std::string(key) + "=7"));
      EXPECT_EQ(told.front().key, std::string("[2000] ") + key);
      EXPECT_NE(told.front().message.find(array ? "an ARRAY" : "a RECORD"), std::string::npos) << told.front().message;
      EXPECT_EQ(value(reading, 0x2000, 1), 3U) << "the sub-object keeps its own";
      EXPECT_TRUE(reading.file.parameters.empty());
    }
  }
}

TEST(LeftOut, AnEmptyValueAndOneForCompactSubObjAreNone) {
  const std::string compact =
      "[2000]\nParameterName=Words\nObjectType=8\nDataType=6\nAccessType=rw\nDefaultValue=7\nCompactSubObj=3\n";
  for (const std::string& object : {record(0x2000, "DefaultValue=\n"), compact}) {
    const Reading reading = read_text(file_with(object));
    EXPECT_EQ(about(reading.findings, "own: left out").size(), 0U) << all_findings(reading.findings);
  }
}

TEST(LeftOut, ManyAreCounted) {
  std::string objects;
  std::vector<std::string> listed;
  for (unsigned index = 0x2000; index < 0x2014; ++index) {
    objects += record(index, "DefaultValue=7\n");
    listed.push_back(fmt::format("0x{:04X}", index));
  }
  const Reading reading = read_text(file_with(objects, listed));
  const Findings told = about(reading.findings, "own: left out");
  ASSERT_EQ(told.size(), 6U) << all_findings(reading.findings);
  EXPECT_EQ(about(told, "15 more").size(), 1U) << all_findings(told);

  std::string elements;
  for (unsigned index = 0x2000; index < 0x2014; ++index) {
    elements += fmt::format(
        "<CANopenObject index=\"{:04X}\" name=\"r\" objectType=\"9\" subNumber=\"1\" defaultValue=\"7\">"
        "<CANopenSubObject subIndex=\"01\" name=\"s\" objectType=\"7\" dataType=\"0006\" accessType=\"rw\"/>"
        "</CANopenObject>\n",
        index);
  }
  const Reading xdd = read_objects(elements);
  const Findings of_xdd = about(xdd.findings, "own: left out");
  ASSERT_EQ(of_xdd.size(), 6U) << all_findings(xdd.findings);
  EXPECT_EQ(about(of_xdd, "15 more").size(), 1U) << all_findings(of_xdd);
}

TEST(LeftOut, AValueAtAnXddsRecordIsSaidAtItsLine) {
  for (const std::string name : {"defaultValue", "actualValue"}) {
    const XddParts parts{.objects = "<CANopenObject index=\"2000\" name=\"r\" objectType=\"9\" subNumber=\"1\" " +
                                    name + "=\"7\">" +
                                    "<CANopenSubObject subIndex=\"01\" name=\"s\" objectType=\"7\" dataType=\"0006\" "
                                    "accessType=\"rw\" defaultValue=\"3\"/></CANopenObject>"};
    const Reading reading = read_parts(parts);
    const Findings told = about(reading.findings, "own: left out");
    ASSERT_EQ(told.size(), 1U) << all_findings(reading.findings);
    EXPECT_EQ(told.front().line, line_of(xdd_text(parts), "index=\"2000\""));
    EXPECT_EQ(value(reading, 0x2000, 1), 3U);
  }
}

// An EDS that is written anew has it for CompactSubObj only; an XDD has a place for it.
TEST(LeftOut, TheDataTypeOfARecordIsSaidAtItsLineWhereItIsLost) {
  const std::string text = file_with(record(0x2000, "DataType=0x0023\n"));
  const Reading reading = read_text(text);
  for (const Form form : {Form::eds, Form::dcf}) {
    const Written written = write(reading.file, {.form = form});
    const Findings told = about(written.findings, "DataType");
    ASSERT_EQ(told.size(), 1U) << all_findings(written.findings);
    EXPECT_EQ(told.front().line, line_of(text, "DataType=0x0023"));
    EXPECT_EQ(told.front().key, "[2000] DataType");
    EXPECT_EQ(told.front().severity, Severity::note);
  }
  const Written xdd = write_xdd(reading.file);
  EXPECT_EQ(about(xdd.findings, "DataType").size(), 0U) << all_findings(xdd.findings);
  EXPECT_NE(xdd.text.find("dataType=\"0023\""), std::string::npos);
}

TEST(LeftOut, ManyDataTypesAreCountedAndOneOfAnArrayIsItsElements) {
  std::string objects;
  std::vector<std::string> listed;
  for (unsigned index = 0x2000; index < 0x2014; ++index) {
    objects += record(index, "DataType=0x0023\n");
    listed.push_back(fmt::format("0x{:04X}", index));
  }
  const Written written = write(read_text(file_with(objects, listed)).file);
  EXPECT_EQ(written.findings.size(), 6U) << all_findings(written.findings);
  EXPECT_EQ(about(written.findings, "15 more").size(), 1U) << all_findings(written.findings);
  const Written array = write(read_text(file_with(record(0x2000, "DataType=6\n", "8"))).file);
  EXPECT_EQ(array.findings.size(), 0U) << all_findings(array.findings);
}

// None is another thing than number 0.
TEST(LeftOut, AnXdcWithoutANetNumberStaysWithout) {
  File file = read_text(file_with(record(0x2000, {}))).file;
  file.commissioning = Commissioning{.node_id = NodeId(5), .node_name = "left", .baud_rate = 250};
  for (const bool numbered : {false, true}) {
    if (numbered) file.commissioning->net_number = 0;
    const std::string xdc = write_xdd(file, {.values = true}).text;
    const Reading back = read_xdd(xdc, "t.xdc");
    EXPECT_EQ(complaints(back), "");
    ASSERT_TRUE(back.file.commissioning);
    EXPECT_EQ(back.file.commissioning->net_number, file.commissioning->net_number);
    const Reading dcf = read(write(back.file, {.form = Form::dcf}).text, "t.dcf");
    ASSERT_TRUE(dcf.file.commissioning);
    EXPECT_EQ(dcf.file.commissioning->net_number, file.commissioning->net_number);
    EXPECT_EQ(write_xdd(dcf.file, {.values = true}).text.find("networkNumber") != std::string::npos, numbered);
  }
}

}  // namespace berth::eds::test
