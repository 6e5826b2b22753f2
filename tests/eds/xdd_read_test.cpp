// XDD and XDC read (CiA 311; docs/protocols/cia306.md §XDD and XDC).
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/eds/diff.hpp"
#include "xdd_support.hpp"

namespace {

using namespace berth;
using namespace berth::eds;
using namespace berth::eds::test;
using od::Access;
using od::DataType;
namespace fs = std::filesystem;

// E5.1: an object that says everything itself.
TEST(XddRead, E5_1_ObjectsWithTheirOwnAttributes) {
  const auto r = read_objects(
      R"(<CANopenObject index="2000" name="Speed &amp; more" objectType="7" dataType="0006" lowLimit="0x10" highLimit="500" accessType="rw" defaultValue="$NODEID+0x20" denotation="left speed" PDOmapping="optional" objFlags="0003"/>
<CANopenObject index="6000" name="Inputs" objectType="8" dataType="0005" subNumber="3">
<CANopenSubObject subIndex="00" name="n" objectType="7" dataType="0005" accessType="ro" defaultValue="2" PDOmapping="no"/>
<CANopenSubObject subIndex="01" name="first" objectType="7" accessType="ro" PDOmapping="TPDO"/>
<CANopenSubObject subIndex="02" name="second" objectType="7" accessType="ro" PDOmapping="default"/>
</CANopenObject>)");
  EXPECT_TRUE(r.usable());
  EXPECT_EQ(complaints(r), "");
  const auto& d = *r.file.description;
  const auto* const speed = sub(r, 0x2000);
  ASSERT_NE(speed, nullptr);
  EXPECT_EQ(d.name(*speed), "Speed & more");
  EXPECT_EQ(speed->type, DataType::unsigned16);
  EXPECT_EQ(speed->access, Access::rw);
  EXPECT_TRUE(speed->mappable);
  EXPECT_EQ(speed->obj_flags, 3);
  EXPECT_EQ(d.default_of(*speed), od::Literal::node_id_plus(0x20));
  ASSERT_NE(d.limits(*speed), nullptr);
  EXPECT_EQ(d.limits(*speed)->low, od::Literal::number(16));
  EXPECT_EQ(d.limits(*speed)->high, od::Literal::number(500));
  ASSERT_EQ(r.file.denotations.size(), 1U);
  EXPECT_EQ(r.file.denotations[0], (Denotation{{0x2000, 0}, "left speed"}));
  const auto* const inputs = d.find(0x6000);
  ASSERT_NE(inputs, nullptr);
  EXPECT_EQ(inputs->code, od::ObjectCode::array);
  EXPECT_EQ(d.name(*inputs), "Inputs");
  EXPECT_EQ(sub(r, 0x6000, 1)->type, DataType::unsigned8) << "an element without a type has the array's";
  EXPECT_TRUE(sub(r, 0x6000, 2)->mappable);
}

// E5.1: `uniqueIDRef`, where readers lose everything.
TEST(XddRead, E5_1_FactsComeFromTheParameterReferredTo) {
  const auto r = read_parts(
      {.objects = R"(<CANopenObject index="2001" name="A" objectType="7" PDOmapping="no" uniqueIDRef="P1"/>
<CANopenObject index="2002" name="B" objectType="7" PDOmapping="TPDO" uniqueIDRef="P2"/>
<CANopenObject index="2003" name="C" objectType="7" uniqueIDRef="P3"/>
<CANopenObject index="2004" name="D" objectType="7" uniqueIDRef="P4"/>
<CANopenObject index="2005" name="E" objectType="8" uniqueIDRef="P5" subNumber="2">
<CANopenSubObject subIndex="00" name="n" uniqueIDRef="P50"/><CANopenSubObject subIndex="01" name="x" accessType="wo"/></CANopenObject>)",
       .process =
           R"(<dataTypeList><derived name="d" uniqueID="D1"><UINT/></derived><array name="a" uniqueID="A1"><subrange lowerLimit="0" upperLimit="1"/><DINT/></array></dataTypeList>
<templateList><parameterTemplate uniqueID="T1" access="write"><LREAL/><defaultValue value="1.5"/></parameterTemplate><allowedValuesTemplate uniqueID="V1"><range><minValue value="3"/><maxValue value="9"/></range></allowedValuesTemplate></templateList>
<parameterList>
<parameter uniqueID="P1" access="readWrite"><label lang="en">A</label><UDINT/><denotation><label lang="en">alpha</label></denotation><actualValue value="7"/><defaultValue value="5"/><allowedValues><range><minValue value="1"/><maxValue value="0xFF"/></range></allowedValues></parameter>
<parameter uniqueID="P2" access="readWrite"><INT/><defaultValue value="-3"/></parameter>
<parameter uniqueID="P3"><dataTypeIDRef uniqueIDRef="D1"/><allowedValues templateIDRef="V1"/></parameter>
<parameter uniqueID="P4" templateIDRef="T1"/>
<parameter uniqueID="P5"><dataTypeIDRef uniqueIDRef="A1"/></parameter>
<parameter uniqueID="P50"><USINT/><defaultValue value="1"/></parameter>
</parameterList>)"});
  EXPECT_EQ(complaints(r), "");
  const auto& d = *r.file.description;
  EXPECT_EQ(sub(r, 0x2001)->type, DataType::unsigned32);
  EXPECT_EQ(sub(r, 0x2001)->access, Access::rw);
  EXPECT_EQ(d.limits(*sub(r, 0x2001))->high, od::Literal::number(255));
  ASSERT_EQ(r.file.parameters.size(), 1U);
  EXPECT_EQ(r.file.parameters[0].value, od::Literal::number(7));
  ASSERT_EQ(r.file.defaults.size(), 1U);
  EXPECT_EQ(r.file.defaults[0].value, od::Literal::number(5));
  EXPECT_EQ(value(r, 0x2001), 7U) << "the actual value wins";
  EXPECT_EQ(r.file.denotations.at(0).text, "alpha");
  EXPECT_EQ(sub(r, 0x2002)->type, DataType::integer16);
  EXPECT_EQ(sub(r, 0x2002)->access, Access::rwr) << "rw, mapped into TPDOs only";
  EXPECT_EQ(signed_value(r, 0x2002), -3);
  EXPECT_EQ(sub(r, 0x2003)->type, DataType::unsigned16) << "through a derived type";
  EXPECT_EQ(sub(r, 0x2003)->access, Access::ro) << "the schema's default of a parameter is read";
  EXPECT_EQ(d.limits(*sub(r, 0x2003))->low, od::Literal::number(3));
  EXPECT_EQ(sub(r, 0x2004)->type, DataType::real64);
  EXPECT_EQ(sub(r, 0x2004)->access, Access::wo);
  EXPECT_EQ(d.default_of(*sub(r, 0x2004)), od::Literal::real(DataType::real64, 1.5));
  EXPECT_EQ(sub(r, 0x2005, 1)->type, DataType::integer32) << "the element type of the array type";
  EXPECT_EQ(sub(r, 0x2005, 0)->type, DataType::unsigned8);
}

// What a parameter says of its object: its description in one line, the English one; else a label that is not the name.
TEST(XddRead, WhatAnObjectIsInWords) {
  const std::string long_text = std::string(998, 'x') + "°°";
  const auto r = read_parts({.objects = R"(<CANopenObject index="2001" name="A" objectType="7" uniqueIDRef="P1"/>
<CANopenObject index="2002" name="B" objectType="7" uniqueIDRef="P2"/>
<CANopenObject index="2003" name="C" objectType="7" uniqueIDRef="P3"/>
<CANopenObject index="2004" name="D" objectType="7" uniqueIDRef="P4"/>)",
                             .process =
                                 R"(<parameterList>
<parameter uniqueID="P1"><label lang="en">Bearing</label><description lang="de">Lager</description><description lang="en"> Of the
    bearing </description><INT/></parameter>
<parameter uniqueID="P2"><label lang="en">Bearing, left</label><STRING/></parameter>
<parameter uniqueID="P3"><label lang="en">C</label><INT/></parameter>
<parameter uniqueID="P4"><description lang="en">)" +
                                 long_text + R"(</description><INT/></parameter>
</parameterList>)"});
  EXPECT_TRUE(r.usable()) << all_findings(r.findings);
  const auto& d = *r.file.description;
  ASSERT_NE(d.meaning({0x2001, 0}), nullptr);
  EXPECT_EQ(d.meaning({0x2001, 0})->text, "Of the bearing");
  ASSERT_NE(d.meaning({0x2002, 0}), nullptr) << "a string has no unit, and a text all the same";
  EXPECT_EQ(d.meaning({0x2002, 0})->text, "Bearing, left");
  EXPECT_EQ(d.meaning({0x2003, 0}), nullptr) << "its name says that";
  ASSERT_NE(d.meaning({0x2004, 0}), nullptr);
  EXPECT_EQ(d.meaning({0x2004, 0})->text, std::string(998, 'x')) << "cut between characters";
}

