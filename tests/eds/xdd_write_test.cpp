// XDD and XDC written (CiA 311; docs/protocols/cia306.md §XDD and XDC): what is read back is equal, and the elements
// stand as the schema wants them.
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
using od::Literal;
namespace fs = std::filesystem;

std::string differences(const File& a, const File& b) {
  std::string text;
  for (const auto& each : diff(a, b)) text += to_string(each) + "\n";
  return text;
}

/// Positions of words in this order, each behind the one before.
bool in_order(const std::string& text, std::initializer_list<std::string_view> words) {
  std::size_t at = 0;
  for (const auto word : words) {
    at = text.find(word, at);
    if (at == std::string::npos) {
      ADD_FAILURE() << word << " is missing or too early";
      return false;
    }
    at += word.size();
  }
  return true;
}

/// A value of a type: any bits of a scalar, any text of a string.
Literal any_literal(Random& random, DataType type) {
  const std::size_t size = od::byte_size(type);
  if (size != 0) {
    if (od::is_integer(type) && type != DataType::boolean && random.below(4) == 0)
      return Literal::node_id_plus(random.below(100));
    std::uint64_t raw = od::wrap(type, random.next());
    if (type == DataType::boolean) raw = random.below(2);
    if (od::is_time(type)) raw &= 0xFFFF'0FFF'FFFFULL;
    // A NaN has many bit patterns; its text keeps them, its comparison would not.
    if (od::is_real(type))
      raw = od::raw_of(type, static_cast<double>(static_cast<std::int64_t>(random.next() >> 20U)) / 64);
    return Literal::number(raw);
  }
  if (type == DataType::visible_string) {
    static const std::vector<std::string> words{
        "a",       "<&\">'", "two words", " blanks at its ends ", "0x12", "line\nfeed\tand tab", "\xC3\xA4\xE2\x82\xAC",
        "$NODEID", "]]>"};
    return Literal::text(words[random.below(words.size())]);
  }
  std::vector<std::uint8_t> bytes(2 * (1 + random.below(6)));
  for (auto& each : bytes) each = static_cast<std::uint8_t>(random.next());
  return Literal::octets(bytes);
}

std::string any_name(Random& random) {
  static const std::vector<std::string> words{"speed",
                                              "a <b> & \"c\"",
                                              "d'e",
                                              "\xC3\xBC"
                                              "ber",
                                              "x",
                                              "tab\there",
                                              "100 %",
                                              "[1000]"};
  return words[random.below(words.size())] + std::to_string(random.below(1000));
}

od::SubSpec any_spec(Random& random, std::uint8_t sub, const std::string& name) {
  const auto types = od::all_data_types();
  od::SubSpec spec;
  spec.sub = sub;
  spec.name = name;
  spec.type = types[random.below(types.size())];
  spec.access = static_cast<Access>(random.below(6));
  spec.mappable = random.below(2) == 0;
  spec.obj_flags = static_cast<std::uint8_t>(random.below(4));
  if (random.below(3) != 0) spec.initial = any_literal(random, spec.type);
  if (od::is_integer(spec.type) && spec.type != DataType::boolean && random.below(3) == 0) {
    const Literal a = Literal::number(od::wrap(spec.type, random.next()));
    const Literal b = Literal::number(od::wrap(spec.type, random.next()));
    const bool ordered = od::compare(spec.type, a.raw, b.raw) <= 0;
    spec.low = ordered ? a : b;
    spec.high = ordered ? b : a;
    if (random.below(3) == 0) spec.low = {};
    // Within the limits, so that nothing is told of it.
    if (spec.initial.present()) spec.initial = spec.high;
  }
  return spec;
}

