// Modular devices, network variables, comments, tools and links (CiA 306-1 §8, 306-3).
#include <gtest/gtest.h>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "random_description.hpp"
#include "support.hpp"

namespace {

using namespace berth;
using namespace berth::eds;
using namespace berth::eds::test;
using od::DataType;
using od::Literal;

TEST(EdsExtras, E2_5_CommentsToolsAndLinks) {
  const auto r = read_text(file_with(variable(7, "")) +
                           "[Comments]\nLines=3\nLine2=two\nLine1=one\nLine3=\n"
                           "[Tools]\nItems=2\n[Tool2]\nName=b\nCommand=b.exe\n[Tool1]\nName=a\nCommand=a.exe $EDS\n"
                           "[2000ObjectLinks]\nObjectLinks=2\n1=0x1000\n2=0x1001\n");
  EXPECT_EQ(complaints(r), "");
  EXPECT_EQ(r.file.comments, (std::vector<std::string>{"one", "two", ""}));
  EXPECT_EQ(r.file.tools, (std::vector<Tool>{{"a", "a.exe $EDS"}, {"b", "b.exe"}}));
  EXPECT_EQ(r.file.object_links, (std::vector<ObjectLinks>{{0x2000, {0x1000, 0x1001}}}));
}

TEST(EdsExtras, E2_5_DynamicChannels) {
  const auto r = read_text(file_with(variable(7, "")) +
                           "[DynamicChannels]\nNrOfSeg=2\nType1=0x0001\nDir1=ro\nRange1=0xA080-0xA0BF\nPPOffset1=0,1\n"
                           "Type2=0x0007\nDir2=rww\nRange2=0xA680-0xA6BF\nPPOffset2=0x100\n");
  EXPECT_TRUE(r.findings.empty()) << to_string(r.findings.front());
  ASSERT_EQ(r.file.dynamic_segments.size(), 2U);
  const DynamicSegment& bits = r.file.dynamic_segments[0];
  EXPECT_EQ(bits, (DynamicSegment{DataType::boolean, od::Access::ro, 0xA080, 0xA0BF, 0, 1}));
  EXPECT_EQ(bits.capacity(), 64U * 254U);
  EXPECT_EQ(bits.address({0xA081, 2}), 254U + 1U);
  const DynamicSegment& words = r.file.dynamic_segments[1];
  EXPECT_EQ(words.address({0xA680, 1}), 0x100U);
  EXPECT_EQ(words.address({0xA680, 3}), 0x100U + 2 * 4);
  EXPECT_EQ(words.address({0xA6BF, 254}), 0x100U + (63U * 254U + 253U) * 4U);
  for (const ObjectRef beside :
       {ObjectRef{0xA67F, 1}, ObjectRef{0xA6C0, 1}, ObjectRef{0xA680, 0}, ObjectRef{0xA680, 255}}) {
    EXPECT_EQ(words.address(beside), std::nullopt);
  }
}

TEST(EdsExtras, E2_5_BrokenSegmentsAreToldAndLeftOut) {
  const auto with = [](const char* lines) {
    return read_text(file_with(variable(7, "")) + "[DynamicChannels]\nNrOfSeg=1\n" + lines);
  };
  const auto left_out = [&](const char* lines, const char* key) {
    const auto r = with(lines);
    EXPECT_TRUE(r.usable());
    EXPECT_TRUE(r.file.dynamic_segments.empty()) << lines;
    EXPECT_TRUE(warned(r, key)) << lines << complaints(r);
  };
  left_out("Type1=x\nDir1=ro\nRange1=0xA080-0xA0BF\n", "[DynamicChannels] Type1");
  left_out("Type1=1\nDir1=up\nRange1=0xA080-0xA0BF\n", "[DynamicChannels] Dir1");
  left_out("Type1=1\nDir1=ro\nRange1=0xA0BF-0xA080\n", "[DynamicChannels] Range1");
  left_out("Type1=1\nDir1=ro\nRange1=0xA080-0xA0BF\nPPOffset1=a,b\n", "[DynamicChannels] PPOffset1");
  left_out("", "[DynamicChannels]");
  EXPECT_TRUE(noted(with("Type1=7\nDir1=ro\nRange1=0xA080-0xA0BF\n"), "[DynamicChannels] Range1"))
      << "UNSIGNED32 that the device produces live at A200h";
  const auto many = read_text(file_with(variable(7, "")) + "[DynamicChannels]\nNrOfSeg=4294967295\n");
  EXPECT_TRUE(warned(many, "[DynamicChannels] NrOfSeg"));
}

constexpr const char* coupler =
    "[6000]\nParameterName=Inputs\nObjectType=8\nSubNumber=2\n"
    "[6000sub0]\nParameterName=n\nDataType=5\nAccessType=ro\nDefaultValue=1\n"
    "[6000sub1]\nParameterName=Own input\nDataType=5\nAccessType=ro\nPDOMapping=1\n"
    "[SupportedModules]\nNrOfEntries=3\n"
    "[M1ModuleInfo]\nProductName=Inputs 16\nProductVersion=1\nProductRevision=2\nOrderCode=I-16\n"
    "[M1Comments]\nLines=1\nLine1=sixteen inputs\n"
    "[M1SubExtends]\nNrOfEntries=1\n1=0x6000\n"
    "[M1SubExt6000]\nParameterName=Input byte\nDataType=5\nAccessType=ro\nPDOMapping=1\nCount=2\nObjExtend=0\n"
    "[M2ModuleInfo]\nProductName=Outputs 3\nOrderCode=O-3\n"
    "[M2FixedObjects]\nNrOfEntries=2\n1=0x2400\n2=0x2401\n"
    "[M2Fixed2400]\nParameterName=Fault mode\nObjectType=7\nDataType=6\nAccessType=rw\nDefaultValue=3\nPDOMapping=0\n"
    "[M2Fixed2401]\nParameterName=Settings\nObjectType=9\nSubNumber=2\n"
    "[M2Fixed2401sub0]\nParameterName=n\nDataType=5\nAccessType=const\nDefaultValue=1\n"
    "[M2Fixed2401sub1]\nParameterName=x\nDataType=4\nAccessType=rw\nLowLimit=-4\nHighLimit=4\n"
    "[M2SubExtends]\nNrOfEntries=1\n1=0x6200\n"
    "[M2SubExt6200]\nParameterName=Outputs\nDataType=5\nAccessType=rww\nPDOMapping=1\nDefaultValue=0\nCount=0;3\n"
    "[M3ModuleInfo]\nProductName=Counter\nOrderCode=C\n"
    "[M3SubExtends]\nNrOfEntries=1\n1=0x6800\n"
    "[M3SubExt6800]\nParameterName=Count\nDataType=7\nAccessType=ro\nCount=200\nObjExtend=1\n";

std::size_t subs_of(const od::Description& d, std::uint16_t index) {
  const auto* const object = d.find(index);
  return object == nullptr ? 0 : object->count;
}

TEST(EdsModules, E2_6_KindsOfModules) {
  const auto r = read_text(file_with(coupler, {}));
  EXPECT_TRUE(r.usable()) << complaints(r);
  ASSERT_EQ(r.file.modules.size(), 3U);
  const Module& inputs = r.file.modules[0];
  EXPECT_EQ(inputs.number, 1);
  EXPECT_EQ(inputs.product_name, "Inputs 16");
  EXPECT_EQ(inputs.product_revision, "2");
  EXPECT_EQ(inputs.order_code, "I-16");
  EXPECT_EQ(inputs.comments, std::vector<std::string>{"sixteen inputs"});
  ASSERT_EQ(inputs.extensions.size(), 1U);
  EXPECT_EQ(inputs.extensions[0].count, 2);
  EXPECT_EQ(inputs.extensions[0].bits, 0);
  const Module& outputs = r.file.modules[1];
  ASSERT_EQ(outputs.fixed_objects.size(), 2U);
  EXPECT_EQ(outputs.fixed_objects[0].subs.at(0).initial, Literal::number(3));
  EXPECT_EQ(outputs.fixed_objects[1].code, od::ObjectCode::record);
  EXPECT_EQ(outputs.fixed_objects[1].subs.at(1).low, Literal::number(static_cast<std::uint64_t>(-4)));
  EXPECT_EQ(outputs.extensions.at(0).bits, 3);
  EXPECT_EQ(outputs.extensions.at(0).value.access, od::Access::rww);
  EXPECT_EQ(subs_of(*r.file.description, 0x6200), 0U) << "no module, no object";
}

TEST(EdsModules, E2_6_ExpandedWithTheModulesInTheirSlots) {
  const auto r = read_text(file_with(coupler, {}));
  const std::array<std::uint16_t, 5> slots{1, 2, 0, 1, 2};
  const auto made = expand(r.file, slots);
  EXPECT_TRUE(made.findings.empty());
  const od::Description& d = *made.description;
  EXPECT_EQ(subs_of(d, 0x6000), 1U + 1U + 4U) << "its own input, and two bytes of each module";
  od::Values device(made.description, NodeId(1));
  EXPECT_EQ(device.get_or<unsigned>({0x6000, 0}, 0), 5U) << "the count counts";
  EXPECT_EQ(d.name(*d.find(ObjectRef{0x6000, 1})), "Own input");
  EXPECT_EQ(d.name(*d.find(ObjectRef{0x6000, 5})), "Input byte");
  EXPECT_EQ(d.find(ObjectRef{0x6000, 5})->access, od::Access::ro);
  // Two modules of three bits share a byte.
  EXPECT_EQ(subs_of(d, 0x6200), 2U);
  EXPECT_EQ(device.get_or<unsigned>({0x6200, 0}, 0), 1U);
  // Fixed objects are there once, with limits and defaults.
  EXPECT_EQ(device.get_or<unsigned>({0x2400, 0}, 0), 3U);
  EXPECT_EQ(device.write({0x2401, 1}, std::vector<std::uint8_t>{5, 0, 0, 0}), od::AbortCode::value_too_high);
  EXPECT_EQ(subs_of(d, 0x2401), 2U);
  EXPECT_EQ(difference(*expand(r.file, std::span<const std::uint16_t>()).description, *r.file.description), "")
      << "without modules it is the coupler";
}

TEST(EdsModules, E2_6_BitsBeginANewSubIndexWhenTheyDoNotFit) {
  const auto r = read_text(file_with(coupler, {}));
  const std::vector<std::uint16_t> slots(5, 2);  // 3+3 bits, 3+3 bits, 3 bits
  EXPECT_EQ(subs_of(*expand(r.file, slots).description, 0x6200), 1U + 3U);
}

TEST(EdsModules, E2_6_WhatDoesNotFitIsTold) {
  const auto r = read_text(file_with(coupler, {}));
  const std::vector<std::uint16_t> unknown{9};
  EXPECT_EQ(expand(r.file, unknown).findings.size(), 1U);
  const std::vector<std::uint16_t> counters(3, 3);  // 600 sub-indices: 254 and 254 of the next index
  const auto made = expand(r.file, counters);
  EXPECT_EQ(made.findings.size(), 1U);
  EXPECT_EQ(subs_of(*made.description, 0x6800), 255U);
  EXPECT_EQ(subs_of(*made.description, 0x6801), 255U);
  EXPECT_EQ(subs_of(*made.description, 0x6802), 0U);
}

TEST(EdsModules, E2_6_ConnectedModulesOfADcf) {
  const auto r = read_text(file_with(std::string(coupler) + "[ConnectedModules]\nNrOfEntries=3\n1=2\n3=1\n2=2\n", {}));
  EXPECT_EQ(r.file.connected_modules, (std::vector<std::uint16_t>{2, 2, 1}));
  const auto made = expand(r.file);
  EXPECT_EQ(subs_of(*made.description, 0x6200), 2U);
  EXPECT_EQ(subs_of(*made.description, 0x6000), 2U) << "the DCF describes its inputs itself";
  const auto wild =
      read_text(file_with(std::string(coupler) + "[ConnectedModules]\nNrOfEntries=1\n999999999=1\n0=1\n", {}));
  EXPECT_TRUE(warned(wild, "[ConnectedModules] 999999999"));
  EXPECT_TRUE(wild.file.connected_modules.empty());
}

TEST(EdsModules, E2_6_ModulesSurviveWriteAndRead) {
  const auto r = read_text(file_with(std::string(coupler) + "[ConnectedModules]\nNrOfEntries=2\n1=2\n2=1\n", {}));
  const auto back = read_text(write(r.file, {.form = Form::dcf}).text);
  EXPECT_EQ(back.file.modules, r.file.modules);
  EXPECT_EQ(back.file.connected_modules, r.file.connected_modules);
}

TEST(EdsModules, E2_6_BrokenModules) {
  const auto with = [](const char* text) { return read_text(file_with(std::string(coupler) + text, {})); };
  EXPECT_TRUE(
      warned(with("[M4SubExt6000]\nParameterName=x\nDataType=5\nAccessType=ro\nCount=x\n"), "[M4SubExt6000] Count"));
  EXPECT_TRUE(warned(with("[M4Fixed2400sub1]\nParameterName=x\nDataType=5\nAccessType=ro\n"), "[M4Fixed2400sub1]"));
  EXPECT_TRUE(warned(with("[M1FixedObjects]\nNrOfEntries=1\n1=0x2999\n"), "[M1FixedObjects] 1"));
  EXPECT_TRUE(noted(with("[M0ModuleInfo]\n"), "[M0ModuleInfo]")) << "modules count from 1";
  EXPECT_TRUE(left_out(with("[M4Fixed2400]\nParameterName=x\nDataType=5\nAccessType=ro\nDefaultValue=300\n"),
                       "[M4Fixed2400] DefaultValue"));
  std::string many = file_with(coupler, {});
  for (int i = 4; i < 300; ++i) {
    many += "[M" + std::to_string(i) +
            "Fixed2400]\nParameterName=x\nObjectType=8\nDataType=5\nAccessType=ro\n"
            "CompactSubObj=254\n";
  }
  const auto bounded = read(many, "t", {.max_sub_objects = 10'000});
  EXPECT_FALSE(bounded.usable());
}

}  // namespace
