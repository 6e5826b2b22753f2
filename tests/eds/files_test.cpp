// Files of real projects, our own examples, and properties of the reader on any text.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "../paths.hpp"
#include "berth/base/random.hpp"
#include "support.hpp"

namespace {

using namespace berth;
using namespace berth::eds;
using namespace berth::eds::test;
namespace fs = std::filesystem;

std::string text_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

/// Lines of a file whose lower-case, comment-free text begins with a word; independent of the reader.
struct Grep {
  std::set<std::string> objects;
  std::map<std::string, unsigned> compact;
  std::set<std::string> subs;
  std::set<std::string> listed;
  unsigned promised = 0;

  explicit Grep(const std::string& text) {
    std::istringstream in(text);
    std::string section;
    for (std::string line; std::getline(in, line);) {
      while (!line.empty() && std::isspace(static_cast<unsigned char>(line.back())) != 0) line.pop_back();
      std::ranges::transform(line, line.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
      if (line.starts_with("[") && line.ends_with("]")) {
        section = line.substr(1, line.size() - 2);
        const auto hex = section.substr(0, 4).find_first_not_of("0123456789abcdef") == std::string::npos;
        if (hex && section.size() == 4) objects.insert(section);
        if (hex && section.substr(4).starts_with("sub")) subs.insert(section);
      } else if (line.starts_with("compactsubobj=")) {
        const auto n = std::stoul(line.substr(14), nullptr, 0);
        if (n != 0) compact[section] = static_cast<unsigned>(n);
      } else if (section.ends_with("objects") && line.starts_with("supportedobjects=")) {
        promised += static_cast<unsigned>(std::stoul(line.substr(17), nullptr, 0));
      } else if (section.ends_with("objects") && line.find("=0x") != std::string::npos) {
        listed.insert(line.substr(line.find("=0x") + 3));
      }
    }
  }
};

struct Expected {
  const char* file;
  unsigned objects;   // grep -ciE '^\[[0-9a-f]{4}\]' FILE
  unsigned promised;  // sum of the SupportedObjects= lines
};

TEST(EdsFiles, EveryRealFileIsReadWhole) {
  if (!fs::is_directory(eds_folder())) {
    GTEST_SKIP() << "no folder of real device descriptions (" << eds_folder() << "); set BERTH_EDS_DIR";
  }
  unsigned files = 0;
  for (const auto& entry : fs::directory_iterator(eds_folder())) {
    const auto extension = entry.path().extension();
    if (extension != ".eds" && extension != ".dcf") continue;
    ++files;
    SCOPED_TRACE(entry.path().filename().string());
    const Reading r = read_file(entry.path());
    EXPECT_TRUE(r.usable()) << complaints(r);
    const Grep grep(text_of(entry.path()));
    const auto& d = *r.file.description;
    EXPECT_EQ(d.objects().size(), grep.objects.size());
    std::size_t subs = grep.subs.size();
    for (const auto& [object, count] : grep.compact) {
      for (unsigned i = 0; i <= count; ++i) {
        std::array<char, 16> name{};
        std::snprintf(name.data(), name.size(), "%ssub%x", object.c_str(), i);
        if (!grep.subs.contains(name.data())) ++subs;
      }
    }
    std::size_t simple = 0;
    std::size_t made_counts = 0;
    for (const auto& object : grep.objects) {
      const auto index = static_cast<std::uint16_t>(std::stoul(object, nullptr, 16));
      const auto* found = d.find(index);
      ASSERT_NE(found, nullptr) << object;
      const bool has_subs = std::ranges::any_of(grep.subs, [&](const auto& s) { return s.starts_with(object); });
      const bool complex = found->code == od::ObjectCode::array || found->code == od::ObjectCode::record;
      if (!complex) ++simple;
      // An array or record that describes no sub-index 0 gets one.
      if (complex && !grep.compact.contains(object) && !grep.subs.contains(object + "sub0")) ++made_counts;
      EXPECT_TRUE(complex || !has_subs) << object;
    }
    EXPECT_EQ(d.subs().size(), subs + simple + made_counts);
    for (const auto& each : r.findings) EXPECT_EQ(each.file, entry.path().string());
    // A device of each: whatever is readable can be read, for any node-ID.
    od::Values device(r.file.description, NodeId(127));
    std::vector<std::uint8_t> buffer(4096);
    for (const auto& object : d.objects()) {
      for (const auto& sub_object : d.subs(object)) {
        const auto answer = device.read({object.index, sub_object.sub}, buffer);
        const bool has_value = od::readable(sub_object.access) && sub_object.type != od::DataType::domain;
        EXPECT_TRUE(answer || !has_value);
      }
    }
  }
  EXPECT_GE(files, 1U);
}

TEST(EdsFiles, CountsOfTheKnownFiles) {
  if (!fs::is_directory(eds_folder())) GTEST_SKIP() << "no folder of real device descriptions; set BERTH_EDS_DIR";
  for (const Expected& each :
       {Expected{"DS301_profile.eds", 33, 33}, Expected{"cia402_slave.eds", 70, 70}, Expected{"datatypes.eds", 24, 24},
        Expected{"demoDevice.eds", 47, 47}, Expected{"e35.eds", 211, 212}, Expected{"ros2_master.dcf", 47, 47}}) {
    const fs::path path = eds_folder() / each.file;
    if (!fs::exists(path)) continue;
    SCOPED_TRACE(each.file);
    const Grep grep(text_of(path));
    EXPECT_EQ(grep.objects.size(), each.objects) << "the file is not the one these numbers were counted in";
    EXPECT_EQ(grep.promised, each.promised);
    EXPECT_EQ(read_file(path).file.description->objects().size(), each.objects);
  }
}

TEST(EdsFiles, ValuesOfTheKnownFiles) {
  const fs::path types = eds_folder() / "datatypes.eds";
  if (!fs::exists(types)) GTEST_SKIP() << "no folder of real device descriptions; set BERTH_EDS_DIR";
  const auto r = read_file(types);
  od::Values device(r.file.description);
  EXPECT_EQ(signed_value(r, 0x2012), -40);
  EXPECT_EQ(signed_value(r, 0x2010), -1);
  EXPECT_EQ(value(r, 0x201A), 56U);
  EXPECT_EQ(*device.get<float>({0x2008, 0}), 1.2F);
  EXPECT_EQ(*device.get<double>({0x2011, 0}), 1.6);
  EXPECT_EQ(device.get_text({0x2009, 0}), "ABCD");
  EXPECT_EQ(device.bytes({0x200B, 0}).size(), 8U) << "abc and a check mark in UTF-16";
  const auto master = read_file(eds_folder() / "ros2_master.dcf");
  EXPECT_EQ(value(master, 0x1600, 1), 0x20000120U);
  EXPECT_EQ(value(master, 0x1028, 2), 0x82U);
  EXPECT_EQ(value(master, 0x1028, 4), 0x80000000U) << "missing in [1028Value]: the default";
  const auto sample = read_file(eds_folder() / "sample.eds");
  ASSERT_TRUE(sample.file.commissioning);
  EXPECT_EQ(sample.file.commissioning->node_id, NodeId(0x10));
  EXPECT_EQ(name(sample, 0x3004, 2), "Sensor Status 2");
  EXPECT_EQ(value(sample, 0x1403, 1, 5), 0x505U) << "1280+$NODEID";
  const auto profile = read_file(eds_folder() / "DS301_profile.eds");
  od::Values instance(profile.file.description, NodeId(1));
  EXPECT_LE(instance.memory(), 6000U) << "one more device of this type";
  EXPECT_LE(profile.file.description->memory() + instance.memory(), 24'000U) << "the first device of this type";
}

TEST(EdsFiles, OurExamplesHaveNoFinding) {
  unsigned whole = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(berth::test::source_dir()) / "examples" / "eds")) {
    SCOPED_TRACE(entry.path().filename().string());
    const auto r = read_file(entry.path());
    EXPECT_TRUE(r.findings.empty()) << to_string(r.findings.front());
    EXPECT_EQ(r.file.type_code().vendor, 1U);
    // The first three describe all that CiA 301 lets a simple slave have.
    const std::string name = entry.path().stem().string();
    if (name != "drive" && name != "io" && name != "sensor") continue;
    ++whole;
    EXPECT_TRUE(r.file.device.lss);
    for (const std::uint16_t index : std::initializer_list<std::uint16_t>{
             0x1000, 0x1001, 0x1003, 0x1008, 0x100C, 0x100D, 0x1014, 0x1016, 0x1017, 0x1018, 0x1200}) {
      EXPECT_NE(r.file.description->find(index), nullptr) << index;
    }
    EXPECT_EQ(value(r, 0x1200, 1, 9), 0x609U);
    EXPECT_EQ(value(r, 0x1014, 0, 9), 0x89U);
  }
  EXPECT_EQ(whole, 3U);
}

TEST(EdsDocument, KeepsEveryByteAndPlace) {
  const std::string text = "; head\r\n[ A ]\r\n key = value ; c\r\n\r\n[B]\nx=\n";
  Report report("f", 10);
  const auto d = Document::parse(text, report);
  EXPECT_EQ(d.text(), text);
  ASSERT_EQ(d.sections().size(), 2U);
  EXPECT_EQ(d.name(d.sections()[0]), "A");
  EXPECT_EQ(d.sections()[0].line, 2U);
  const auto* entry = d.find(d.sections()[0], "KEY");
  ASSERT_NE(entry, nullptr);
  EXPECT_EQ(d.key(*entry), "key");
  EXPECT_EQ(d.value(*entry), "value");
  EXPECT_EQ(entry->line, 3U);
  EXPECT_EQ(d.column(entry->value_at), 8U);
  EXPECT_EQ(text.substr(entry->value_at, entry->value_length), "value");
  EXPECT_EQ(d.value(d.entries(*d.find("b"))[0]), "");
}

RC_GTEST_PROP(EdsDocument, AnyTextKeepsItsBytesAndEveryEntryItsPlace, (std::string text)) {
  Report report("f", 100);
  const auto d = Document::parse(text, report);
  RC_ASSERT(d.text() == text);
  for (const auto& section : d.sections()) {
    for (const auto& entry : d.entries(section)) {
      RC_ASSERT(entry.value_at + entry.value_length <= text.size());
      RC_ASSERT(entry.key_at + entry.key_length < entry.value_at + 1U);
      RC_ASSERT(entry.line >= section.line);
    }
  }
}

/// Any numeric value of any type, written as text into a description, is the value of a device of it.
RC_GTEST_PROP(EdsFiles, AnyScalarDefaultArrivesInTheDevice, (std::uint64_t word)) {
  const auto all = od::all_data_types();
  const auto type = *rc::gen::elementOf(std::vector<od::DataType>(all.begin(), all.end()));
  RC_PRE(od::byte_size(type) != 0);
  const auto raw = od::wrap(type, type == od::DataType::boolean ? word & 1U : word);
  std::vector<std::uint8_t> bytes(od::byte_size(type));
  od::store(type, raw, bytes.data());
  const auto r = read_variable(static_cast<int>(type), "DefaultValue=" + od::print(type, bytes));
  RC_ASSERT(r.usable());
  od::Values device(r.file.description);
  const auto stored = device.bytes({0x2000, 0});
  RC_ASSERT(std::vector<std::uint8_t>(stored.begin(), stored.end()) == bytes);
}

/// Lines of an example in any order, some lost, some twice, some broken: always an answer, never a crash, and every
/// finding has a place in the file.
RC_GTEST_PROP(EdsFiles, ScrambledFilesAreAnswered, (std::uint64_t seed)) {
  static const std::string text = text_of(fs::path(berth::test::source_dir()) / "examples" / "eds" / "drive.eds");
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  Random random(seed);
  for (int i = 0; i < 20; ++i) {
    const auto a = random.below(lines.size());
    const auto b = random.below(lines.size());
    switch (random.below(4)) {
      case 0: std::swap(lines[a], lines[b]); break;
      case 1: lines[a] = lines[b]; break;
      case 2: lines[a].clear(); break;
      default:
        if (!lines[a].empty()) lines[a][random.below(lines[a].size())] = static_cast<char>(random.next());
    }
  }
  std::string scrambled;
  for (const auto& line : lines) scrambled += line + "\n";
  const auto r = read_text(scrambled);
  RC_ASSERT(r.file.description != nullptr);
  const auto lines_of_it = std::ranges::count_if(scrambled, [](char c) { return c == '\n' || c == '\r'; });
  for (const auto& each : r.findings) {
    RC_ASSERT(each.line >= 0 && each.line <= lines_of_it + 1);
    RC_ASSERT(each.line == 0 || each.column >= 1);
  }
  od::Values device(r.file.description, NodeId(3));
  device.reset(NodeId(4), od::Area::communication);
}

}  // namespace