File any_file(Random& random, bool values) {
  File file;
  od::DescriptionBuilder builder;
  const auto add = [&](std::uint16_t index, const od::SubSpec& spec) {
    builder.sub(index, spec);
    const ObjectRef ref{index, spec.sub};
    if (random.below(6) == 0) file.denotations.push_back({ref, "denoted " + std::to_string(index)});
    if (!values || random.below(3) != 0) return;
    Literal value = spec.high.present() ? spec.high : any_literal(random, spec.type);
    if (spec.initial.present()) file.defaults.push_back({ref, spec.type, spec.initial, 0});
    file.parameters.push_back({ref, spec.type, value, 0});
    builder.initial(ref, value);
  };
  std::uint16_t index = 0x1018;
  const auto objects = 1 + random.below(12);
  for (std::uint64_t i = 0; i < objects; ++i) {
    index = static_cast<std::uint16_t>(index + 1 + random.below(0x800));
    const std::string name = any_name(random);
    if (random.below(2) == 0) {
      const od::SubSpec spec = any_spec(random, 0, name);
      builder.object(index, spec.type == DataType::domain ? od::ObjectCode::domain : od::ObjectCode::var, name,
                     spec.type, spec.obj_flags);
      add(index, spec);
      continue;
    }
    const bool array = random.below(2) == 0;
    builder.object(index, array ? od::ObjectCode::array : od::ObjectCode::record, name,
                   random.below(2) == 0 ? DataType::unsigned16 : DataType::none,
                   static_cast<std::uint8_t>(random.below(4)));
    std::uint8_t sub = 0;
    const auto subs = 1 + random.below(5);
    add(index,
        {.sub = 0, .name = "n", .type = DataType::unsigned8, .access = Access::ro, .initial = Literal::number(9)});
    for (std::uint64_t k = 0; k < subs; ++k) {
      sub = static_cast<std::uint8_t>(sub + 1 + random.below(40));
      const std::string sub_name = any_name(random);
      add(index, any_spec(random, sub, sub_name));
    }
  }
  // The mandatory ones, so that nothing is told of them.
  builder.variable(0x1000, {.name = "Device type", .access = Access::ro});
  builder.variable(0x1001, {.name = "Error register", .type = DataType::unsigned8, .access = Access::ro});
  builder.object(0x1018, od::ObjectCode::record, "Identity");
  builder.sub(0x1018, {.sub = 1, .name = "Vendor-ID", .access = Access::ro});
  builder.dummies(static_cast<std::uint32_t>(random.next()) & 0xFE);
  file.description = builder.build();
  file.info = {.file_name = "f.eds",
               .file_version = "1",
               .file_revision = "2",
               .eds_version = "4.0",
               .description = any_name(random),
               .creation_time = "01:05PM",
               .creation_date = "12-31-2025",
               .created_by = any_name(random),
               .modification_time = "12:00AM",
               .modification_date = "01-01-2026",
               .modified_by = "m",
               .last_eds = "old.eds"};
  file.device.vendor_name = any_name(random);
  if (random.below(2) == 0) file.device.vendor_number = static_cast<std::uint32_t>(random.next());
  if (random.below(2) == 0) file.device.product_number = static_cast<std::uint32_t>(random.next());
  if (random.below(2) == 0) file.device.revision_number = static_cast<std::uint32_t>(random.next());
  file.device.product_name = any_name(random);
  file.device.order_code = random.below(2) == 0 ? "" : any_name(random);
  file.device.baud_rates = {10, 125, 1000};
  file.device.boot_up_master = random.below(2) == 0;
  file.device.boot_up_slave = random.below(2) == 0;
  file.device.granularity = static_cast<std::uint8_t>(random.below(65));
  file.device.dynamic_channels = random.below(2) == 0;
  file.device.group_messaging = random.below(2) == 0;
  file.device.rpdos = static_cast<std::uint16_t>(random.below(513));
  file.device.tpdos = static_cast<std::uint16_t>(random.below(513));
  file.device.lss = random.below(2) == 0;
  file.device.compact_pdo = static_cast<std::uint8_t>(random.below(256));
  if (random.below(2) == 0) file.comments = {"first line", "<second> & line"};
  if (file.device.dynamic_channels)
    file.dynamic_segments.push_back({DataType::unsigned16, Access::rww, 0xA4C0, 0xA4FF, 0x100});
  if (values) {
    Commissioning given;
    if (random.below(4) != 0) given.node_id = NodeId(static_cast<std::uint8_t>(1 + random.below(127)));
    given.node_name = any_name(random);
    if (random.below(2) == 0) given.baud_rate = static_cast<std::uint16_t>(1 + random.below(1000));
    if (random.below(4) != 0) given.net_number = static_cast<std::uint32_t>(random.below(1000));
    given.network_name = any_name(random);
    given.canopen_manager = random.below(2) == 0;
    if (random.below(2) == 0) given.lss_serial_number = static_cast<std::uint32_t>(random.next());
    given.node_refd = "=A1+B2";
    file.commissioning = given;
  }
  return file;
}

