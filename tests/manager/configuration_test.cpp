// What a configuration file says, and when its date changes.
#include "berth/manager/configuration.hpp"

#include <gtest/gtest.h>
#include <unistd.h>
#include <algorithm>
#include <cstdint>
#include <string>

#include <fstream>
#include <sstream>

#include "../paths.hpp"
#include "berth/eds/xdd.hpp"
#include "tests/manager/fake_device.hpp"

using namespace berth;
using namespace berth::manager;
using namespace berth::manager::test;

namespace {

class Folder {
 public:
  Folder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "berth-manager-XXXXXX").string();
    path_ = ::mkdtemp(pattern.data());
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] std::string put(const std::string& name, const std::string& content) const {
    const auto path = (path_ / name).string();
    std::ofstream(path, std::ios::binary) << content;
    return path;
  }

 private:
  std::filesystem::path path_;
};

std::string pump_dcf() {
  std::ifstream in(berth::test::source_dir() + "/examples/eds/pump.dcf");
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

std::string with(std::string text, const std::string& what, const std::string& by) {
  const auto at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return at == std::string::npos ? text : text.replace(at, what.size(), by);
}

const Setting* find(const Configuration& c, ObjectRef object) {
  for (const auto& s : c.settings) {
    if (s.object == object) return &s;
  }
  return nullptr;
}

const Entry* find(const Wanted& w, ObjectRef object) {
  for (const auto& e : w.entries) {
    if (e.object == object) return &e;
  }
  return nullptr;
}

Wanted wanted_at(const LoadedConfiguration& loaded, unsigned node) {
  auto w = wanted(loaded.configuration, NodeId(static_cast<std::uint8_t>(node)));
  EXPECT_TRUE(w) << describe(w.error());
  return w ? *w : Wanted{};
}

unsigned line_of(const std::string& text, const std::string& what) {
  const auto at = text.find(what);
  return static_cast<unsigned>(1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
}

}  // namespace

// E3.1: ParameterValue, with its line, its name and $NODEID.
TEST(ConfigurationFile, E3_1_TheParameterValuesOfADcf) {
  const Folder folder;
  const auto text = pump_dcf();
  const auto loaded = load_configuration(folder.put("pump.dcf", text));
  ASSERT_TRUE(loaded.usable());
  const auto& c = loaded.configuration;
  EXPECT_EQ(c.type, (TypeCode{1, 0x30}));
  ASSERT_NE(find(c, {0x2000, 1}), nullptr);
  EXPECT_EQ(find(c, {0x2000, 1})->name, "Limits: Upper pressure limit");
  EXPECT_EQ(find(c, {0x2000, 1})->line, line_of(text, "ParameterValue=500"));
  EXPECT_EQ(find(c, {0x2001, 0})->name, "Label");
  EXPECT_EQ(find(c, {0x1008, 0}), nullptr) << "a default is not set by the file";
  for (const unsigned node : {1U, 5U, 127U}) {
    const auto w = wanted_at(loaded, node);
    EXPECT_EQ(find(w, {0x1800, 1})->bytes, u32(0x280 + node));
    EXPECT_EQ(find(w, {0x2000, 1})->bytes, u16(500));
    EXPECT_EQ(find(w, {0x2001, 0})->bytes, (Bytes{'c', 'o', 'o', 'l', 'i', 'n', 'g', ' ', 'w', 'a', 't', 'e', 'r'}));
  }
}

// A changed value, node-ID or own value is another date; a comment is not. The days are the file's modification date:
// 2025-03-02 is day 15036 since 1984-01-01 (41 years with 11 leap days, and 60 days).
TEST(ConfigurationFile, AChangedFileIsAChangedDate) {
  const Folder folder;
  const auto base = wanted_at(load_configuration(folder.put("a.dcf", pump_dcf())), 5);
  EXPECT_EQ(base.date.days, 41U * 365 + 11 + 31 + 28 + 1);
  EXPECT_TRUE(base.date.valid());
  EXPECT_LT(base.date.ms, 86'400'000U);
  const auto same = wanted_at(load_configuration(folder.put("b.dcf", "; a comment\n" + pump_dcf())), 5);
  EXPECT_EQ(same.date, base.date);
  const auto other = with(pump_dcf(), "ParameterValue=500", "ParameterValue=501");
  EXPECT_NE(wanted_at(load_configuration(folder.put("c.dcf", other)), 5).date, base.date);
  const auto loaded = load_configuration(folder.put("d.dcf", pump_dcf()));
  EXPECT_NE(wanted_at(loaded, 6).date, base.date);
  const Entry heartbeat = entry({0x1017, 0}, u16(100));
  const auto own = wanted(loaded.configuration, NodeId(5), std::span<const Entry>(&heartbeat, 1));
  ASSERT_TRUE(own);
  EXPECT_NE(own->date, base.date);
  EXPECT_TRUE(find(*own, {0x1017, 0})->own);
  const auto undated = with(with(pump_dcf(), "ModificationDate=03-02-2025", "ModificationDate="),
                            "CreationDate=01-15-2025", "CreationDate=99-99-9999");
  const auto hashed = wanted_at(load_configuration(folder.put("e.dcf", undated)), 5);
  EXPECT_TRUE(hashed.date.valid());
  EXPECT_EQ(hashed.date.ms, base.date.ms);
}

// S5.18: the configuration tool wrote date and time of 1020h itself.
TEST(ConfigurationFile, S5_18_TheFilesOwnDateIsTaken) {
  const Folder folder;
  auto text = with(pump_dcf(), "ParameterName=Configuration date\n",
                   "ParameterName=Configuration date\nParameterValue=15000\n");
  text = with(text, "ParameterName=Configuration time\n", "ParameterName=Configuration time\nParameterValue=77\n");
  const auto w = wanted_at(load_configuration(folder.put("a.dcf", text)), 5);
  EXPECT_EQ(w.date, (ConfigurationDate{15'000, 77}));
  EXPECT_EQ(find(w, {0x1020, 1}), nullptr) << "it is written last, not among the values";
}

// What links need goes over what a file says, and the file's own date no longer tells that all of it is there.
TEST(ConfigurationFile, TwoAreJoined) {
  Configuration base;
  base.file = "pump.dcf";
  base.date = {15'000, 7};
  base.type = {1, 0x30};
  base.settings = {{{0x1400, 1}, od::DataType::unsigned32, od::Literal::number(0x181), "a", 12},
                   {{0x2000, 0}, od::DataType::unsigned8, od::Literal::number(3), "b", 20}};
  Configuration over;
  over.settings = {{{0x1400, 1}, od::DataType::unsigned32, od::Literal::number(0x182), "c", 99},
                   {{0x1800, 1}, od::DataType::unsigned32, od::Literal::node_id_plus(0x180), "d", 98}};
  const Configuration all = joined(base, over);
  ASSERT_EQ(all.settings.size(), 3U);
  EXPECT_EQ(all.settings[0].value.raw, 0x182U);
  EXPECT_EQ(all.settings[0].line, 0U) << "the line would be one of pump.dcf";
  EXPECT_EQ(all.settings[1].object, (ObjectRef{0x1800, 1})) << "ascending";
  EXPECT_EQ(all.settings[2].line, 20U);
  EXPECT_EQ(all.file, "pump.dcf");
  EXPECT_EQ(all.type, base.type);
  EXPECT_FALSE(all.date.valid());
  const auto first = wanted(all, NodeId(5));
  over.settings[1].value = od::Literal::node_id_plus(0x280);
  const auto second = wanted(joined(base, over), NodeId(5));
  ASSERT_TRUE(first && second);
  EXPECT_NE(first->date.ms, second->date.ms) << "another link is another date";
}

TEST(ConfigurationFile, WhatIsNoConfigurationIsLeftOut) {
  const Folder folder;
  auto text = with(pump_dcf(), "ParameterName=Error register\n", "ParameterName=Error register\nParameterValue=1\n");
  text = with(text, "ParameterName=Save all parameters\n", "ParameterName=Save all parameters\nParameterValue=1\n");
  text = with(text, "ParameterName=Inlet\n", "ParameterName=Inlet\nParameterValue=17\n");
  text = with(text, "ParameterName=Serial number\n", "ParameterName=Serial number\nParameterValue=17\n");
  text = with(text, "ParameterName=Device type\n", "ParameterName=Device type\nParameterValue=0\n");
  text = with(text, "ParameterName=Label\n", "ParameterName=Label\nObjFlags=1\n");
  const auto loaded = load_configuration(folder.put("a.dcf", text));
  ASSERT_TRUE(loaded.usable());
  const auto& c = loaded.configuration;
  EXPECT_EQ(find(c, {0x1001, 0}), nullptr);
  EXPECT_EQ(find(c, {0x1010, 1}), nullptr);
  EXPECT_EQ(find(c, {0x2100, 1}), nullptr) << "a measured value";
  EXPECT_EQ(find(c, {0x1018, 4}), nullptr) << "the serial number is the device's";
  ASSERT_NE(find(c, {0x1000, 0}), nullptr);
  EXPECT_TRUE(find(c, {0x1000, 0})->compare_only);
  EXPECT_TRUE(find(c, {0x2001, 0})->compare_only) << "ObjFlags bit 0: refuse write on download";
  EXPECT_FALSE(find(c, {0x2000, 1})->compare_only);
}

// What an interrupted configuration has switched off is switched on again, though the file sets no COB-ID.
TEST(ConfigurationFile, APdoWithoutACobIdGetsTheDefaultOne) {
  const Folder folder;
  const auto text = with(pump_dcf(), "ParameterValue=$NODEID+0x280\n", "");
  const auto w = wanted_at(load_configuration(folder.put("a.dcf", text)), 5);
  ASSERT_NE(find(w, {0x1800, 1}), nullptr);
  EXPECT_EQ(find(w, {0x1800, 1})->bytes, u32(0x185));
}

TEST(ConfigurationFile, MappingEntriesBeyondTheirNumberAreLeftOut) {
  Configuration c;
  const auto put = [&](ObjectRef object, Bytes bytes) {
    Setting s;
    s.object = object;
    s.value = od::Literal::octets(bytes);
    c.settings.push_back(s);
  };
  put({0x1A00, 0}, u8(1));
  put({0x1A00, 1}, u32(0x21000110));
  put({0x1A00, 2}, u32(0x21000210));
  put({0x1A01, 0}, u8(0xFE));  // a source address mode MPDO
  put({0x1A01, 1}, u32(0x21000110));
  const auto w = wanted(c, NodeId(5));
  ASSERT_TRUE(w);
  EXPECT_EQ(find(*w, {0x1A00, 2}), nullptr);
  EXPECT_NE(find(*w, {0x1A01, 1}), nullptr);
}

// E3.3: a concise DCF; the last of two downloads of one object is what it ends with.
TEST(ConfigurationFile, E3_3_AConciseDcf) {
  const Folder folder;
  const auto item = [](unsigned index, unsigned sub, const Bytes& data) {
    std::string s;
    s += static_cast<char>(index & 0xFFU);
    s += static_cast<char>(index >> 8U);
    s += static_cast<char>(sub);
    s += static_cast<char>(data.size());
    s += std::string(3, '\0');
    s.append(data.begin(), data.end());
    return s;
  };
  std::string stream{'\5', '\0', '\0', '\0'};
  stream += item(0x1800, 1, u32(0x8000'0185));
  stream += item(0x2000, 1, u16(500));
  stream += item(0x1800, 1, u32(0x185));
  stream += item(0x1020, 1, u32(15'000));
  stream += item(0x1020, 2, u32(9));
  const auto loaded = load_configuration(folder.put("pump.cdcf", stream));
  ASSERT_TRUE(loaded.usable());
  const auto w = wanted_at(loaded, 5);
  EXPECT_EQ(w.entries.size(), 2U);
  EXPECT_EQ(find(w, {0x1800, 1})->bytes, u32(0x185));
  EXPECT_EQ(w.date, (ConfigurationDate{15'000, 9}));
  const auto cut = load_configuration(folder.put("cut.cdcf", stream.substr(0, 12)));
  EXPECT_FALSE(cut.usable());
}

// E5.1: the same configuration as an XDC wants the same of the device.
TEST(ConfigurationFile, E5_1_AnXdcWantsWhatItsDcfWants) {
  const Folder folder;
  const auto reading = eds::read(pump_dcf(), "pump.dcf");
  const auto written = eds::write_xdd(reading.file, {.values = true});
  const auto dcf = wanted_at(load_configuration(folder.put("pump.dcf", pump_dcf())), 5);
  const auto loaded = load_configuration(folder.put("pump.xdc", written.text));
  ASSERT_TRUE(loaded.usable()) << (loaded.findings.empty() ? "" : to_string(loaded.findings.front()));
  const auto xdc = wanted_at(loaded, 5);
  ASSERT_EQ(xdc.entries.size(), dcf.entries.size());
  for (std::size_t i = 0; i < dcf.entries.size(); ++i) {
    EXPECT_EQ(xdc.entries[i].object, dcf.entries[i].object);
    EXPECT_EQ(xdc.entries[i].bytes, dcf.entries[i].bytes) << dcf.entries[i].name;
  }
  EXPECT_EQ(xdc.date, dcf.date);
}

TEST(ConfigurationFile, WhatCannotBeUsedIsSaid) {
  const Folder folder;
  for (const auto& path : {std::string("/nowhere/a.dcf"), std::string("/nowhere/a.cdcf"), folder.put("empty.dcf", ""),
                           folder.put("empty.cdcf", ""), folder.put("b.dcf", "no description\n"), std::string("/tmp"),
                           folder.put("zero.cdcf", std::string(4, '\0'))}) {
    const auto loaded = load_configuration(path);
    EXPECT_FALSE(loaded.usable()) << path;
    for (const auto& f : loaded.findings) EXPECT_NE(to_string(f).find(path), std::string::npos) << to_string(f);
  }
}

// DownloadFile of a DOMAIN, and one that is not there.
TEST(ConfigurationFile, E3_1_ADownloadFileStandsBesideTheDcf) {
  const Folder folder;
  auto text =
      with(pump_dcf(), "DataType=0x0009\nAccessType=rw\n", "DataType=0x000F\nAccessType=rw\nDownloadFile=curve.bin\n");
  text = with(text, "DefaultValue=pump\n", "");
  text = with(text, "ParameterValue=cooling water\n", "");
  const auto path = folder.put("a.dcf", text);
  EXPECT_FALSE(load_configuration(path).usable());
  (void)folder.put("curve.bin", std::string("\1\0\2", 3));
  const auto loaded = load_configuration(path);
  ASSERT_TRUE(loaded.usable()) << (loaded.findings.empty() ? "" : to_string(loaded.findings.front()));
  EXPECT_EQ(find(wanted_at(loaded, 5), {0x2001, 0})->bytes, (Bytes{1, 0, 2}));
}
