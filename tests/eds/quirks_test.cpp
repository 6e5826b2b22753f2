// docs/hard-cases.md §4: each row of the table and of the list below it, as its last column says. HC4_nn names the row
// of docs/checklist.txt.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "support.hpp"

namespace quirks_tests {
namespace {

using namespace berth;
using namespace berth::eds;
using namespace berth::eds::test;
using od::AbortCode;

constexpr int u8 = 5;
constexpr int u16 = 6;
constexpr int u32 = 7;
constexpr int i32 = 4;

TEST(EdsQuirks, TheBaseFileOfTheseTestsHasNoFinding) {
  const auto r = read_variable(u32, "DefaultValue=5");
  EXPECT_TRUE(r.findings.empty()) << to_string(r.findings.front());
  EXPECT_EQ(value(r, 0x2000), 5U);
}

TEST(EdsQuirks, HC4_01_OctalNumber) {
  const auto r = read_variable(u32, "DefaultValue=010");
  EXPECT_EQ(value(r, 0x2000), 8U);
  EXPECT_TRUE(warned(r, "[2000] DefaultValue"));
  EXPECT_TRUE(r.usable());
  // What C would refuse has one plain sense.
  const auto eight = read_variable(u32, "DefaultValue=08");
  EXPECT_EQ(value(eight, 0x2000), 8U);
  EXPECT_TRUE(warned(eight, "[2000] DefaultValue"));
}

TEST(EdsQuirks, HC4_02_NodeIdFirst) {
  for (const char* text : {"$NODEID+0x180", "$nodeid+0x180", "$NodeID + 0x180"}) {
    const auto r = read_variable(u32, std::string("DefaultValue=") + text);
    EXPECT_EQ(value(r, 0x2000), 0x185U) << text;
    EXPECT_EQ(complaints(r), "") << text;
    EXPECT_TRUE(sub(r, 0x2000)->relative);
  }
}

// HU.12
TEST(EdsQuirks, HC4_03_NodeIdLast) {
  const auto r = read_variable(u32, "DefaultValue=0x180+$NODEID");
  EXPECT_EQ(value(r, 0x2000), 0x185U);
  EXPECT_TRUE(warned(r, "[2000] DefaultValue"));
}

TEST(EdsQuirks, HC4_04_NodeIdUnknownKeepsTheExpression) {
  const auto r = read_variable(u32, "DefaultValue=$NODEID+0x180");
  od::Values device(r.file.description);
  EXPECT_EQ(*device.get<std::uint32_t>({0x2000, 0}), 0x180U)
      << "no foreign node's identifier before there is a node-ID";
  device.reset(NodeId(7));
  EXPECT_EQ(*device.get<std::uint32_t>({0x2000, 0}), 0x187U);
  EXPECT_EQ(r.file.description->default_of(*sub(r, 0x2000)), od::Literal::node_id_plus(0x180));
}

// As makers' files have them (issue 39: one odd value refuses no description).
TEST(EdsQuirks, OddValuesAreTakenInTheirPlainSense) {
  struct Odd {
    unsigned type;
    const char* text;
    std::uint64_t is;
  };
  for (const auto& [type, text, is] :
       {Odd{7, "0x12LL", 0x12}, Odd{0x1B, "0x1234567890ABCDEFULL", 0x1234567890ABCDEF}, Odd{7, "100u", 100},
        Odd{6, "010", 8}, Odd{6, "0098", 98}, Odd{7, "0.0", 0}, Odd{7, "12.0", 12}, Odd{1, "TRUE", 1},
        Odd{1, "false", 0}, Odd{7, "$NODEID+0x180+0x40", 0x1C5}, Odd{7, "$nodeid + 1 + 2", 8}}) {
    const auto r = read_variable(type, std::string("DefaultValue=") + text);
    EXPECT_TRUE(r.usable()) << text;
    EXPECT_EQ(value(r, 0x2000), is) << text;
    EXPECT_TRUE(warned(r, "[2000] DefaultValue")) << text;
  }
  EXPECT_EQ(signed_value(read_variable(4, "DefaultValue=-5L"), 0x2000), -5);
  EXPECT_EQ(signed_value(read_variable(4, "DefaultValue=-5.0"), 0x2000), -5);
  for (const char* const none : {"1.5", "12zz", "0xLL", "$NODEID+", "$NODEID+1+", "1e300", "TRUE", "0x1+0x"})
    EXPECT_TRUE(left_out(read_variable(7, std::string("DefaultValue=") + none), "[2000] DefaultValue")) << none;
  const auto limit = read_variable(6, "DefaultValue=1\nHighLimit=65536");
  EXPECT_TRUE(left_out(limit, "[2000] HighLimit"));
  EXPECT_EQ(value(limit, 0x2000), 1U);
  // A configuration is to write its values: none is left out.
  EXPECT_TRUE(refused(read_variable(7, "ParameterValue=zz"), "[2000] ParameterValue"));
}

TEST(EdsQuirks, HC4_05_GarbageInANumberIsALocatedFinding) {
  const auto r = read_text(file_with(variable(u32, "DefaultValue=12zz")));
  ASSERT_TRUE(left_out(r, "[2000] DefaultValue"));
  const auto* f = find(r, Severity::warning, "[2000] DefaultValue");
  const std::string text = r.file.document.text();
  const auto at = text.find("12zz");
  EXPECT_EQ(f->line, 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
  EXPECT_EQ(f->column, static_cast<int>(std::string("DefaultValue=12").size()) + 1) << "the first z";
  EXPECT_EQ(f->file, "t.eds");
  EXPECT_TRUE(left_out(read_variable(u32, "DefaultValue=0xGG"), "[2000] DefaultValue"));
  EXPECT_TRUE(refused(read_variable(u32, "ParameterValue=1 2"), "[2000] ParameterValue"));
  EXPECT_TRUE(left_out(read_variable(u32, "LowLimit=x"), "[2000] LowLimit"));
}

TEST(EdsQuirks, HC4_06_TooWideIsLeftOutMinusOneIsByWidth) {
  EXPECT_TRUE(left_out(read_variable(u32, "DefaultValue=0x1FFFFFFFF"), "[2000] DefaultValue"));
  const auto r = read_variable(u32, "DefaultValue=-1");
  EXPECT_EQ(value(r, 0x2000), 0xFFFFFFFFU);
  EXPECT_TRUE(warned(r, "[2000] DefaultValue"));
  EXPECT_TRUE(left_out(read_variable(u8, "DefaultValue=-129"), "[2000] DefaultValue"));
}

// HU.14 (R2#394)
TEST(EdsQuirks, HC4_07_LowLimit80000000OfInteger32) {
  const auto r = read_variable(i32, "LowLimit=0x80000000\nHighLimit=0x7FFFFFFF");
  EXPECT_EQ(complaints(r), "");
  od::Values device(r.file.description, NodeId(5));
  for (const std::vector<std::uint8_t>& bytes :
       {std::vector<std::uint8_t>{0, 0, 0, 0x80}, {0xFF, 0xFF, 0xFF, 0xFF}, {0, 0, 0, 0}, {0xFF, 0xFF, 0xFF, 0x7F}}) {
    EXPECT_EQ(device.write({0x2000, 0}, bytes), AbortCode::none);
  }
}

TEST(EdsQuirks, HC4_08_LowLimitWithNodeId) {
  const auto r = read_variable(u8, "LowLimit=$NODEID+1");
  od::Values device(r.file.description, NodeId(5));
  EXPECT_EQ(device.write({0x2000, 0}, std::vector<std::uint8_t>{5}), AbortCode::value_too_low);
  EXPECT_EQ(device.write({0x2000, 0}, std::vector<std::uint8_t>{6}), AbortCode::none);
  EXPECT_EQ(r.file.description->limits(*sub(r, 0x2000))->low, od::Literal::node_id_plus(1));
}

TEST(EdsQuirks, HC4_09_DuplicateKeyLastWins) {
  const auto r = read_variable(u32, "DefaultValue=1\ndefaultvalue=2");
  EXPECT_EQ(value(r, 0x2000), 2U);
  EXPECT_TRUE(warned(r, "[2000] defaultvalue"));
}

TEST(EdsQuirks, HC4_09_DuplicateKeyOfTheDeviceLastWins) {
  std::string text = file_with(variable(u32, ""));
  text.replace(text.find("VendorNumber=1"), 14, "VendorNumber=1\nvendornumber=2");
  const auto r = read_text(text);
  EXPECT_EQ(r.file.device.vendor_number, 2U);
  EXPECT_TRUE(warned(r, "[DeviceInfo] vendornumber"));
}

TEST(EdsQuirks, HC4_09_DuplicateSectionLastWins) {
  const auto r =
      read_text(file_with(variable(u32, "DefaultValue=1\nLowLimit=1") +
                          "[2000]\nParameterName=Other\nObjectType=7\nDataType=7\nAccessType=ro\nDefaultValue=2\n"));
  EXPECT_EQ(value(r, 0x2000), 2U);
  EXPECT_EQ(name(r, 0x2000), "Other");
  EXPECT_EQ(sub(r, 0x2000)->access, od::Access::ro);
  EXPECT_TRUE(warned(r, "[2000]"));
  const auto info = read_text(file_with(variable(u32, "")) + "[DeviceInfo]\nVendorNumber=9\n");
  EXPECT_EQ(info.file.device.vendor_number, 9U);
  EXPECT_TRUE(warned(info, "[DeviceInfo]"));
}

TEST(EdsQuirks, HC4_10_LowerCaseKeysAndSections) {
  std::string text = file_with(variable(u32, "DefaultValue=7\nLowLimit=1"));
  std::ranges::transform(text, text.begin(), [](char c) { return static_cast<char>(std::tolower(c)); });
  const auto r = read_text(text);
  EXPECT_EQ(complaints(r), "");
  EXPECT_EQ(value(r, 0x2000), 7U);
  EXPECT_EQ(r.file.device.vendor_number, 1U);
  std::ranges::transform(text, text.begin(), [](char c) { return static_cast<char>(std::toupper(c)); });
  const auto upper = read_text(text);
  EXPECT_EQ(complaints(upper), "") << "also 0X prefixes";
  EXPECT_EQ(value(upper, 0x2000), 7U);
}

TEST(EdsQuirks, HC4_10_Utf8ByteOrderMark) {
  const auto r = read_text("\xEF\xBB\xBF" + file_with(variable(u32, "DefaultValue=7")));
  EXPECT_TRUE(r.findings.empty()) << to_string(r.findings.front());
  EXPECT_EQ(value(r, 0x2000), 7U);
  EXPECT_EQ(r.file.info.file_name, "t.eds");
  EXPECT_TRUE(refused(read_text(std::string("\xFF\xFE[\0", 4)), ""));
}

// HU.10
TEST(EdsQuirks, HC4_11_Windows1252) {
  const auto r = read_variable(9,
                               "DefaultValue=50 \x80\nParameterName=Temp \xB0"
                               "C \x93x\x94");
  EXPECT_TRUE(r.usable());
  EXPECT_TRUE(noted(r, ""));
  EXPECT_EQ(name(r, 0x2000),
            "Temp \xC2\xB0"
            "C \xE2\x80\x9Cx\xE2\x80\x9D");
  od::Values device(r.file.description);
  EXPECT_EQ(device.get_text({0x2000, 0}), "50 \x80") << "a value's bytes are the device's: kept";
}

TEST(EdsQuirks, HC4_12_LineEndsCommentsAndBlanks) {
  const std::string unix = file_with(variable(u32, "DefaultValue=7"));
  const auto with = [&](std::string_view end) {
    std::string text;
    for (const char c : unix) text += c == '\n' ? std::string(end) : std::string(1, c);
    return text;
  };
  const auto crlf = read_text(with("\r\n"));
  EXPECT_TRUE(crlf.findings.empty()) << to_string(crlf.findings.front());
  EXPECT_EQ(value(crlf, 0x2000), 7U);
  const auto cr = read_text(with("\r"));
  EXPECT_EQ(complaints(cr), "");
  EXPECT_EQ(value(cr, 0x2000), 7U);
  EXPECT_EQ(cr.file.description->objects().size(), 4U);
  EXPECT_FALSE(cr.findings.empty()) << "lone CR is noted";
  const auto blanks = read_variable(u32, "# a comment\n; another\n  DefaultValue \t=  7  \t\n\n   ; third");
  EXPECT_EQ(complaints(blanks), "");
  EXPECT_EQ(value(blanks, 0x2000), 7U);
}

TEST(EdsQuirks, HC4_12_LinesAreCountedWhateverTheirEnds) {
  for (const char* end : {"\n", "\r\n", "\r"}) {
    std::string text = std::string("[2000]") + end + end + "DataType=7" + end + "DefaultValue=zz" + end;
    const auto r = read_text(text);
    ASSERT_NE(find(r, Severity::warning, "[2000] DefaultValue"), nullptr);
    EXPECT_EQ(find(r, Severity::warning, "[2000] DefaultValue")->line, 4);
    EXPECT_EQ(find(r, Severity::warning, "[2000] DefaultValue")->column, 14);
  }
}

// HU.16
TEST(EdsQuirks, HC4_13_CapitalSubAndSubBeforeParent) {
  const auto r =
      read_text(file_with("[2000SUB1]\nParameterName=one\nDataType=5\nAccessType=rw\nDefaultValue=3\n"
                          "[2000Sub0]\nParameterName=n\nDataType=5\nAccessType=ro\nDefaultValue=1\n"
                          "[2000]\nParameterName=list\nObjectType=8\nSubNumber=2\n"));
  EXPECT_TRUE(r.findings.empty()) << to_string(r.findings.front());
  EXPECT_EQ(value(r, 0x2000, 1), 3U);
  EXPECT_EQ(r.file.description->find(0x2000)->code, od::ObjectCode::array);
}

TEST(EdsQuirks, HC4_13_SubWithoutParent) {
  const auto r = read_text(file_with("[2000sub1]\nParameterName=one\nDataType=5\nAccessType=rw\nDefaultValue=3\n"));
  EXPECT_EQ(value(r, 0x2000, 1), 3U);
  EXPECT_TRUE(warned(r, "[2000sub1]"));
}

TEST(EdsQuirks, HC4_14_ObjectNotInAList) {
  const auto r = read_text(file_with(variable(u32, "DefaultValue=7"), {}));
  EXPECT_EQ(value(r, 0x2000), 7U);
  EXPECT_TRUE(warned(r, "[2000]"));
}

TEST(EdsQuirks, HC4_15_ListWithHoleOrDuplicate) {
  const std::string text = file_with(variable(u32, "DefaultValue=7"));
  const auto replace = [&](std::string_view by) {
    std::string changed = text;
    changed.replace(changed.find("SupportedObjects=1\n1=0x2000"), 27, by);
    return read_text(changed);
  };
  const auto hole = replace("SupportedObjects=2\n1=0x2000\n3=0x2001\n");
  EXPECT_TRUE(hole.usable());
  EXPECT_TRUE(warned(hole, "[ManufacturerObjects]"));
  const auto* const no_section = find(hole, Severity::warning, "[ManufacturerObjects] 3");
  ASSERT_NE(no_section, nullptr) << "listed, but no section";
  EXPECT_NE(no_section->message.find("2001h"), std::string::npos);
  EXPECT_GT(no_section->line, 0U) << "where the list names it";
  const auto twice = replace("SupportedObjects=2\n1=0x2000\n2=0x2000\n");
  EXPECT_TRUE(warned(twice, "[ManufacturerObjects] 2"));
  EXPECT_EQ(value(twice, 0x2000), 7U);
  EXPECT_TRUE(warned(replace("SupportedObjects=9\n1=0x2000\n"), "[ManufacturerObjects]"));
  EXPECT_TRUE(warned(replace("SupportedObjects=1\n1=0x2000\n1=0x2000\n"), "[ManufacturerObjects]"));
  EXPECT_TRUE(warned(replace("1=0x2000\n"), "[ManufacturerObjects]"));
}

// HU.13 (KeyError DataType)
TEST(EdsQuirks, HC4_16_MissingKeysGetDefaults) {
  const auto r = read_text(file_with("[2000]\nObjectType=7\n"));
  ASSERT_TRUE(r.usable());
  ASSERT_NE(sub(r, 0x2000), nullptr);
  EXPECT_EQ(std::ranges::count(r.findings, "[2000]", &Finding::key), 3) << "name, data type, access";
  EXPECT_EQ(sub(r, 0x2000)->type, od::DataType::unsigned32);
  EXPECT_EQ(sub(r, 0x2000)->access, od::Access::rw);
  EXPECT_EQ(name(r, 0x2000), "2000");
  const auto var = read_text(file_with("[2000]\nParameterName=x\nDataType=5\nAccessType=ro\n"));
  EXPECT_EQ(complaints(var), "") << "a missing ObjectType means VAR";
}

TEST(EdsQuirks, HC4_17_UnknownAccessType) {
  const auto r = read_variable(u32, "", "xx");
  EXPECT_TRUE(r.usable());
  EXPECT_TRUE(warned(r, "[2000] AccessType"));
  const auto upper = read_variable(u32, "", "RW");
  EXPECT_EQ(complaints(upper), "");
}

const std::string two_subs =
    "[2000sub0]\nParameterName=n\nDataType=5\nAccessType=ro\nDefaultValue=1\n"
    "[2000sub1]\nParameterName=a\nDataType=5\nAccessType=rw\nDefaultValue=3\n"
    "[2000subA]\nParameterName=b\nDataType=5\nAccessType=rw\nDefaultValue=4\n";

// HC4.18 and HC4.19.
TEST(EdsQuirks, HC4_18_SubNumberMissingZeroOrTooSmall) {
  for (const char* line : {"", "SubNumber=0\n", "SubNumber=\n", "SubNumber=2\n", "SubNumber=99999999999\n"}) {
    const auto r = read_text(file_with(std::string("[2000]\nParameterName=list\nObjectType=9\n") + line + two_subs));
    EXPECT_TRUE(r.usable()) << line;
    EXPECT_EQ(value(r, 0x2000, 1), 3U) << line;
    EXPECT_EQ(value(r, 0x2000, 0xA), 4U) << line;
    EXPECT_TRUE(warned(r, "[2000]") || warned(r, "[2000] SubNumber")) << line;
  }
}

const std::string compact =
    "[2000]\nParameterName=Item\nObjectType=8\nDataType=6\nAccessType=rw\nDefaultValue=0x11\nCompactSubObj=3\n";

// E2.3
TEST(EdsQuirks, HC4_20_CompactSubObjWithPartialNameAndValue) {
  const auto r =
      read_text(file_with(compact + "[2000Name]\nNrOfEntries=1\n2=Second\n[2000Value]\nNrOfEntries=1\n3=0x77\n"));
  EXPECT_TRUE(r.findings.empty()) << to_string(r.findings.front());
  EXPECT_EQ(value(r, 0x2000, 0), 3U);
  EXPECT_EQ(value(r, 0x2000, 1), 0x11U);
  EXPECT_EQ(value(r, 0x2000, 2), 0x11U);
  EXPECT_EQ(value(r, 0x2000, 3), 0x77U);
  EXPECT_EQ(sub(r, 0x2000, 4), nullptr);
  EXPECT_EQ(name(r, 0x2000, 1), "Item1");
  EXPECT_EQ(name(r, 0x2000, 2), "Second");
  EXPECT_EQ(name(r, 0x2000, 0), "NrOfObjects");
  EXPECT_EQ(sub(r, 0x2000, 0)->type, od::DataType::unsigned8);
  EXPECT_EQ(sub(r, 0x2000, 0)->access, od::Access::ro);
  ASSERT_EQ(r.file.parameters.size(), 1U);
  EXPECT_EQ(r.file.parameters[0].object, (ObjectRef{0x2000, 3}));
  EXPECT_EQ(r.file.parameters[0].value, od::Literal::number(0x77));
}

TEST(EdsQuirks, HC4_20_CompactListsThatPointBeside) {
  const auto r = read_text(
      file_with(compact + "[2000Name]\nNrOfEntries=2\n0=Zero\n4=Four\n[2000Value]\nNrOfEntries=2\n4=1\n1=zz\n"));
  EXPECT_TRUE(warned(r, "[2000Name] 4"));
  EXPECT_TRUE(warned(r, "[2000Value] 4"));
  EXPECT_TRUE(refused(r, "[2000Value] 1"));
}

TEST(EdsQuirks, HC4_21_CompactSubObjOnRecord) {
  std::string record = compact;
  record.replace(record.find("ObjectType=8"), 12, "ObjectType=9");
  const auto r = read_text(file_with(record));
  EXPECT_EQ(value(r, 0x2000, 3), 0x11U);
  EXPECT_TRUE(warned(r, "[2000] CompactSubObj"));
  EXPECT_TRUE(r.usable());
}

TEST(EdsQuirks, HC4_22_InlineComment) {
  const auto r = read_variable(u32, "DefaultValue=7 ; seven");
  EXPECT_EQ(value(r, 0x2000), 7U);
  EXPECT_EQ(complaints(r), "");
  const auto text = read_variable(9, "DefaultValue=a;b");
  EXPECT_EQ(od::Values(text.file.description).get_text({0x2000, 0}), "a;b") << "no blank before it: not a comment";
  EXPECT_EQ(read_variable(u32, "DefaultValue=;none").file.description->default_of(*sub(text, 0x2000)).present(), true);
}

// `Lines` is an Unsigned16: more comments than it can count are a file made to fill memory.
TEST(EdsQuirks, VeryManyCommentsAreLeftOut) {
  std::string text = file_with(variable(u32, "")) + "[Comments]\nLines=70000\n";
  for (int i = 1; i <= 70'000; ++i) text += "Line" + std::to_string(i) + "=a\n";
  const auto loaded = read_text(text);
  EXPECT_EQ(loaded.file.comments.size(), 65'535U);
  EXPECT_TRUE(std::ranges::any_of(loaded.findings,
                                  [](const Finding& f) { return f.message.find("left out") != std::string::npos; }));
}

TEST(EdsQuirks, HC4_23_CommentsWithoutLinesAndPartialDummyUsage) {
  const auto r =
      read_text(file_with(variable(u32, "")) + "[Comments]\nLine1=hello\n[DummyUsage]\nDummy0005=1\nDummy0002=0\n");
  EXPECT_TRUE(r.findings.empty()) << to_string(r.findings.front());
  EXPECT_TRUE(r.file.description->dummy_mappable(5));
  EXPECT_FALSE(r.file.description->dummy_mappable(2));
  EXPECT_FALSE(r.file.description->dummy_mappable(7));
}

// HU.15
TEST(EdsQuirks, HC4_24_CommissioningInBothSpellings) {
  for (const char* spelling : {"DeviceComissioning", "DeviceCommissioning", "DEVICECOMISSIONING"}) {
    const auto r = read_text(file_with(variable(u32, "")) + "[" + spelling +
                             "]\nNodeID=0x05\nNodeName=left\nBaudrate=250\nNetNumber=3\nNetworkName=net\n"
                             "CANopenManager=1\nLSS_SerialNumber=0x12345678\n");
    EXPECT_EQ(complaints(r), "") << spelling;
    ASSERT_TRUE(r.file.commissioning) << spelling;
    EXPECT_EQ(r.file.commissioning->node_id, NodeId(5));
    EXPECT_EQ(r.file.commissioning->node_name, "left");
    EXPECT_EQ(r.file.commissioning->baud_rate, 250);
    EXPECT_EQ(r.file.commissioning->net_number, 3U);
    EXPECT_EQ(r.file.commissioning->network_name, "net");
    EXPECT_TRUE(r.file.commissioning->canopen_manager);
    EXPECT_EQ(r.file.commissioning->lss_serial_number, 0x12345678U);
  }
  EXPECT_FALSE(read_variable(u32, "").file.commissioning);
  const auto wrong = read_text(file_with(variable(u32, "")) + "[DeviceComissioning]\nNodeID=128\n");
  EXPECT_TRUE(refused(wrong, "[DeviceComissioning] NodeID"));
}

// HU.11
TEST(EdsQuirks, HC4_25_LeadingZerosInDeviceInfo) {
  const std::string text = file_with(variable(u32, ""));
  const auto with = [&](std::string_view number) {
    std::string changed = text;
    changed.replace(changed.find("VendorNumber=1"), 14, "VendorNumber=" + std::string(number));
    return read_text(changed);
  };
  EXPECT_EQ(with("001").file.device.vendor_number, 1U);
  EXPECT_TRUE(warned(with("001"), "[DeviceInfo] VendorNumber"));
  EXPECT_EQ(with("010").file.device.vendor_number, 8U);
  EXPECT_EQ(with("0x10").file.device.vendor_number, 16U);
  EXPECT_EQ(complaints(with("0x10")), "");
  EXPECT_TRUE(with("acme").usable()) << "the dictionary is readable all the same";
  EXPECT_TRUE(warned(with("acme"), "[DeviceInfo] VendorNumber"));
}

TEST(EdsQuirks, HC4_26_ParameterValueWinsOrFallsBack) {
  const auto wins = read_variable(u16, "DefaultValue=1\nParameterValue=2");
  EXPECT_EQ(value(wins, 0x2000), 2U);
  ASSERT_EQ(wins.file.parameters.size(), 1U);
  EXPECT_EQ(wins.file.parameters[0].value.raw, 2U);
  const auto empty = read_variable(u16, "DefaultValue=1\nParameterValue=");
  EXPECT_EQ(value(empty, 0x2000), 1U);
  EXPECT_TRUE(empty.file.parameters.empty());
}

TEST(EdsQuirks, HC4_27_DefaultOutsideItsLimits) {
  EXPECT_TRUE(warned(read_variable(u16, "DefaultValue=1\nLowLimit=2"), "[2000] DefaultValue"));
  EXPECT_TRUE(warned(read_variable(u16, "DefaultValue=9\nHighLimit=8"), "[2000] DefaultValue"));
  EXPECT_TRUE(warned(read_variable(u16, "ParameterValue=9\nHighLimit=8"), "[2000] ParameterValue"));
  EXPECT_TRUE(read_variable(u16, "DefaultValue=9\nHighLimit=8").usable());
  EXPECT_EQ(complaints(read_variable(u16, "DefaultValue=8\nHighLimit=8\nLowLimit=8")), "");
}

TEST(EdsQuirks, LimitsThatWouldRefuseEverythingAreLeftOut) {
  const auto low = read_variable(u32, "LowLimit=-1");
  EXPECT_TRUE(warned(low, "[2000] LowLimit"));
  EXPECT_EQ(low.file.description->limits(*sub(low, 0x2000)), nullptr);
  const auto crossed = read_variable(u32, "LowLimit=3\nHighLimit=1");
  EXPECT_TRUE(warned(crossed, "[2000] LowLimit"));
  EXPECT_EQ(crossed.file.description->limits(*sub(crossed, 0x2000)), nullptr);
}

// ---- the list below the table -------------------------------------------------------------------------------------

// E2.4
TEST(EdsQuirks, HC4_28_CompactPdo) {
  std::string text = file_with(variable(u32, ""));
  text.replace(text.find("VendorName=v"), 12, "VendorName=v\nNrOfRXPDO=2\nNrOfTXPDO=5\nGranularity=8\nCompactPDO=0x13");
  const auto r = read_text(text);
  EXPECT_EQ(complaints(r), "");
  EXPECT_EQ(value(r, 0x1400, 1), 0x205U);
  EXPECT_EQ(value(r, 0x1401, 1), 0x305U);
  EXPECT_EQ(sub(r, 0x1402, 1), nullptr);
  EXPECT_EQ(value(r, 0x1803, 1), 0x485U);
  EXPECT_EQ(value(r, 0x1804, 1), 0x80000000U) << "beyond the predefined connection set: not valid";
  EXPECT_EQ(value(r, 0x1400, 0), 5U);
  EXPECT_NE(sub(r, 0x1400, 2), nullptr);
  EXPECT_EQ(sub(r, 0x1400, 3), nullptr);
  EXPECT_EQ(sub(r, 0x1400, 5)->type, od::DataType::unsigned16);
  EXPECT_NE(sub(r, 0x1A04, 64), nullptr);
  // A DCF switches off the PDOs that it does not describe.
  const auto dcf = read_text(text + "[DeviceComissioning]\nNodeID=5\n");
  EXPECT_EQ(value(dcf, 0x1400, 1), 0x80000205U);
  EXPECT_EQ(value(dcf, 0x1804, 1), 0x80000000U);
  EXPECT_EQ(dcf.file.parameters.size(), 7U);
  EXPECT_EQ(dcf.file.defaults.size(), 6U) << "the fifth TPDO has no identifier by itself";
}

TEST(EdsQuirks, HC4_28_ObjectLinksModulesAndUnknownSections) {
  const auto r = read_text(file_with(variable(u32, "")) +
                           "[2000ObjectLinks]\nObjectLinks=1\n1=0x1000\n[SupportedModules]\nNrOfEntries=1\n"
                           "[M1ModuleInfo]\nProductName=x\n[M1SubExtends]\nNrOfEntries=1\n1=0x6000\n[M1SubExt6000]\n"
                           "ParameterName=z\nDataType=5\nAccessType=ro\nCount=2\n"
                           "[M1Fixed6000]\nParameterName=y\nDataType=5\nAccessType=ro\n[Tools]\nItems=1\n[Tool1]\nName="
                           "t\n[DynamicChannels]\nNrOfSeg=0\n");
  EXPECT_EQ(complaints(r), "");
  EXPECT_EQ(r.file.modules.size(), 1U);
  EXPECT_TRUE(noted(read_text(file_with(variable(u32, "")) + "[Surprise]\na=1\n"), "[Surprise]"));
  EXPECT_TRUE(noted(read_variable(u32, "Surprise=1"), "[2000] Surprise"));
}

TEST(EdsQuirks, ValuesOfObjectsBeyondTheBoundsAreLeftOutToo) {
  std::string text = file_with(variable(u32, "ParameterValue=1\nDenotation=x")) + "[DeviceComissioning]\nNodeID=5\n";
  text.replace(text.find("VendorName=v"), 12, "VendorName=v\nNrOfTXPDO=100\nCompactPDO=3");
  for (std::size_t most = 1; most < 40; ++most) {
    const auto r = read(text, "t", {.max_sub_objects = most});
    EXPECT_FALSE(r.usable());
    for (const auto& each : r.file.parameters) EXPECT_NE(r.file.description->find(each.object), nullptr) << most;
    for (const auto& each : r.file.defaults) EXPECT_NE(r.file.description->find(each.object), nullptr) << most;
    for (const auto& each : r.file.denotations) EXPECT_NE(r.file.description->find(each.object), nullptr) << most;
  }
}

TEST(EdsQuirks, AFileWithoutAnObjectIsNoEds) {
  EXPECT_TRUE(refused(read_text("[2000Value]\nNrOfEntries=1\n1=2\n"), "")) << "a list of an object that is not there";
  EXPECT_TRUE(refused(read_text(""), ""));
}

// E2.1
TEST(EdsQuirks, HC4_28_FileInfoDates) {
  const auto with = [](std::string_view line) {
    std::string text = file_with(variable(u32, ""));
    text.replace(text.find("EDSVersion=4.0"), 14, "EDSVersion=4.0\n" + std::string(line));
    return read_text(text);
  };
  EXPECT_TRUE(with("CreationDate=05-24-2024\nCreationTime=07:31pm").findings.empty());
  const auto iso = with("CreationDate=2024-05-24");
  EXPECT_TRUE(noted(iso, "[FileInfo] CreationDate"));
  EXPECT_EQ(iso.file.info.creation_date, "2024-05-24");
  EXPECT_EQ(complaints(iso), "");
}

TEST(EdsQuirks, HC4_28_Denotation) {
  const auto r = read_text(file_with(compact + "[2000Denotation]\nNrOfEntries=1\n2=speed\n"));
  ASSERT_EQ(r.file.denotations.size(), 1U);
  EXPECT_EQ(r.file.denotations[0].text, "speed");
  EXPECT_EQ(r.file.denotations[0].object, (ObjectRef{0x2000, 2}));
  EXPECT_EQ(read_variable(u32, "Denotation=left").file.denotations.at(0).text, "left");
}

TEST(EdsQuirks, HC4_29_OddWidthsRealsAndStrings) {
  EXPECT_EQ(value(read_variable(0x16, "DefaultValue=0xFFFFFF"), 0x2000), 0xFFFFFFU);
  EXPECT_TRUE(left_out(read_variable(0x16, "DefaultValue=0x1000000"), "[2000] DefaultValue"));
  EXPECT_EQ(signed_value(read_variable(0x12, "DefaultValue=-40"), 0x2000), -40);
  EXPECT_EQ(signed_value(read_variable(0x13, "DefaultValue=-48"), 0x2000), -48);
  EXPECT_EQ(signed_value(read_variable(0x14, "DefaultValue=-56"), 0x2000), -56);
  EXPECT_EQ(value(read_variable(0x18, "DefaultValue=0xFFFFFFFFFF"), 0x2000), 0xFFFFFFFFFFU);
  const auto real = read_variable(8, "DefaultValue=1.2\nLowLimit=-5.0\nHighLimit=5");
  EXPECT_EQ(complaints(real), "");
  EXPECT_EQ(*od::Values(real.file.description).get<float>({0x2000, 0}), 1.2F);
  const auto bytes = [](const Reading& r) {
    od::Values device(r.file.description);
    const auto span = device.bytes({0x2000, 0});
    return std::vector<std::uint8_t>(span.begin(), span.end());
  };
  EXPECT_EQ(bytes(read_variable(0x0B, "DefaultValue=00410042")), (std::vector<std::uint8_t>{0x41, 0, 0x42, 0}));
  EXPECT_EQ(bytes(read_variable(0x0A, "DefaultValue=AB CD")), (std::vector<std::uint8_t>{0xAB, 0xCD}));
  EXPECT_EQ(bytes(read_variable(0x0F, "DefaultValue=010203")), (std::vector<std::uint8_t>{1, 2, 3}));
  EXPECT_EQ(bytes(read_variable(9, "DefaultValue=a b")), (std::vector<std::uint8_t>{'a', ' ', 'b'}));
  EXPECT_TRUE(left_out(read_variable(1, "DefaultValue=2"), "[2000] DefaultValue")) << "BOOLEAN, R1#256";
}

TEST(EdsQuirks, HC4_30_FileNamesThatLeadElsewhere) {
  for (const char* name : {"../x.bin", "/etc/passwd", "..\\x", "C:\\x", "a/b", "..", "C:x"}) {
    const auto r =
        read_text(file_with(std::string("[2000]\nParameterName=f\nObjectType=2\nUploadFile=") + name + "\n"));
    EXPECT_TRUE(warned(r, "[2000] UploadFile")) << name;
    EXPECT_TRUE(r.file.file_references.empty()) << name;
  }
  const auto r = read_text(file_with("[2000]\nParameterName=f\nObjectType=2\nDownloadFile=program.bin\n"));
  EXPECT_TRUE(r.findings.empty()) << "DataType and AccessType are optional for a DOMAIN: " << complaints(r);
  ASSERT_EQ(r.file.file_references.size(), 1U);
  EXPECT_TRUE(r.file.file_references[0].download);
  EXPECT_EQ(r.file.file_references[0].name, "program.bin");
}

TEST(EdsQuirks, HC4_31_HugeCountsStayWithinBounds) {
  std::string huge = compact;
  huge.replace(huge.find("CompactSubObj=3"), 15, "CompactSubObj=4294967295");
  const auto r = read_text(file_with(huge));
  EXPECT_TRUE(warned(r, "[2000] CompactSubObj"));
  EXPECT_EQ(r.file.description->subs(*r.file.description->find(0x2000)).size(), 255U);
  EXPECT_TRUE(
      warned(read_text(file_with("[2000]\nParameterName=x\nObjectType=9\nSubNumber=0xFFFFFFFFFFFFFFFF\n" + two_subs)),
             "[2000] SubNumber"));
  // A small file that would unfold to 60,000 x 255 sub-objects ends at the limit with one error.
  std::string many;
  for (int index = 0x2000; index < 0x2000 + 60000 / 20; ++index) {
    std::array<char, 8> hex{};
    std::snprintf(hex.data(), hex.size(), "%04X", static_cast<unsigned>(index));
    many += std::string("[") + hex.data() +
            "]\nParameterName=x\nObjectType=8\nDataType=7\nAccessType=rw\nCompactSubObj=254\n";
  }
  const auto bounded = read(file_with(many, {}), "t.eds", {.max_sub_objects = 10'000});
  EXPECT_FALSE(bounded.usable());
  EXPECT_LE(bounded.file.description->subs().size(), 10'000U);
  EXPECT_EQ(std::ranges::count(bounded.findings, Severity::error, &Finding::severity), 1);
  // The same with one long default repeated.
  const auto fat = read(
      file_with("[2000]\nParameterName=x\nObjectType=8\nDataType=9\nAccessType=rw\nCompactSubObj=254\nDefaultValue=" +
                std::string(100'000, 'x') + "\n"),
      "t.eds", {.max_value_bytes = 1'000'000});
  EXPECT_FALSE(fat.usable());
  EXPECT_LE(fat.file.description->value_bytes(), 2'000'000U);
}

TEST(EdsQuirks, HC4_31_FindingsStayWithinBounds) {
  std::string lines;
  for (int i = 0; i < 5000; ++i) lines += "Unknown" + std::to_string(i) + "=1\n";
  const auto r = read(file_with(variable(u32, lines + "ParameterValue=zz")), "t.eds", {.max_findings = 100});
  EXPECT_LE(r.findings.size(), 102U);
  EXPECT_FALSE(r.usable()) << "an error is told even when the notes are cut";
}

TEST(EdsQuirks, HC4_32_HexPrefixInCapitalsNulAndMissingNewline) {
  EXPECT_EQ(value(read_variable(u32, "DefaultValue=0X1f"), 0x2000), 0x1FU);
  std::string text = file_with(variable(u32, ""));
  while (text.back() == '\n') text.pop_back();
  text += "\nDefaultValue=7";
  EXPECT_EQ(value(read_text(text), 0x2000), 7U);
  EXPECT_TRUE(read_text(text).findings.empty());
  const auto nul = read_text(text + std::string(3, '\0'));
  EXPECT_EQ(value(nul, 0x2000), 7U);
  EXPECT_EQ(complaints(nul), "");
  EXPECT_FALSE(nul.findings.empty());
}

TEST(EdsQuirks, LimitZeroAndSubNumberZeroAreNotLost) {
  const auto r = read_variable(i32, "LowLimit=0\nHighLimit=0");
  od::Values device(r.file.description);
  EXPECT_EQ(device.write({0x2000, 0}, std::vector<std::uint8_t>{1, 0, 0, 0}), AbortCode::value_too_high);
  EXPECT_EQ(device.write({0x2000, 0}, std::vector<std::uint8_t>{0xFF, 0xFF, 0xFF, 0xFF}), AbortCode::value_too_low);
  EXPECT_EQ(device.write({0x2000, 0}, std::vector<std::uint8_t>{0, 0, 0, 0}), AbortCode::none);
}

TEST(EdsQuirks, OrderOfSectionsIsFree) {
  const std::string text = file_with(compact + "[2000Value]\nNrOfEntries=1\n3=0x77\n");
  std::vector<std::string> parts;
  for (std::size_t at = 0; at != std::string::npos;) {
    const auto next = text.find("\n[", at);
    parts.push_back(text.substr(at, next == std::string::npos ? next : next - at) + "\n");
    at = next == std::string::npos ? next : next + 1;
  }
  std::ranges::reverse(parts);
  std::string reversed;
  for (const auto& part : parts) reversed += part;
  const auto r = read_text(reversed);
  EXPECT_EQ(complaints(r), "");
  EXPECT_EQ(value(r, 0x2000, 3), 0x77U);
}

TEST(EdsQuirks, BrokenLinesAreReportedAndPassedOver) {
  const auto r = read_variable(u32, "this is not a line\n=5\n[2001\nDefaultValue=7");
  EXPECT_TRUE(r.usable());
  EXPECT_TRUE(warned(r, "this is not a line"));
  EXPECT_TRUE(warned(r, "[2001"));
  EXPECT_TRUE(refused(read_text(""), ""));
  EXPECT_TRUE(refused(read_text("hello world"), ""));
  EXPECT_TRUE(refused(read_text("[FileInfo]\nFileName=x\n"), ""));
  EXPECT_TRUE(refused(read_file("/nonexistent/x.eds"), ""));
}

TEST(EdsQuirks, TextOutsideOfAnySection) {
  const auto r = read_text("a=1\n" + file_with(variable(u32, "")));
  EXPECT_TRUE(warned(r, "a"));
  EXPECT_TRUE(r.usable());
}

TEST(EdsQuirks, RecordWithSub0GivenByVarCode) {
  const auto r = read_text(file_with("[2000]\nParameterName=x\nObjectType=7\nDataType=7\nAccessType=rw\n" + two_subs));
  EXPECT_TRUE(warned(r, "[2000] ObjectType"));
  EXPECT_EQ(value(r, 0x2000, 1), 3U);
}

TEST(EdsFile, TypeCodeFromTheIdentityElseFromDeviceInfo) {
  EXPECT_EQ(read_variable(u32, "").file.type_code(), (TypeCode{1, 2})) << "1018:02 is not there";
  std::string text = file_with(variable(u32, ""));
  const std::string vendor = "ParameterName=Vendor-ID\nDataType=7\nAccessType=ro\nDefaultValue=";
  text.replace(text.find(vendor), vendor.size() + 1, vendor + "7");
  EXPECT_EQ(read_text(text).file.type_code().vendor, 7U);
}

TEST(EdsFile, E2_1_DeviceInfo) {
  std::string text = file_with(variable(u32, ""));
  text.replace(text.find("VendorName=v"), 12,
               "VendorName=v\nBaudRate_125=1\nBaudRate_10=0x1\nBaudRate_1000=0\nLSS_Supported=1\nGranularity=8\n"
               "SimpleBootUpSlave=1\nOrderCode=X-1\nRevisionNumber=0x10002\nNrOfRXPDO=0\nNrOfTXPDO=0");
  const auto device = read_text(text).file.device;
  EXPECT_EQ(device.baud_rates, (std::vector<std::uint16_t>{10, 125}));
  EXPECT_TRUE(device.lss);
  EXPECT_TRUE(device.boot_up_slave);
  EXPECT_FALSE(device.boot_up_master);
  EXPECT_EQ(device.granularity, 8);
  EXPECT_EQ(device.order_code, "X-1");
  EXPECT_EQ(device.revision_number, 0x10002U);
  EXPECT_EQ(device.vendor_name, "v");
}

}  // namespace
}  // namespace quirks_tests
