// DCFs (CiA 306 §5): what they say beyond an EDS, and making one from an EDS and values.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <unistd.h>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <filesystem>
#include <fstream>

#include "berth/eds/concise_dcf.hpp"
#include "berth/eds/dcf.hpp"
#include "random_description.hpp"
#include "support.hpp"

namespace {

using namespace berth;
using namespace berth::eds;
using namespace berth::eds::test;
namespace fs = std::filesystem;
using od::DataType;
using od::Literal;

Reading dcf_reading(const Result<std::string>& text) {
  EXPECT_TRUE(text) << describe(text.error());
  return read(text.value_or(""), "t.dcf");
}

TEST(Dcf, E3_1_ValuesFilesNamesAndReferences) {
  const auto r = read_text(file_with(variable(7,
                                              "DefaultValue=1\nParameterValue=2\nDenotation=left wheel\n"
                                              "ParamRefd=doc#12") +
                                         "[2001]\nParameterName=d\nObjectType=2\nDownloadFile=a.bin\n"
                                         "[2002]\nParameterName=u\nObjectType=2\nUploadFile=b.bin\n",
                                     {"0x2000", "0x2001", "0x2002"}));
  EXPECT_EQ(complaints(r), "");
  ASSERT_EQ(r.file.parameters.size(), 1U);
  EXPECT_EQ(r.file.parameters[0].value, Literal::number(2));
  ASSERT_EQ(r.file.defaults.size(), 1U);
  EXPECT_EQ(r.file.defaults[0].value, Literal::number(1)) << "what the device has by itself is not lost";
  EXPECT_EQ(r.file.denotations, (std::vector<Denotation>{{{0x2000, 0}, "left wheel"}}));
  EXPECT_EQ(r.file.param_refs, (std::vector<ParamRef>{{{0x2000, 0}, "doc#12"}}));
  ASSERT_EQ(r.file.file_references.size(), 2U);
  EXPECT_TRUE(r.file.file_references[0].download);
  EXPECT_FALSE(r.file.file_references[1].download);
  EXPECT_NE(r.file.file_references[0].line, 0U);
}

constexpr const char* compact =
    "[2100]\nParameterName=Channel\nObjectType=8\nDataType=6\nAccessType=rw\nDefaultValue=5\nCompactSubObj=4\n";

TEST(Dcf, E3_1_ValueListsOfCompactArraysKeepTheDefaults) {
  const auto r = read_text(
      file_with(std::string(compact) + "[2100Value]\nNrOfEntries=2\n2=7\n4=9\n[2100Denotation]\nNrOfEntries=1\n3=x\n",
                {"0x2100"}));
  EXPECT_EQ(complaints(r), "");
  EXPECT_EQ(value(r, 0x2100, 2), 7U);
  EXPECT_EQ(value(r, 0x2100, 3), 5U);
  ASSERT_EQ(r.file.parameters.size(), 2U);
  ASSERT_EQ(r.file.defaults.size(), 2U);
  EXPECT_EQ(r.file.defaults[1].object, (ObjectRef{0x2100, 4}));
  EXPECT_EQ(r.file.defaults[1].value, Literal::number(5));
  // A ParameterValue of the array is for all of its sub-indices; the list speaks after it.
  const auto both =
      read_text(file_with(std::string(compact) + "ParameterValue=6\n[2100Value]\nNrOfEntries=1\n2=7\n", {"0x2100"}));
  EXPECT_EQ(value(both, 0x2100, 1), 6U);
  EXPECT_EQ(value(both, 0x2100, 2), 7U);
  ASSERT_EQ(both.file.defaults.size(), 4U);
  for (const auto& each : both.file.defaults) EXPECT_EQ(each.value, Literal::number(5));
}

/// An EDS with comments, odd order and a TPDO, to make DCFs from.
std::string eds_text() {
  return "; made by hand\r\n" +
         file_with(
             "[1800]\nParameterName=t\nObjectType=9\nSubNumber=2\n;PERSIST\n"
             "[1800sub0]\nParameterName=n\nDataType=5\nAccessType=ro\nDefaultValue=2\n"
             "[1800SUB1]\nParameterName=c\nDataType=7\nAccessType=rw\nDefaultValue=$NodeID + 0x180 ; usual\n"
             "[2000]\nParameterName=s\nDataType=9\nAccessType=rw\nDefaultValue=abc\n"
             "[2001]\nParameterName=i\nDataType=3\nAccessType=rw\nDefaultValue=-1\n"
             "[2002]\nParameterName=h\nDataType=6\nAccessType=rw\nDefaultValue=0x10\n"
             "[2003]\nParameterName=d\nObjectType=2\n"
             "[Vendor]\nsecret=1\n" +
                 std::string(compact),
             {"0x1800", "0x2000", "0x2001", "0x2002", "0x2003", "0x2100"}) +
         "; the end";
}

Configuration a_configuration() {
  Configuration wanted;
  wanted.commissioning = Commissioning{.node_id = NodeId(5), .node_name = "axis", .baud_rate = 500, .net_number = 1};
  wanted.parameters = {{{0x1800, 1}, DataType::unsigned32, Literal::node_id_plus(0x180)},
                       {{0x2000, 0}, DataType::visible_string, Literal::text("xyz")},
                       {{0x2001, 0}, DataType::integer16, Literal::number(static_cast<std::uint64_t>(-300))},
                       {{0x2002, 0}, DataType::unsigned16, Literal::number(0x2A)},
                       {{0x2100, 3}, DataType::unsigned16, Literal::number(77)}};
  wanted.denotations = {{{0x2001, 0}, "speed"}, {{0x2100, 2}, "left"}};
  wanted.file_references = {{{0x2003, 0}, true, "program.bin"}};
  wanted.file_name = "axis.dcf";
  wanted.modification_date = "11-21-2026";
  return wanted;
}

TEST(Dcf, E3_2_MadeFromAnEdsAndValues) {
  const auto eds = read(eds_text(), "t.eds");
  const auto text = make_dcf(eds.file, a_configuration());
  const auto r = dcf_reading(text);
  EXPECT_TRUE(r.usable()) << complaints(r);
  EXPECT_EQ(r.file.info.file_name, "axis.dcf");
  EXPECT_EQ(r.file.info.last_eds, "t.eds");
  EXPECT_EQ(r.file.info.modification_date, "11-21-2026");
  ASSERT_TRUE(r.file.commissioning);
  EXPECT_EQ(r.file.commissioning->node_id, NodeId(5));
  EXPECT_EQ(r.file.commissioning->node_name, "axis");
  EXPECT_EQ(r.file.commissioning->baud_rate, 500);
  EXPECT_EQ(r.file.commissioning->net_number, 1U);
  EXPECT_EQ(r.file.parameters.size(), 5U);
  EXPECT_EQ(signed_value(r, 0x2001), -300);
  EXPECT_EQ(value(r, 0x2100, 3), 77U);
  EXPECT_EQ(value(r, 0x2100, 2), 5U);
  EXPECT_EQ(value(r, 0x1800, 1, 7), 0x187U);
  EXPECT_EQ(r.file.denotations.size(), 2U);
  EXPECT_EQ(r.file.file_references.at(0).name, "program.bin");
  // Written as the file writes: hexadecimal stays, and the formula is the file's own.
  EXPECT_NE(text->find("ParameterValue=0x002A\n"), std::string::npos);
  EXPECT_NE(text->find("ParameterValue=-300\n"), std::string::npos);
  EXPECT_NE(text->find("ParameterValue=$NodeID + 0x180\n"), std::string::npos);
  EXPECT_NE(text->find("[2100Value]\nNrOfEntries=1\n3=77\n"), std::string::npos);
  EXPECT_NE(text->find("[DeviceComissioning]\nNodeID=0x05\nNodeName=axis\nBaudrate=500\n"), std::string::npos);
  // Every line of the EDS but FileName still stands there, in its order.
  std::istringstream old(eds_text());
  std::size_t at = 0;
  for (std::string line; std::getline(old, line);) {
    if (line.starts_with("FileName=")) continue;
    at = text->find(line, at);
    ASSERT_NE(at, std::string::npos) << line;
    at += line.size();
  }
}

TEST(Dcf, E3_2_SayingItAgainChangesNothingAndTakingItBackTakesItOut) {
  const auto eds = read(eds_text(), "t.eds");
  const auto first = make_dcf(eds.file, a_configuration());
  const auto again = make_dcf(read(*first, "t.dcf").file, a_configuration());
  EXPECT_EQ(*again, *first);
  Configuration back;
  for (const auto& each : a_configuration().parameters) back.parameters.push_back({each.object, each.type, Literal{}});
  back.denotations = {{{0x2001, 0}, ""}, {{0x2100, 2}, ""}};
  back.file_references = {{{0x2003, 0}, true, ""}};
  const auto r = dcf_reading(make_dcf(read(*first, "t.dcf").file, back));
  EXPECT_TRUE(r.file.parameters.empty());
  EXPECT_TRUE(r.file.denotations.empty());
  EXPECT_TRUE(r.file.file_references.empty());
  EXPECT_EQ(difference(*r.file.description, *eds.file.description), "");
}

TEST(Dcf, E3_2_BothSpellingsOfTheSectionAndNumbersThatMeanTheSame) {
  const auto r = read(eds_text() + "\n[DeviceCommissioning]\nNodeID=5\nBaudrate=0x1F4\nLSS_SerialNumber=7\n", "t.dcf");
  Configuration wanted;
  wanted.commissioning = Commissioning{.node_id = NodeId(5), .baud_rate = 500};
  const auto text = make_dcf(r.file, wanted);
  ASSERT_TRUE(text);
  EXPECT_EQ(text->find("DeviceComissioning"), std::string::npos);
  EXPECT_NE(text->find("NodeID=5\nBaudrate=0x1F4\n"), std::string::npos);
  EXPECT_EQ(text->find("LSS_SerialNumber"), std::string::npos) << "a value that is not given is taken out";
}

TEST(Dcf, E3_1_WhatCannotBeSaidIsRefused) {
  const auto eds = read(eds_text(), "t.eds");
  const auto refused = [&](ObjectRef object, Literal value, Errc code) {
    Configuration wanted;
    wanted.parameters = {{object, DataType::none, std::move(value)}};
    const auto made = make_dcf(eds.file, wanted);
    ASSERT_FALSE(made) << object.index;
    EXPECT_EQ(made.error().code, code) << made.error().text;
    EXPECT_EQ(made.error().index, object.index);
    EXPECT_EQ(made.error().sub, object.sub);
  };
  refused({0x3000, 0}, Literal::number(1), Errc::not_found);
  refused({0x2100, 9}, Literal::number(1), Errc::not_found);
  refused({0x2001, 0}, Literal::number(70000), Errc::invalid);
  refused({0x2001, 0}, Literal::text("x"), Errc::invalid);
  refused({0x2000, 0}, Literal::number(1), Errc::invalid);
  refused({0x2000, 0}, Literal::text("a\nb"), Errc::invalid);
  refused({0x2000, 0}, Literal::text(""), Errc::invalid);
  Configuration names;
  names.file_references = {{{0x2003, 0}, true, "../x"}};
  EXPECT_EQ(make_dcf(eds.file, names).error().code, Errc::invalid);
  names.file_references.clear();
  names.commissioning = Commissioning{.node_name = "a\nNodeID=9"};
  EXPECT_EQ(make_dcf(eds.file, names).error().code, Errc::invalid) << "no line of the caller's own gets in";
}

// E2.4: a PDO that only CompactPDO describes gets sections when a value is set.
TEST(Dcf, E2_4_ValuesOfCompactPdos) {
  std::string text = file_with(variable(7, ""));
  text.replace(text.find("VendorName=v"), 12, "VendorName=v\nNrOfTXPDO=2\nGranularity=8\nCompactPDO=3");
  const auto eds = read(text, "t.eds");
  Configuration wanted;
  wanted.parameters = {{{0x1801, 2}, DataType::unsigned8, Literal::number(1)},
                       {{0x1A01, 1}, DataType::unsigned32, Literal::number(0x20000020)}};
  const auto r = dcf_reading(make_dcf(eds.file, wanted));
  EXPECT_EQ(complaints(r), "");
  EXPECT_EQ(value(r, 0x1801, 2), 1U);
  EXPECT_EQ(value(r, 0x1A01, 1), 0x20000020U);
  EXPECT_EQ(value(r, 0x1801, 1), 0x285U);
  EXPECT_EQ(r.file.parameters.size(), 2U);
  EXPECT_NE(sub(r, 0x1800, 2), nullptr) << "the other PDO is still implied";
}

/// Values of a live device, set in the EDS they belong to, are the values of a device of the DCF.
RC_GTEST_PROP(Dcf, E3_1_AnyValuesOfADeviceSurviveTheDcf, (std::uint64_t seed)) {
  Random random(seed);
  File file;
  file.description = random_description(random);
  const auto eds = read(write(file).text, "t.eds");
  const NodeId node(static_cast<std::uint8_t>(1 + random.below(127)));
  od::Values device(eds.file.description, node);
  Configuration wanted;
  for (const od::Object& object : eds.file.description->objects()) {
    for (const od::SubObject& sub : eds.file.description->subs(object)) {
      if (random.chance(400'000)) continue;
      const ObjectRef ref{object.index, sub.sub};
      const auto bytes = encode(random_value(random, sub.type), sub.type, node);
      RC_ASSERT(bytes.has_value());
      if (bytes->size() > sub.capacity) continue;
      RC_ASSERT(device.set_bytes(ref, *bytes) == od::AbortCode::none);
      auto value = decode(*bytes, sub.type);
      // A VISIBLE_STRING's bytes may need another encoding than the file's names: not this property's matter.
      const bool ascii = std::ranges::all_of(*bytes, [](std::uint8_t byte) { return byte < 0x80; });
      if (sub.type == DataType::visible_string && !ascii) {
        device.set_bytes(ref, device.description().default_of(sub).bytes);
        continue;
      }
      wanted.parameters.push_back({ref, sub.type, with_formula(*eds.file.description, ref, std::move(*value), node)});
    }
  }
  const auto text = make_dcf(eds.file, wanted);
  if (!text) RC_FAIL(describe(text.error()));
  const auto back = read(*text, "t.dcf");
  RC_ASSERT(back.usable());
  RC_ASSERT(back.file.parameters.size() == wanted.parameters.size());
  od::Values copy(back.file.description, node);
  for (const Parameter& each : wanted.parameters) {
    const auto a = device.bytes(each.object);
    const auto b = copy.bytes(each.object);
    RC_ASSERT(std::vector<std::uint8_t>(a.begin(), a.end()) == std::vector<std::uint8_t>(b.begin(), b.end()));
  }
}

TEST(Dcf, E3_1_FilesBesideTheDcfAndNowhereElse) {
  const fs::path folder = fs::temp_directory_path() / ("berth_dcf_" + std::to_string(::getpid()));
  fs::create_directories(folder / "net");
  const fs::path dcf = folder / "net" / "a.dcf";
  const auto put = [](const fs::path& path, std::string_view text) { std::ofstream(path, std::ios::binary) << text; };
  put(folder / "net" / "p.bin", std::string_view("\0\1\2", 3));
  put(folder / "secret", "s");
  fs::create_symlink(folder / "secret", folder / "net" / "link");
  fs::create_symlink("p.bin", folder / "net" / "inner");
  fs::create_directory(folder / "net" / "dir");
  const auto code = [&](const char* name, std::size_t most = 100) {
    const auto got = read_beside(dcf, {{0x1F50, 1}, true, name}, most);
    return got ? std::nullopt : std::optional(got.error().code);
  };
  EXPECT_EQ(*read_beside(dcf, {{0x1F50, 1}, true, "p.bin"}), (std::vector<std::uint8_t>{0, 1, 2}));
  EXPECT_EQ(code("inner"), std::nullopt) << "a link within the folder";
  EXPECT_EQ(code("missing"), Errc::not_found);
  EXPECT_EQ(code("p.bin", 2), Errc::invalid);
  EXPECT_EQ(code("p.bin", 3), std::nullopt);
  for (const char* name : {"../secret", "link", "dir", "", ".", "..", "/etc/passwd", "a\\b", "C:x"}) {
    EXPECT_EQ(code(name), Errc::invalid) << name;
  }
  const auto where = read_beside(dcf, {{0x1F50, 1}, true, "missing"});
  EXPECT_EQ(where.error().index, 0x1F50);
  fs::remove_all(folder);
}

}  // namespace