// E5.2
RC_GTEST_PROP(XddWrite, E5_2_AnyDescriptionSurvives, (std::uint64_t seed)) {
  Random random(seed);
  const bool values = random.below(2) == 0;
  const File file = any_file(random, values);
  const auto written = write_xdd(file, {.values = values});
  RC_ASSERT(written.findings.empty());
  const auto r = read_xdd(written.text, "t.xdd");
  if (complaints(r) != "") RC_FAIL(complaints(r));
  if (const auto text = differences(file, r.file); text != "") RC_FAIL(text);
  RC_ASSERT(r.file.info == file.info);
  RC_ASSERT(r.file.device == file.device);
  RC_ASSERT(r.file.commissioning == file.commissioning);
  RC_ASSERT(r.file.comments == file.comments);
  RC_ASSERT(r.file.denotations == file.denotations);
  RC_ASSERT(r.file.dynamic_segments == file.dynamic_segments);
  RC_ASSERT(r.file.parameters.size() == file.parameters.size());
  RC_ASSERT(write_xdd(r.file, {.values = values}).text == written.text);
}

File full_file() {
  Random random(7);
  File file = any_file(random, true);
  od::DescriptionBuilder builder;
  builder.object(0x2000, od::ObjectCode::record, "R", DataType::none);
  builder.sub(
      0x2000,
      {.sub = 0, .name = "n", .type = DataType::unsigned8, .access = Access::ro, .initial = Literal::number(1)});
  builder.sub(
      0x2000,
      {.sub = 1, .name = "input", .type = DataType::unsigned16, .access = Access::rwr, .initial = Literal::number(4)});
  file.description = builder.build();
  file.parameters = {{{0x2000, 1}, DataType::unsigned16, Literal::number(4), 0}};
  file.defaults = {{{0x2000, 1}, DataType::unsigned16, Literal::number(3), 0}};
  file.denotations.clear();
  file.device.order_code = "o";
  file.device.dynamic_channels = true;
  file.dynamic_segments = {{DataType::unsigned16, Access::rww, 0xA4C0, 0xA4FF, 0x100}};
  return file;
}

// Files in the field write hours with one digit, too.
TEST(XddWrite, HoursOfOneDigit) {
  File file = full_file();
  file.info.creation_time = "4:49PM";
  file.info.modification_time = "9:05AM";
  const std::string text = write_xdd(file, {.values = true, .file_name = "drive.xdc"}).text;
  EXPECT_NE(text.find("fileCreationTime=\"16:49:00\""), std::string::npos);
  EXPECT_NE(text.find("fileModificationTime=\"09:05:00\""), std::string::npos);
}

// E5.2: order and attributes as CiA 311 v1.1 has them. (The schema itself is not public; this is what public files and
// tools made from it say.)
TEST(XddWrite, E5_2_ElementsStandInTheSchemasOrder) {
  const std::string text = write_xdd(full_file(), {.values = true, .file_name = "00000147_drive.xdc"}).text;
  EXPECT_TRUE(text.starts_with("<?xml version=\"1.0\" encoding=\"utf-8\"?>"));
  in_order(text, {"<ISO15745ProfileContainer xmlns=\"http://www.canopen.org/xml/1.1\"",
                  "<ISO15745Profile>",
                  "<ProfileHeader",
                  "<ProfileIdentification>",
                  "<ProfileRevision>",
                  "<ProfileName",
                  "<ProfileSource",
                  "<ProfileClassID>Device<",
                  "<ISO15745Reference>",
                  "<ISO15745Part>",
                  "<ISO15745Edition>",
                  "<ProfileTechnology>CANopen<",
                  "<ProfileBody ",
                  "ProfileBody_Device_CANopen",
                  "fileName=\"00000147_drive.xdc\"",
                  "fileCreator=",
                  "fileCreationDate=\"2025-12-31\"",
                  "fileCreationTime=\"13:05:00\"",
                  "fileVersion=",
                  "co:DeviceIdentity>",
                  "co:vendorName>",
                  "co:productName>",
                  "co:productText>",
                  "co:orderNumber>",
                  "/co:DeviceIdentity>",
                  "co:DeviceFunction>",
                  "co:capabilities>",
                  "co:characteristicsList>",
                  "co:ApplicationProcess>",
                  "co:parameterList>",
                  "co:parameter uniqueID=",
                  "access=\"readWriteInput\"",
                  "<label lang=\"en\">input</label>",
                  "<UINT",
                  "</ISO15745Profile>",
                  "<ISO15745Profile>",
                  "<ProfileClassID>CommunicationNetwork<",
                  "ProfileBody_CommunicationNetwork_CANopen",
                  "<ApplicationLayers>",
                  "co:CANopenObjectList>",
                  "<CANopenObject index=\"2000\" name=\"R\" objectType=\"9\" subNumber=\"2\">",
                  "<CANopenSubObject subIndex=\"00\"",
                  "subIndex=\"01\" name=\"input\" objectType=\"7\" dataType=\"0006\"",
                  "defaultValue=\"3\"",
                  "actualValue=\"4\"",
                  "PDOmapping=\"no\"",
                  "uniqueIDRef=",
                  "<dummyUsage>",
                  "<dummy entry=\"Dummy0001=",
                  "<dummy entry=\"Dummy0007=",
                  "</dummyUsage>",
                  "<dynamicChannels>",
                  "<dynamicChannel dataType=\"0006\" accessType=\"readWriteOutput\" startIndex=\"A4C0\" "
                  "endIndex=\"A4FF\" maxNumber=\"16256\" addressOffset=\"00000100\"",
                  "</ApplicationLayers>",
                  "<TransportLayers>",
                  "<PhysicalLayer>",
                  "<baudRate>",
                  "<supportedBaudRate value=\"10 Kbps\"",
                  "<NetworkManagement>",
                  "<CANopenGeneralFeatures ",
                  "granularity=",
                  "nrOfRxPDO=",
                  "nrOfTxPDO=",
                  "<CANopenMasterFeatures ",
                  "<deviceCommissioning nodeID=",
                  "nodeName=",
                  "actualBaudRate=",
                  "networkNumber=",
                  "networkName=",
                  "CANopenManager=",
                  "</ISO15745ProfileContainer>"});
}