// Units, allowed values and enumerated types of parameters; of several labels the English one.
TEST(XddRead, UnitsAndNamesOfValues) {
  const auto r = read_parts(
      {.objects = R"(<CANopenObject index="2001" name="A" objectType="7" uniqueIDRef="P1"/>
<CANopenObject index="2002" name="B" objectType="7" uniqueIDRef="P2"/>
<CANopenObject index="2003" name="C" objectType="7" uniqueIDRef="P3"/>
<CANopenObject index="2004" name="D" objectType="7" uniqueIDRef="P4"/>
<CANopenObject index="2005" name="E" objectType="7" uniqueIDRef="P5"/>
<CANopenObject index="2006" name="F" objectType="7" dataType="0005" accessType="rw"/>)",
       .process =
           R"(<dataTypeList><enum name="e" uniqueID="E1"><enumValue value="1"><label lang="de">Vor</label><label lang="en">Forward</label></enumValue><enumValue value="-1"><label lang="de">Zurück</label></enumValue><SINT/></enum></dataTypeList>
<templateList><allowedValuesTemplate uniqueID="V1"><value value="0x10"><label lang="en">Slow</label></value><value value="3"/><value value="3"><label lang="en">again</label></value></allowedValuesTemplate><parameterTemplate uniqueID="T1"><UINT/><unit multiplier="2.50E-3"><label lang="en">bar</label></unit></parameterTemplate></templateList>
<parameterList>
<parameter uniqueID="P1" access="readWrite"><INT/><unit multiplier="0.1"><label lang="en">°C</label></unit></parameter>
<parameter uniqueID="P2" access="readWrite"><dataTypeIDRef uniqueIDRef="E1"/></parameter>
<parameter uniqueID="P3" access="readWrite"><USINT/><allowedValues templateIDRef="V1"/></parameter>
<parameter uniqueID="P4" templateIDRef="T1"><allowedValues><value value="65535"><label lang="en">off</label></value><range><minValue value="0"/><maxValue value="100"/></range></allowedValues></parameter>
<parameter uniqueID="P5" multiplier="10" access="readWrite"><USINT/><unit><label lang="en">mm</label></unit></parameter>
</parameterList>)"});
  EXPECT_TRUE(r.usable()) << all_findings(r.findings);
  const auto& d = *r.file.description;
  ASSERT_NE(d.meaning({0x2001, 0}), nullptr);
  EXPECT_EQ(*d.meaning({0x2001, 0}), (od::Meaning{.unit = "°C", .number = 1, .exponent = -1}));
  ASSERT_NE(d.meaning({0x2002, 0}), nullptr);
  const std::uint64_t minus_one = od::load(DataType::integer8, std::array<std::uint8_t, 1>{0xFF}.data());
  EXPECT_EQ(*d.meaning({0x2002, 0}),
            (od::Meaning{.values = {{1, "Forward"}, {minus_one, "Zurück"}}, .only_these = true}));
  ASSERT_NE(d.meaning({0x2003, 0}), nullptr);
  EXPECT_EQ(*d.meaning({0x2003, 0}), (od::Meaning{.values = {{3, ""}, {0x10, "Slow"}}, .only_these = true}))
      << "of two names of one value the first counts";
  ASSERT_NE(d.meaning({0x2004, 0}), nullptr);
  EXPECT_EQ(*d.meaning({0x2004, 0}),
            (od::Meaning{.unit = "bar", .number = 25, .exponent = -4, .values = {{65535, "off"}}}))
      << "beside a range a list is not all";
  EXPECT_EQ(d.meaning({0x2005, 0}), nullptr) << "a unit of the scaled value is none of the bare one";
  EXPECT_EQ(d.meaning({0x2006, 0}), nullptr);
  EXPECT_EQ(d.meaning({0x2FFF, 0}), nullptr);
  EXPECT_GT(d.memory(), read_objects("").file.description->memory());
}

