// Writing whole files: what is written is read back as it was, by readers stricter than this one too.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "../paths.hpp"
#include "random_description.hpp"
#include "support.hpp"

namespace write_tests {
namespace {

using namespace berth;
using namespace berth::eds;
using namespace berth::eds::test;
namespace fs = std::filesystem;
using od::DataType;
using od::Literal;

Reading again(const File& file, Form form = Form::eds) {
  auto written = write(file, {.form = form});
  return read(std::move(written.text), "again.eds");
}

/// The DataType of a RECORD, for which an EDS has no place (tests/eds/left_out_test.cpp).
bool is_of_a_record(const Finding& finding) {
  return finding.severity == Severity::note && finding.key.ends_with("DataType");
}

/// Findings that a written file must not have. A random description may lack mandatory objects, have defaults outside
/// of its limits and objects in odd places; a writer has no say in that.
std::string complaints_of_form(const Reading& reading) {
  std::string text;
  for (const auto& each : reading.findings) {
    if (each.severity == Severity::note) continue;
    if (each.message.find("the limits") != std::string::npos || each.message.find("mandatory") != std::string::npos)
      continue;
    text += to_string(each) + "\n";
  }
  return text;
}

RC_GTEST_PROP(EdsWrite, HU_17_AnyDescriptionSurvivesWriteAndRead, (std::uint64_t seed)) {
  Random random(seed);
  File file;
  file.description = random_description(random);
  const auto written = write(file);
  for (const auto& each : written.findings) {
    if (!is_of_a_record(each)) RC_FAIL(to_string(each));
  }
  const auto back = read(written.text, "back.eds");
  if (const auto text = complaints_of_form(back); !text.empty()) RC_FAIL(text + written.text);
  if (const auto text = difference(*file.description, *back.file.description); !text.empty()) {
    RC_FAIL(text + "\n" + written.text);
  }
  // And once more: the text is a fixed point.
  RC_ASSERT(write(back.file).text == written.text);
}

/// Info, commissioning and values with it.
RC_GTEST_PROP(EdsWrite, HU_17_AnyDcfSurvivesWriteAndRead, (std::uint64_t seed)) {
  Random random(seed);
  const auto word = [&random] { return random.chance(200'000) ? std::string() : random_word(random); };
  File file;
  const auto eds = random_description(random);
  file.info = {.file_name = word(),
               .file_version = "3",
               .file_revision = "7",
               .eds_version = "4.0",
               .description = word(),
               .creation_time = "09:30PM",
               .creation_date = "01-31-2024",
               .created_by = word(),
               .modification_time = "12:00AM",
               .modification_date = "02-29-2024",
               .modified_by = word(),
               .last_eds = word()};
  DeviceInfo& device = file.device;
  device.vendor_name = word();
  if (random.chance(500'000)) device.vendor_number = static_cast<std::uint32_t>(random.next());
  device.product_name = word();
  if (random.chance(500'000)) device.product_number = static_cast<std::uint32_t>(random.next());
  if (random.chance(500'000)) device.revision_number = static_cast<std::uint32_t>(random.next());
  device.order_code = word();
  for (const std::uint16_t rate : std::initializer_list<std::uint16_t>{10, 20, 50, 125, 250, 500, 800, 1000}) {
    if (random.chance(500'000)) device.baud_rates.push_back(rate);
  }
  device.boot_up_master = random.chance(500'000);
  device.boot_up_slave = random.chance(500'000);
  device.granularity = static_cast<std::uint8_t>(random.below(65));
  device.dynamic_channels = random.chance(500'000);
  device.group_messaging = random.chance(500'000);
  device.rpdos = static_cast<std::uint16_t>(random.below(513));
  device.tpdos = static_cast<std::uint16_t>(random.below(513));
  device.lss = random.chance(500'000);
  file.commissioning = Commissioning{.node_id = NodeId(static_cast<std::uint8_t>(1 + random.below(127))),
                                     .node_name = word(),
                                     .baud_rate = static_cast<std::uint16_t>(random.below(1001)),
                                     .net_number = static_cast<std::uint32_t>(random.next()),
                                     .network_name = word(),
                                     .canopen_manager = random.chance(500'000),
                                     .lss_serial_number = static_cast<std::uint32_t>(random.next()),
                                     .node_refd = word(),
                                     .net_refd = word()};
  for (auto n = random.below(4); n != 0; --n) file.comments.push_back(word());
  for (auto n = random.below(3); n != 0; --n) file.tools.push_back({word(), word()});
  for (auto n = random.below(3); n != 0; --n) {
    file.dynamic_segments.push_back(
        {DataType::boolean, od::Access::rww, 0xA500, static_cast<std::uint16_t>(0xA500 + random.below(64)),
         static_cast<std::uint32_t>(random.below(1000)), static_cast<std::uint32_t>(1 + random.below(8))});
  }
  // Values of the DCF: its description has them as initial values, `defaults` what the device has by itself.
  od::DescriptionBuilder builder;
  std::uint32_t dummies = 0;
  for (std::uint16_t i = 1; i < 8; ++i) dummies |= eds->dummy_mappable(i) ? 1U << i : 0U;
  builder.dummies(dummies);
  std::string name;
  for (const od::Object& object : eds->objects()) {
    builder.object(object.index, object.code, eds->name(object), object.type, object.obj_flags);
    if (random.chance(100'000)) file.object_links.push_back({object.index, {0x1000, object.index}});
    for (const od::SubObject& sub : eds->subs(object)) {
      const ObjectRef ref{object.index, sub.sub};
      Literal initial = eds->default_of(sub);
      if (random.chance(300'000)) {
        const Literal value = random_value(random, sub.type);
        if (initial.present()) file.defaults.push_back({ref, sub.type, initial});
        file.parameters.push_back({ref, sub.type, value});
        initial = value;
      }
      if (random.chance(100'000)) file.denotations.push_back({ref, random_word(random)});
      if (random.chance(100'000)) file.param_refs.push_back({ref, random_word(random)});
      if (random.chance(100'000)) file.file_references.push_back({ref, true, "a.bin"});
      builder.sub(object.index, {.sub = sub.sub,
                                 .name = eds->name(sub),
                                 .type = sub.type,
                                 .access = sub.access,
                                 .mappable = sub.mappable,
                                 .initial = initial,
                                 .obj_flags = sub.obj_flags});
    }
  }
  file.description = builder.build();
  const auto written = write(file, {.form = Form::dcf, .line_end = random.chance(500'000) ? "\n" : "\r\n"});
  for (const auto& each : written.findings) {
    if (!is_of_a_record(each)) RC_FAIL(to_string(each));
  }
  const auto back = read(written.text, "back.dcf");
  if (const auto text = complaints_of_form(back); !text.empty()) RC_FAIL(text + written.text);
  const File& got = back.file;
  RC_ASSERT(got.info == file.info);
  RC_ASSERT(got.device == file.device);
  RC_ASSERT(got.commissioning == file.commissioning);
  RC_ASSERT(got.comments == file.comments);
  RC_ASSERT(got.tools == file.tools);
  RC_ASSERT(got.dynamic_segments == file.dynamic_segments);
  RC_ASSERT(got.object_links == file.object_links);
  RC_ASSERT(got.denotations == file.denotations);
  RC_ASSERT(got.param_refs == file.param_refs);
  RC_ASSERT(got.file_references.size() == file.file_references.size());
  for (const auto& [a, b] : {std::pair(&got.parameters, &file.parameters), std::pair(&got.defaults, &file.defaults)}) {
    if (a->size() != b->size()) RC_FAIL(written.text);
    for (std::size_t i = 0; i < a->size(); ++i) {
      RC_ASSERT((*a)[i].object == (*b)[i].object);
      RC_ASSERT((*a)[i].type == (*b)[i].type);
      RC_ASSERT((*a)[i].value == (*b)[i].value);
    }
  }
  if (const auto text = difference(*file.description, *got.description); !text.empty()) RC_FAIL(text + written.text);
}

/// A reader as strict as those that fail on real files (docs/hard-cases.md §4): sections and keys as CiA 306 spells
/// them, no duplicates, every mandatory key, lists without holes that name every object.
struct StrictReader {
  std::map<std::string, std::map<std::string, std::string>> sections;
  std::string wrong;

  explicit StrictReader(const std::string& text) {
    std::istringstream in(text);
    std::string section;
    for (std::string line; std::getline(in, line);) {
      if (!line.ends_with('\r')) fail("line end: " + line);
      line.pop_back();
      if (line.empty()) continue;
      if (line.size() > 255) fail("long line " + line);
      if (line.front() == '[') {
        section = line.substr(1, line.size() - 2);
        if (!sections.try_emplace(section).second) fail("section twice " + section);
        continue;
      }
      const auto equals = line.find('=');
      if (equals == std::string::npos || section.empty()) fail("no key " + line);
      if (!sections[section].emplace(line.substr(0, equals), line.substr(equals + 1)).second) fail("key twice " + line);
    }
    need("FileInfo", {"FileName", "FileVersion", "FileRevision", "EDSVersion", "Description", "CreationTime",
                      "CreationDate", "CreatedBy", "ModificationTime", "ModificationDate", "ModifiedBy"});
    // A key whose number is not known is absent: an empty one is no number to python-canopen.
    for (const char* number : {"VendorNumber", "ProductNumber", "RevisionNumber"}) {
      const auto found = sections["DeviceInfo"].find(number);
      if (found != sections["DeviceInfo"].end() && found->second.empty()) fail(std::string(number) + " is empty");
    }
    for (const char* number : {"NodeID", "Baudrate", "NetNumber"}) {
      const auto commissioning = sections.find("DeviceComissioning");
      if (commissioning == sections.end()) break;
      const auto found = commissioning->second.find(number);
      if (found != commissioning->second.end() && found->second.empty()) fail(std::string(number) + " is empty");
    }
    need("DeviceInfo",
         {"VendorName", "ProductName", "OrderCode", "BaudRate_10", "BaudRate_20", "BaudRate_50", "BaudRate_125",
          "BaudRate_250", "BaudRate_500", "BaudRate_800", "BaudRate_1000", "SimpleBootUpMaster", "SimpleBootUpSlave",
          "Granularity", "DynamicChannelsSupported", "GroupMessaging", "NrOfRXPDO", "NrOfTXPDO", "LSS_Supported"});
    need("DummyUsage", {"Dummy0001", "Dummy0002", "Dummy0003", "Dummy0004", "Dummy0005", "Dummy0006", "Dummy0007"});
    need("Comments", {"Lines"});
    std::set<std::string> listed;
    for (const char* list : {"MandatoryObjects", "OptionalObjects", "ManufacturerObjects"}) {
      need(list, {"SupportedObjects"});
      const auto& keys = sections[list];
      const auto count = std::stoul(keys.at("SupportedObjects"));
      if (keys.size() != count + 1) fail(std::string("count of ") + list);
      unsigned long before = 0;
      for (unsigned long i = 1; i <= count; ++i) {
        const auto found = keys.find(std::to_string(i));
        if (found == keys.end()) {
          fail(std::string("hole in ") + list);
          return;
        }
        const auto index = std::stoul(found->second, nullptr, 16);
        if (index <= before) fail(std::string("order of ") + list);
        before = index;
        listed.insert(found->second.substr(2));
      }
    }
    for (const auto& name : listed) object(name);
  }

  void fail(const std::string& what) {
    if (wrong.empty()) wrong = what;
  }
  void need(const std::string& section, const std::vector<std::string>& keys) {
    const auto found = sections.find(section);
    if (found == sections.end()) return fail("no [" + section + "]");
    for (const auto& key : keys) {
      if (!found->second.contains(key)) fail("[" + section + "] has no " + key);
    }
  }
  void object(const std::string& name) {
    need(name, {"ParameterName", "ObjectType"});
    if (!wrong.empty()) return;
    const auto& keys = sections[name];
    const auto code = std::stoul(keys.at("ObjectType"), nullptr, 16);
    if (code != 8 && code != 9 && code != 6) return value(name);
    need(name, {"SubNumber"});
    for (const char* key : {"AccessType", "PDOMapping", "DefaultValue", "LowLimit", "HighLimit", "ParameterValue"}) {
      if (keys.contains(key)) fail("[" + name + "] " + key);
    }
    std::size_t subs = 0;
    for (const auto& [section, lines] : sections) {
      if (!section.starts_with(name + "sub")) continue;
      value(section);
      if (section != name + "subFF") ++subs;
    }
    if (subs != std::stoul(keys.at("SubNumber"))) fail("SubNumber of " + name);
    if (!sections.contains(name + "sub0")) fail("no sub-index 0: " + name);
  }
  void value(const std::string& name) {
    need(name, {"ParameterName", "DataType", "AccessType"});
    if (!wrong.empty()) return;
    const auto& keys = sections[name];
    const auto code = std::stoul(keys.at("ObjectType"), nullptr, 16);
    if (code != 2) need(name, {"PDOMapping"});
    static const std::set<std::string> access{"ro", "wo", "rw", "rwr", "rww", "const"};
    if (!access.contains(keys.at("AccessType"))) fail("AccessType of " + name);
  }
};

RC_GTEST_PROP(EdsWrite, E2_2_WhatIsWrittenIsReadByStrictReaders, (std::uint64_t seed)) {
  Random random(seed);
  File file;
  file.description = random_description(random);
  const StrictReader strict(write(file).text);
  if (!strict.wrong.empty()) RC_FAIL(strict.wrong);
}

TEST(EdsWrite, E1_1_NumbersFormulasAndLineEnds) {
  EXPECT_EQ(text_of(Literal::number(0x185), DataType::unsigned32, true), "0x00000185");
  EXPECT_EQ(text_of(Literal::number(0x185), DataType::unsigned32, false), "389");
  EXPECT_EQ(text_of(Literal::node_id_plus(0x180), DataType::unsigned32, true), "$NODEID+0x180");
  EXPECT_EQ(text_of(Literal::node_id_plus(0), DataType::unsigned8, false), "$NODEID");
  EXPECT_EQ(text_of(Literal::node_id_plus(static_cast<std::uint64_t>(-5)), DataType::integer16, false), "$NODEID-0x5");
  EXPECT_EQ(text_of(Literal::number(static_cast<std::uint64_t>(-1)), DataType::integer16, true), "0xFFFF");
  EXPECT_EQ(text_of(Literal::number(static_cast<std::uint64_t>(-1)), DataType::integer16, false), "-1");
  EXPECT_EQ(text_of(Literal::number(~0ULL), DataType::unsigned64, true), "0xFFFFFFFFFFFFFFFF");
  EXPECT_EQ(text_of(Literal::octets(std::vector<std::uint8_t>{0xAB, 1}), DataType::octet_string, true), "AB01");
  EXPECT_TRUE(usually_hex({0x1801, 1}, DataType::unsigned32));
  EXPECT_FALSE(usually_hex({0x1801, 5}, DataType::unsigned16));
  const auto file = read_variable(7, "DefaultValue=1").file;
  const std::string lf = write(file, {.line_end = "\n"}).text;
  EXPECT_EQ(lf.find('\r'), std::string::npos);
  const std::string crlf = write(file).text;
  EXPECT_EQ(std::ranges::count(crlf, '\n'), std::ranges::count(crlf, '\r'));
  EXPECT_NE(lf.find("EDSVersion=4.0\n"), std::string::npos);
}

TEST(EdsWrite, HU_7_LssFlagsAndNodeIdSurvive) {
  std::string text = file_with(variable(7, "DefaultValue=$NODEID+0x180\nLowLimit=$NODEID+1"));
  text.replace(text.find("VendorName=v"), 12, "VendorName=v\nLSS_Supported=1");
  const auto written = write(read_text(text).file);
  EXPECT_TRUE(written.findings.empty());
  EXPECT_NE(written.text.find("LSS_Supported=1\r\n"), std::string::npos);
  EXPECT_NE(written.text.find("DefaultValue=$NODEID+0x180\r\n"), std::string::npos);
  EXPECT_NE(written.text.find("LowLimit=$NODEID+0x1\r\n"), std::string::npos);
  const auto back = read_text(written.text);
  EXPECT_TRUE(back.file.device.lss);
  EXPECT_EQ(value(back, 0x2000, 0, 9), 0x189U);
  const Document& document = back.file.document;
  Editor editor(document);
  ASSERT_TRUE(editor.set("2000", "ParameterName", "other"));
  const auto edited = read_text(editor.text());
  EXPECT_TRUE(edited.file.device.lss);
  EXPECT_TRUE(sub(edited, 0x2000)->relative);
}

// HU.17: limits are enforced by a device of a file that was written.
TEST(EdsWrite, HU_17_LimitsOfAWrittenFileAreEnforced) {
  const auto back = again(read_variable(4, "LowLimit=-10\nHighLimit=0x0A").file);
  od::Values device(back.file.description, NodeId(1));
  EXPECT_EQ(device.write({0x2000, 0}, std::vector<std::uint8_t>{0xF5, 0xFF, 0xFF, 0xFF}), od::AbortCode::value_too_low);
  EXPECT_EQ(device.write({0x2000, 0}, std::vector<std::uint8_t>{11, 0, 0, 0}), od::AbortCode::value_too_high);
  EXPECT_EQ(device.write({0x2000, 0}, std::vector<std::uint8_t>{10, 0, 0, 0}), od::AbortCode::none);
}

TEST(EdsWrite, ASubIndex0ThatIsABooleanIsNoCount) {
  od::DescriptionBuilder builder;
  builder.object(0x2000, od::ObjectCode::record, "odd")
      .sub(0x2000, {.sub = 0, .name = "n", .type = DataType::boolean, .access = od::Access::ro})
      .sub(0x2000, {.sub = 4, .name = "x"});
  File file;
  file.description = builder.build();
  const auto back = again(file);
  EXPECT_TRUE(back.usable()) << complaints(back);
  EXPECT_EQ(difference(*file.description, *back.file.description), "");
  EXPECT_EQ(od::Values(back.file.description).bytes({0x2000, 0})[0], 0);
}

TEST(EdsWrite, E1_1_LinesBeyond255CharactersAreTold) {
  od::DescriptionBuilder builder;
  builder.variable(
      0x2000,
      {.name = "d", .type = DataType::octet_string, .initial = Literal::octets(std::vector<std::uint8_t>(121))});
  builder.variable(
      0x2001,
      {.name = "d", .type = DataType::octet_string, .initial = Literal::octets(std::vector<std::uint8_t>(122))});
  File file;
  file.description = builder.build();
  const auto written = write(file);
  ASSERT_EQ(written.findings.size(), 1U) << "DefaultValue= and 242 digits are 255 characters, two more are not";
  EXPECT_EQ(written.findings[0].severity, Severity::note);
  EXPECT_EQ(written.findings[0].key, "[2001] DefaultValue");
  EXPECT_EQ(difference(*file.description, *read_text(written.text).file.description), "");
}

TEST(EdsWrite, WhatAFileCannotCarryIsTold) {
  od::DescriptionBuilder builder;
  builder.variable(0x2000, {.name = "a ;b", .type = DataType::visible_string, .initial = Literal::text(" x\ny ")});
  builder.variable(0x2001, {.name = "", .type = DataType::unsigned8});
  builder.variable(
      0x2002,
      {.name = "u", .type = DataType::unicode_string, .initial = Literal::octets(std::vector<std::uint8_t>{1, 2, 3})});
  File file;
  file.description = builder.build();
  const auto written = write(file);
  const auto told = [&](std::string_view key) {
    return std::ranges::any_of(written.findings, [key](const Finding& each) { return each.key == key; });
  };
  EXPECT_TRUE(told("[2000] ParameterName"));
  EXPECT_TRUE(told("[2000] DefaultValue"));
  EXPECT_TRUE(told("[2001] ParameterName"));
  EXPECT_TRUE(told("[2002] DefaultValue"));
  EXPECT_EQ(written.findings.size(), 4U);
  const auto back = read_text(written.text);
  EXPECT_TRUE(back.usable());
  EXPECT_EQ(name(back, 0x2000), "a ,b");
}

// HU.10: the bytes of a VISIBLE_STRING are the device's, not the editor's.
TEST(EdsWrite, HU_10_BytesOfAStringStayWhateverTheFilesEncoding) {
  for (const char* bytes : {"gr\xFC\xDF", "gr\xC3\xBC\xC3\x9F"}) {
    od::DescriptionBuilder builder;
    builder.variable(0x2000, {.name = "gr\xC3\xB6\xC3\x9F"
                                      "er",
                              .type = DataType::visible_string,
                              .initial = Literal::text(bytes)});
    File file;
    file.description = builder.build();
    const auto written = write(file);
    EXPECT_TRUE(written.findings.empty());
    const auto back = read(written.text, "t");
    EXPECT_EQ(difference(*file.description, *back.file.description), "");
  }
}

// A DataType beside ObjectType is for CompactSubObj only: the npm package canopen refuses a file with another.
TEST(EdsWrite, E2_2_AnArrayHasItsDataTypeInItsSubObjects) {
  od::DescriptionBuilder builder;
  builder.object(0x2000, od::ObjectCode::array, "words", DataType::unsigned16);
  builder.sub(0x2000, {.sub = 1, .name = "word", .type = DataType::unsigned16});
  File file;
  file.description = builder.build();
  const auto text = write(file).text;
  const auto begin = text.find("[2000]");
  const auto section = text.substr(begin, text.find("[2000sub0]") - begin);
  EXPECT_EQ(section.find("DataType"), std::string::npos) << section;
  EXPECT_EQ(read(text, "t").file.description->find(ObjectRef{0x2000, 1})->type, DataType::unsigned16);
}

/// Every real file: unchanged by the editor byte for byte, and equal after being written anew.
TEST(EdsWrite, HU_17_RealFilesLoseNothing) {
  unsigned files = 0;
  for (const fs::path& from : {eds_folder(), fs::path(berth::test::source_dir()) / "examples" / "eds"}) {
    if (!fs::is_directory(from)) continue;
    for (const auto& entry : fs::directory_iterator(from)) {
      if (entry.path().extension() != ".eds" && entry.path().extension() != ".dcf") continue;
      SCOPED_TRACE(entry.path().filename().string());
      ++files;
      const auto r = read_file(entry.path());
      std::ifstream in(entry.path(), std::ios::binary);
      const std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
      EXPECT_EQ(Editor(r.file.document).text(), text);
      const auto written = write(r.file, {.form = Form::dcf});
      for (const auto& each : written.findings) {
        if (!is_of_a_record(each)) ADD_FAILURE() << to_string(each);
      }
      const auto back = read(written.text, "back");
      EXPECT_TRUE(back.usable()) << complaints(back);
      EXPECT_EQ(difference(*r.file.description, *back.file.description), "");
      EXPECT_EQ(back.file.device, r.file.device);
      EXPECT_EQ(back.file.commissioning, r.file.commissioning);
      EXPECT_EQ(back.file.comments, r.file.comments);
      EXPECT_EQ(back.file.parameters.size(), r.file.parameters.size());
      EXPECT_EQ(back.file.defaults.size(), r.file.defaults.size());
      const StrictReader strict(write(r.file).text);
      EXPECT_EQ(strict.wrong, "");
    }
  }
  EXPECT_GE(files, 3U) << "at least our own examples";
}

}  // namespace
}  // namespace write_tests