TEST(XddWrite, WhatCiA311HasNoPlaceForIsNamed) {
  File file = full_file();
  file.tools = {{"editor", "edit $EDS"}};
  file.object_links = {{0x2000, {0x1000}}};
  file.param_refs = {{{0x2000, 1}, "x"}};
  file.file_references = {{{0x2000, 1}, true, "a.bin", 0}};
  file.modules.resize(1);
  file.connected_modules = {1};
  file.info.creation_date = "yesterday";
  file.dynamic_segments[0].difference = 2;
  const std::string all = all_findings(write_xdd(file, {}).findings);
  for (const char* what : {"[Tools]", "ObjectLinks", "ParamRefd", "DOMAIN", "[SupportedModules]", "[ConnectedModules]",
                           "CreationDate", "ParameterValue", "[DeviceComissioning]", "DynamicChannels"}) {
    EXPECT_NE(all.find(what), std::string::npos) << what << "\n" << all;
  }
  const auto r = read_xdd(write_xdd(file, {}).text, "t.xdd");
  EXPECT_TRUE(r.file.parameters.empty()) << "an XDD is of the type, not of one device";
  EXPECT_FALSE(r.file.commissioning);
  EXPECT_EQ(value(r, 0x2000, 1), 3U) << "and so gives the default, not the value";
  EXPECT_EQ(r.file.info.creation_date, "");
}

TEST(XddWrite, UnitsAndNamesOfValuesGoThereAndBack) {
  od::DescriptionBuilder builder;
  builder.variable(0x2000, {.name = "T", .type = DataType::integer16, .access = Access::rw});
  builder.meaning({0x2000, 0}, {.text = "Of the bearing, <inside>", .unit = "°C", .exponent = -1});
  builder.object(0x2001, od::ObjectCode::record, "R");
  builder.sub(0x2001, {.sub = 1, .name = "Mode", .type = DataType::unsigned8, .access = Access::ro});
  builder.meaning({0x2001, 1}, {.values = {{2, "Auto & \"fast\""}, {0, "Off"}, {7, ""}}, .only_these = true});
  builder.sub(0x2001, {.sub = 2,
                       .name = "Level",
                       .type = DataType::unsigned16,
                       .access = Access::wo,
                       .high = od::Literal::number(100)});
  builder.meaning({0x2001, 2}, {.unit = "l/min", .number = 25, .values = {{65535, "closed"}}});
  builder.variable(0x2002, {.name = "I", .type = DataType::unsigned8, .access = Access::rwr});
  builder.meaning({0x2002, 0}, {.unit = "A"});
  File file;
  file.description = builder.build();
  const auto written = write_xdd(file, {});
  const auto r = read_xdd(written.text, "t.xdd");
  EXPECT_TRUE(r.usable()) << all_findings(r.findings);
  for (const ObjectRef ref : {ObjectRef{0x2000, 0}, ObjectRef{0x2001, 1}, ObjectRef{0x2001, 2}, ObjectRef{0x2002, 0}}) {
    const auto* const before = file.description->meaning(ref);
    const auto* const after = r.file.description->meaning(ref);
    ASSERT_NE(after, nullptr) << ref.index << "\n" << written.text;
    EXPECT_EQ(*after, *before) << ref.index << "\n" << written.text;
    EXPECT_EQ(r.file.description->find(ref)->access, file.description->find(ref)->access) << ref.index;
    EXPECT_EQ(r.file.description->find(ref)->type, file.description->find(ref)->type) << ref.index;
  }
  in_order(written.text,
           {"<co:parameter ", "<label", "<USINT", "<co:allowedValues", "<co:value ", "</co:allowedValues>"});
  // An EDS has no place for them, and says so.
  EXPECT_NE(all_findings(write(file, {}).findings).find("4 objects are left out"), std::string::npos)
      << all_findings(write(file, {}).findings);
  const auto eds = read(write(file, {}).text, "t.eds");
  EXPECT_EQ(eds.file.description->meanings(), 0U);
}