TEST(XddRead, UnitsThatCannotBeRead) {
  for (const char* multiplier : {"x", "0", "-1", "1e", "1e99", "1.2.3", "12345678901", "1e99999999999", "."}) {
    const auto r =
        read_parts({.objects = R"(<CANopenObject index="2001" name="A" objectType="7" uniqueIDRef="P1"/>)",
                    .process = std::string(R"(<parameterList><parameter uniqueID="P1"><INT/><unit multiplier=")") +
                               multiplier + R"("><label lang="en">V</label></unit></parameter></parameterList>)"});
    EXPECT_TRUE(r.usable()) << multiplier;
    EXPECT_TRUE(warned(r, "2001 multiplier")) << multiplier << ": " << all_findings(r.findings);
    EXPECT_EQ(r.file.description->meaning({0x2001, 0}), nullptr) << multiplier;
  }
}

TEST(XddRead, ReferencesInACircleEnd) {
  const auto r = read_parts(
      {.objects = R"(<CANopenObject index="2001" name="A" objectType="7" accessType="rw" uniqueIDRef="P"/>)",
       .process =
           R"(<dataTypeList><derived uniqueID="D1"><dataTypeIDRef uniqueIDRef="D2"/></derived><derived uniqueID="D2"><dataTypeIDRef uniqueIDRef="D1"/></derived></dataTypeList>
<parameterList><parameter uniqueID="P" templateIDRef="P"><dataTypeIDRef uniqueIDRef="D1"/></parameter></parameterList>)"});
  EXPECT_TRUE(r.usable());
  EXPECT_TRUE(warned(r, "2001")) << all_findings(r.findings);
  EXPECT_EQ(sub(r, 0x2001)->type, DataType::unsigned32);
}

TEST(XddRead, EveryIecTypeHasItsCanOpenType) {
  const std::vector<std::pair<const char*, DataType>> types{
      {"BOOL", DataType::boolean},          {"BYTE", DataType::unsigned8},   {"WORD", DataType::unsigned16},
      {"DWORD", DataType::unsigned32},      {"LWORD", DataType::unsigned64}, {"SINT", DataType::integer8},
      {"INT", DataType::integer16},         {"DINT", DataType::integer32},   {"LINT", DataType::integer64},
      {"USINT", DataType::unsigned8},       {"UINT", DataType::unsigned16},  {"UDINT", DataType::unsigned32},
      {"ULINT", DataType::unsigned64},      {"REAL", DataType::real32},      {"LREAL", DataType::real64},
      {"STRING", DataType::visible_string}, {"CHAR", DataType::unsigned8},   {"WSTRING", DataType::unicode_string},
      {"BITSTRING", DataType::octet_string}};
  for (const auto& [word, type] : types) {
    const auto r = read_parts({.objects = R"(<CANopenObject index="2001" name="A" objectType="7" uniqueIDRef="P"/>)",
                               .process = std::string("<parameterList><parameter uniqueID=\"P\"><") + word +
                                          "/></parameter></parameterList>"});
    EXPECT_EQ(complaints(r), "") << word;
    EXPECT_EQ(sub(r, 0x2001)->type, type) << word;
  }
}

TEST(XddRead, AccessAndMappingTogetherGiveTheAccessOfAnEds) {
  struct Case {
    const char* access;
    const char* mapping;
    Access expected;
    bool mappable;
    bool odd;
  };
  for (const Case& each :
       {Case{"rw", "TPDO", Access::rwr, true, false}, Case{"rw", "RPDO", Access::rww, true, false},
        Case{"rw", "optional", Access::rw, true, false}, Case{"rw", "no", Access::rw, false, false},
        Case{"ro", "TPDO", Access::ro, true, false}, Case{"ro", "RPDO", Access::ro, true, true},
        Case{"wo", "RPDO", Access::wo, true, false}, Case{"wo", "TPDO", Access::wo, true, true},
        Case{"const", "no", Access::constant, false, false}, Case{"rww", "no", Access::rww, false, false},
        Case{"rwr", "RPDO", Access::rwr, true, true}, Case{"rw", "perhaps", Access::rw, true, true}}) {
    SCOPED_TRACE(std::string(each.access) + " " + each.mapping);
    const auto r = read_objects(
        std::string(R"(<CANopenObject index="2001" name="A" objectType="7" dataType="0005" accessType=")") +
        each.access + "\" PDOmapping=\"" + each.mapping + "\"/>");
    EXPECT_EQ(sub(r, 0x2001)->access, each.expected);
    EXPECT_EQ(sub(r, 0x2001)->mappable, each.mappable);
    EXPECT_EQ(warned(r, "2001 PDOmapping"), each.odd) << all_findings(r.findings);
  }
  const auto input = read_parts(
      {.objects = R"(<CANopenObject index="2001" name="A" objectType="7" PDOmapping="no" uniqueIDRef="P"/>)",
       .process =
           R"(<parameterList><parameter uniqueID="P" access="readWriteInput"><UINT/></parameter></parameterList>)"});
  EXPECT_EQ(sub(input, 0x2001)->access, Access::rwr);
  EXPECT_FALSE(sub(input, 0x2001)->mappable);
}

// E5.1: the file, the device, and its place in a network.
TEST(XddRead, E5_1_FileDeviceAndCommissioning) {
  const auto r = read_parts(
      {.layers =
           R"(<dummyUsage><dummy entry="Dummy0001=0"/><dummy entry="Dummy0005=1"/></dummyUsage><dynamicChannels><dynamicChannel dataType="0005" accessType="readOnly" startIndex="A000" endIndex="A003" maxNumber="16" addressOffset="00000010"/><dynamicChannel dataType="0006" accessType="readWriteOutput" startIndex="A4C0" endIndex="A4C0" maxNumber="8" addressOffset="00"/></dynamicChannels>)",
       .management =
           R"(<CANopenGeneralFeatures groupMessaging="true" dynamicChannels="2" granularity="8" nrOfRxPDO="3" nrOfTxPDO="4" bootUpSlave="true" layerSettingServiceSlave="1"/><CANopenMasterFeatures bootUpMaster="true"/><deviceCommissioning NodeID="5" nodeName="left" actualBaudRate="250 Kbps" networkNumber="3" networkName="net" CANopenManager="true"/>)",
       .rates =
           R"(<supportedBaudRate value="500 Kbps"/><supportedBaudRate value="125 Kbps"/><supportedBaudRate value="auto-baudRate"/><supportedBaudRate value="100 Kbps"/>)",
       .identity =
           "<vendorName "
           "readOnly=\"true\">Maker</vendorName><vendorID>0x147</vendorID><productName>Drive</"
           "productName><productID>3150</productID>"
           "<productText><description lang=\"en\">A drive</description></productText><orderNumber>42-A</orderNumber>",
       .attributes =
           R"(fileName="drive.xdd" fileCreator="me" fileCreationDate="2024-07-31" fileCreationTime="18:05:18.0000000+02:00" fileModifiedBy="you" fileModificationDate="2025-01-02" fileModificationTime="00:44:48" fileVersion="7" supportedLanguages="en")"});
  EXPECT_EQ(complaints(r), "");
  const auto& info = r.file.info;
  EXPECT_EQ(info.file_name, "drive.xdd");
  EXPECT_EQ(info.created_by, "me");
  EXPECT_EQ(info.creation_date, "07-31-2024");
  EXPECT_EQ(info.creation_time, "06:05PM");
  EXPECT_EQ(info.modified_by, "you");
  EXPECT_EQ(info.modification_date, "01-02-2025");
  EXPECT_EQ(info.modification_time, "12:44AM");
  EXPECT_EQ(info.file_version, "7");
  EXPECT_EQ(info.description, "A drive");
  const auto& device = r.file.device;
  EXPECT_EQ(device.vendor_name, "Maker");
  EXPECT_EQ(device.vendor_number, 0x147U);
  EXPECT_EQ(device.product_number, 3150U);
  EXPECT_EQ(device.order_code, "42-A");
  EXPECT_EQ(device.baud_rates, (std::vector<std::uint16_t>{100, 125, 500}));
  EXPECT_TRUE(device.group_messaging && device.dynamic_channels && device.boot_up_slave && device.lss &&
              device.boot_up_master);
  EXPECT_EQ(device.granularity, 8);
  EXPECT_EQ(device.rpdos, 3);
  EXPECT_EQ(device.tpdos, 4);
  ASSERT_TRUE(r.file.commissioning);
  EXPECT_EQ(r.file.commissioning->node_id, NodeId(5));
  EXPECT_EQ(r.file.commissioning->node_name, "left");
  EXPECT_EQ(r.file.commissioning->baud_rate, 250);
  EXPECT_EQ(r.file.commissioning->net_number, 3U);
  EXPECT_TRUE(r.file.commissioning->canopen_manager);
  EXPECT_FALSE(r.file.description->dummy_mappable(1));
  EXPECT_TRUE(r.file.description->dummy_mappable(5));
  ASSERT_EQ(r.file.dynamic_segments.size(), 2U);
  EXPECT_EQ(r.file.dynamic_segments[0], (DynamicSegment{DataType::unsigned8, Access::ro, 0xA000, 0xA003, 0x10}));
  EXPECT_EQ(r.file.dynamic_segments[1].access, Access::rww);
  // Both spellings of the attribute are in the field, and bit rates without a unit.
  const auto old = read_parts(
      {.management =
           R"(<deviceCommissioning nodeID="0" nodeName="" actualBaudRate="125" networkNumber="0" networkName="" CANopenManager="false"/>)"});
  ASSERT_TRUE(old.file.commissioning);
  EXPECT_FALSE(old.file.commissioning->node_id);
  EXPECT_EQ(old.file.commissioning->baud_rate, 125);
}

TEST(XddRead, FindingsHaveLineAndColumn) {
  const std::string text = xdd_text(
      {.objects =
           "<CANopenObject index=\"2001\" name=\"A\" objectType=\"7\" dataType=\"0005\" accessType=\"rw\"\n   "
           "defaultValue='300' />\n"
           "<CANopenObject index=\"2002\" name=\"B\" dataType=\"0007\" accessType=\"rw\" defaultValue=\"0xZ\"/>"});
  const auto r = read_xdd(text, "t.xdd");
  const auto* const high = find(r, Severity::warning, "2001 defaultValue");
  ASSERT_NE(high, nullptr) << all_findings(r.findings);
  EXPECT_EQ(high->line, line_of(text, "defaultValue='300'"));
  EXPECT_EQ(high->column, 18) << "of the value: 3 blanks, 12 letters, =, quote";
  const auto* const broken = find(r, Severity::warning, "2002 defaultValue");
  ASSERT_NE(broken, nullptr);
  EXPECT_EQ(broken->line, line_of(text, "0xZ"));
  EXPECT_TRUE(r.usable()) << "the rest is used";
  EXPECT_EQ(broken->file, "t.xdd");
}

TEST(XddRead, OdditiesAreWarningsAndTheRestIsRead) {
  const auto r = read_objects(R"(<CANopenObject index="2001" objectType="7" dataType="0005" accessType="both"/>
<CANopenObject index="2002" name="x" objectType="77" dataType="0x0005" accessType="rw"/>
<CANopenObject index="2003" name="x" objectType="7" accessType="rw" uniqueIDRef="nobody"/>
<CANopenObject index="2004" name="x" objectType="8" subNumber="9"><CANopenSubObject subIndex="0" name="n" dataType="05" accessType="ro"/><CANopenSubObject subIndex="00" name="n" dataType="0005" accessType="ro"/></CANopenObject>
<CANopenObject index="2005" name="x" objectType="7" dataType="0005" accessType="rw" lowLimit="9" highLimit="3" defaultValue="5"/>
<CANopenObject index="2006" name="x" objectType="7" dataType="0005" accessType="rw" lowLimit="1" highLimit="3" defaultValue="5"/>
<CANopenObject index="2007" name="x" objectType="7" dataType="0001" accessType="rw" defaultValue="true"/>
<CANopenObject index="2008" name="x" objectType="2" accessType="rw"/>
<CANopenObject index="2009" name="x" objectType="7" dataType="0007" accessType="rw" defaultValue="0x180+$NODEID"/>
<Surprise/>
<CANopenObject index="2001" name="again" objectType="7" dataType="0006" accessType="ro"/>)");
  EXPECT_TRUE(r.usable()) << all_findings(r.findings);
  for (const char* key : {"2001", "2001 accessType", "2002 objectType", "2003", "2003 uniqueIDRef", "2004 subNumber",
                          "2004:00 subIndex", "2005", "2006 defaultValue", "2009 defaultValue", "2001 index"}) {
    EXPECT_TRUE(warned(r, key)) << key << "\n" << all_findings(r.findings);
  }
  EXPECT_TRUE(noted(r, "Surprise"));
  EXPECT_EQ(sub(r, 0x2001)->type, DataType::unsigned8) << "the first one counts";
  EXPECT_EQ(r.file.description->limits(*sub(r, 0x2005)), nullptr)
      << "limits that would refuse every value are left out";
  EXPECT_EQ(value(r, 0x2007), 1U);
  EXPECT_EQ(sub(r, 0x2008)->type, DataType::domain);
  EXPECT_EQ(value(r, 0x2009), 0x185U);
}

TEST(XddRead, WhatHasSubObjectsIsARecord) {
  for (const char* code : {"0", "2", "5", "7"}) {
    const auto r =
        read_objects(std::string(R"(<CANopenObject index="2001" name="A" objectType=")") + code +
                     R"("><CANopenSubObject subIndex="00" name="n" dataType="0005" accessType="ro"/></CANopenObject>)");
    EXPECT_TRUE(warned(r, "2001 objectType")) << code;
    EXPECT_EQ(r.file.description->find(0x2001)->code, od::ObjectCode::record) << code;
    EXPECT_EQ(r.file.description->name(*r.file.description->find(0x2001)), "A");
  }
}

TEST(XddRead, WhatIsNoXddIsRefusedInWords) {
  struct Case {
    const char* text;
    const char* says;
  };
  for (const Case& each : {Case{"<a>", "no XML"}, Case{"", "no XML"}, Case{"<html/>", "html"},
                           Case{"<EtherCATInfo/>", "EtherCAT"}, Case{"<CanOpenProject_1_1/>", "project"},
                           Case{"<ISO15745ProfileContainer xmlns=\"http://www.ethernet-powerlink.org\"/>", "POWERLINK"},
                           Case{"<ISO15745ProfileContainer/>", "communication network profile"}}) {
    const auto r = read_xdd(each.text, "t.xdd");
    EXPECT_FALSE(r.usable());
    EXPECT_NE(all_findings(r.findings).find(each.says), std::string::npos) << all_findings(r.findings);
    EXPECT_NE(r.file.description, nullptr);
  }
}

// Hostile input: entities, nesting, and masses of elements.
TEST(XddRead, NothingOutsideOfTheTextIsRead) {
  std::string text = xdd_text({.identity = "<vendorName>&xxe;</vendorName>"});
  text.insert(text.find("<ISO"),
              "<!DOCTYPE x [<!ENTITY xxe SYSTEM \"file:///etc/passwd\"><!ENTITY a \"aaaaaaaaaa\">]>\n");
  const auto r = read_xdd(text, "t.xdd");
  EXPECT_TRUE(warned(r, "DOCTYPE"));
  EXPECT_EQ(r.file.device.vendor_name, "&xxe;");

  std::string deep;
  for (int i = 0; i < 200'000; ++i) deep += "<CANopenObject>";
  EXPECT_FALSE(read_xdd(deep, "t.xdd").usable());
  std::string nested = xdd_text({});
  std::string closing;
  for (int i = 0; i < 100'000; ++i) closing += "</dataTypeIDRef>";
  deep.clear();
  for (int i = 0; i < 100'000; ++i) deep += "<dataTypeIDRef>";
  EXPECT_TRUE(read_parts({.process = "<parameterList><parameter uniqueID=\"P\">" + deep + closing +
                                     "</parameter></parameterList>"})
                  .usable());

  const ReadOptions small{
      .max_bytes = 1U << 20U, .max_sub_objects = 100, .max_value_bytes = 1U << 16U, .max_findings = 10};
  std::string many;
  for (int i = 0; i < 2000; ++i) many += "<a/>";
  EXPECT_FALSE(read_xdd("<b>" + many + "</b>", "t.xdd", small).usable());
  std::string objects;
  for (int i = 0; i < 150; ++i)
    objects +=
        "<CANopenObject index=\"" + std::to_string(2000 + i) + "\" name=\"x\" dataType=\"0005\" accessType=\"rw\"/>";
  const auto r2 = read_xdd(xdd_text({.objects = objects}), "t.xdd", small);
  EXPECT_FALSE(r2.usable());
  EXPECT_LE(r2.file.description->subs().size(), 100U);
  EXPECT_FALSE(read_xdd(std::string((1U << 20U) + 1, ' '), "t.xdd", small).usable());
  objects.clear();
  for (int i = 0; i < 50; ++i) objects += "<CANopenObject index=\"2000\" dataType=\"0005\" accessType=\"zz\"/>";
  EXPECT_LE(read_xdd(xdd_text({.objects = objects}), "t.xdd", small).findings.size(), 12U);
}

TEST(XddRead, AnyReadsBothKindsByTheirContent) {
  EXPECT_TRUE(is_xml("\xEF\xBB\xBF\r\n <x"));
  EXPECT_FALSE(is_xml("; <comment>\n[FileInfo]"));
  EXPECT_FALSE(is_xml(""));
  EXPECT_TRUE(read_any(xdd_text({}), "a.eds").usable()) << "the name says nothing";
  EXPECT_TRUE(
      read_any(file_with("[2000]\nParameterName=x\nObjectType=7\nDataType=5\nAccessType=rw\n"), "a.xdd").usable());
  EXPECT_FALSE(read_any_file("/no such file.xdd").usable());
  EXPECT_FALSE(read_any_file("/").usable());
}

TEST(XddRead, Utf16IsReadWithoutPlaces) {
  const std::string text =
      xdd_text({.objects = R"(<CANopenObject index="2001" name="A" dataType="0005" accessType="zz"/>)"});
  std::string wide = "\xFF\xFE";
  for (const char c : text) wide += std::string{c, '\0'};
  wide.replace(wide.find(std::string("U\0T\0F\0-\0008\0", 10)), 10, std::string("U\0T\0F\0-\0001\0006\0", 12));
  ASSERT_TRUE(is_xml(wide));
  const auto r = read_any(wide, "t.xdd");
  EXPECT_TRUE(r.usable()) << all_findings(r.findings);
  EXPECT_NE(sub(r, 0x2001), nullptr);
  EXPECT_EQ(find(r, Severity::warning, "2001 accessType")->line, 0);
}

// The same device by the same tool in both formats: what both say is the same.
TEST(XddRead, E5_1_ARealXddSaysWhatItsEdsSays) {
  const fs::path eds = eds_folder() / "demoDevice.eds";
  const fs::path xdd = eds_folder() / "demoDevice.xdd";
  if (!fs::exists(eds) || !fs::exists(xdd)) GTEST_SKIP() << "no folder of real device descriptions; set BERTH_EDS_DIR";
  const auto from_eds = read_any_file(eds);
  const auto from_xdd = read_any_file(xdd);
  ASSERT_TRUE(from_eds.usable());
  ASSERT_TRUE(from_xdd.usable()) << all_findings(from_xdd.findings);
  EXPECT_EQ(complaints(from_xdd), "");
  EXPECT_EQ(from_xdd.file.description->objects().size(), 47U);
  EXPECT_EQ(from_xdd.file.description->subs().size(), from_eds.file.description->subs().size());
  EXPECT_TRUE(noted(from_xdd, "1280")) << "disabled in the editor, and so not in the EDS";
  std::vector<std::string> differences;
  for (const auto& each : diff(from_eds.file, from_xdd.file)) differences.push_back(to_string(each));
  // CiA 311 has no revision number of the device, and BITSTRING is all it says of a DOMAIN.
  EXPECT_EQ(differences, (std::vector<std::string>{"RevisionNumber            0x00000000 | -",
                                                   "2122h:00  data type       DOMAIN | OCTET_STRING"}));
}

std::string random_change(std::string text, std::uint64_t seed) {
  Random random(seed);
  const auto edits = 1 + random.below(6);
  for (std::uint64_t i = 0; i < edits && !text.empty(); ++i) {
    const auto at = random.below(text.size());
    const auto length = random.below(40);
    switch (random.below(3)) {
      case 0: text.erase(at, length); break;
      case 1: text.insert(at, text.substr(random.below(text.size()), length)); break;
      default: text[at] = static_cast<char>(random.next());
    }
  }
  return text;
}

RC_GTEST_PROP(XddRead, ScrambledFilesAreAnswered, (std::uint64_t seed)) {
  static const std::string text = xdd_text(
      {.objects =
           R"(<CANopenObject index="2001" name="A" objectType="8" subNumber="2" uniqueIDRef="P"><CANopenSubObject subIndex="00" name="n" dataType="0005" accessType="ro"/><CANopenSubObject subIndex="01" name="x" dataType="0009" accessType="rw" actualValue="abc" defaultValue="d"/></CANopenObject>)",
       .process =
           R"(<parameterList><parameter uniqueID="P" access="read"><UINT/><defaultValue value="1"/></parameter></parameterList>)",
       .management =
           R"(<deviceCommissioning nodeID="5" nodeName="n" actualBaudRate="250 Kbps" networkNumber="1" networkName="" CANopenManager="false"/>)"});
  const auto r = read_xdd(random_change(text, seed), "t.xdd");
  RC_ASSERT(r.file.description != nullptr);
  if (r.usable()) {
    od::Values device(r.file.description, NodeId(1));
    RC_ASSERT(!r.file.description->objects().empty());
  }
}

}  // namespace