TEST(XddWrite, BytesThatXmlCannotCarryAreNamed) {
  File file = full_file();
  od::DescriptionBuilder builder;
  builder.variable(0x2000, {.name = "bell\a",
                            .type = DataType::visible_string,
                            .initial = Literal::text("a\x01"
                                                     "b")});
  builder.variable(0x2001, {.name = "latin",
                            .type = DataType::visible_string,
                            .initial = Literal::text("gr\xFC\xDF"
                                                     "e")});
  file.description = builder.build();
  file.parameters.clear();
  file.defaults.clear();
  const auto written = write_xdd(file, {});
  const std::string all = all_findings(written.findings);
  EXPECT_NE(all.find("2000:00: XML cannot carry control characters"), std::string::npos) << all;
  EXPECT_NE(all.find("2001:00"), std::string::npos) << all;
  const auto r = read_xdd(written.text, "t.xdd");
  EXPECT_TRUE(r.usable());
  EXPECT_EQ(r.file.description->default_of(*sub(r, 0x2000)), Literal::text("a?b"));
  EXPECT_EQ(r.file.description->default_of(*sub(r, 0x2001)), Literal::text("gr\xC3\xBC\xC3\x9F"
                                                                           "e"));
}

TEST(XddWrite, UnknownSectionsAndCommentsOfAnEdsAreNamed) {
  const auto r = read_text(
      "; by hand\n" + file_with("[2000]\nParameterName=x\nObjectType=7\nDataType=5\nAccessType=rw\n[Vendor]\na=b\n"));
  const std::string all = all_findings(write_xdd(r.file, {}).findings);
  EXPECT_NE(all.find("[Vendor]"), std::string::npos) << all;
  EXPECT_NE(all.find("comment"), std::string::npos) << all;
}

// EDS to XDD to EDS, with everything that people have written.
TEST(XddWrite, E5_2_RealFilesGoThereAndBack) {
  if (!fs::is_directory(eds_folder())) GTEST_SKIP() << "no folder of real device descriptions; set BERTH_EDS_DIR";
  for (const auto& entry : fs::directory_iterator(eds_folder())) {
    const auto extension = entry.path().extension();
    if (extension != ".eds" && extension != ".dcf" && extension != ".xdd") continue;
    SCOPED_TRACE(entry.path().filename().string());
    const auto original = read_any_file(entry.path());
    const bool values = !original.file.parameters.empty() || original.file.commissioning;
    const auto xdd = write_xdd(original.file, {.values = values});
    const auto r = read_xdd(xdd.text, "t.xdd");
    EXPECT_TRUE(r.usable()) << complaints(r);
    EXPECT_EQ(differences(original.file, r.file), "");
    EXPECT_EQ(r.file.device, original.file.device);
    EXPECT_EQ(r.file.commissioning, original.file.commissioning);
    const auto eds = write(r.file, {.form = values ? Form::dcf : Form::eds});
    const auto back = read(eds.text, "t.eds");
    EXPECT_TRUE(back.usable()) << complaints(back);
    EXPECT_EQ(differences(original.file, back.file), "");
  }
}

}  // namespace
