// Concise DCF (CiA 302-3, 1F22h): bytes, broken streams, from and to parameters, and the order that devices take.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/eds/concise_dcf.hpp"
#include "support.hpp"

namespace {

using namespace berth;
using namespace berth::eds;
using namespace berth::eds::test;
using Bytes = std::vector<std::uint8_t>;
using od::DataType;
using od::Literal;

const Bytes two_entries{2,    0,    0, 0,                    // two entries
                        0x17, 0x10, 0, 2, 0, 0, 0, 0xE8, 3,  // 1017h:00, 2 bytes: 1000
                        0x00, 0x20, 1, 1, 0, 0, 0, 0x7F};    // 2000h:01, 1 byte

TEST(ConciseDcf, E3_3_TheStreamIsCountThenIndexSubSizeData) {
  const auto dcf = decode_concise_dcf(two_entries);
  ASSERT_TRUE(dcf);
  ASSERT_EQ(dcf->entries.size(), 2U);
  EXPECT_EQ(dcf->entries[0], (ConciseEntry{{0x1017, 0}, {0xE8, 3}}));
  EXPECT_EQ(dcf->entries[1], (ConciseEntry{{0x2000, 1}, {0x7F}}));
  EXPECT_EQ(encode(*dcf), two_entries);
}

TEST(ConciseDcf, E3_3_EmptyAndNothingToConfigure) {
  EXPECT_TRUE(decode_concise_dcf(Bytes{})->entries.empty());
  EXPECT_TRUE(decode_concise_dcf(Bytes{0, 0, 0, 0})->entries.empty());
  EXPECT_EQ(encode(ConciseDcf{}), (Bytes{0, 0, 0, 0}));
  const auto empty_value = decode_concise_dcf(Bytes{1, 0, 0, 0, 0x50, 0x1F, 1, 0, 0, 0, 0});
  ASSERT_TRUE(empty_value) << "an entry without data is an entry";
  EXPECT_TRUE(empty_value->entries.at(0).data.empty());
}

TEST(ConciseDcf, E3_3_BrokenStreamsSayWhere) {
  const auto refused = [](const Bytes& bytes, std::size_t at, ObjectRef object = {}) {
    const auto dcf = decode_concise_dcf(bytes);
    ASSERT_FALSE(dcf);
    EXPECT_EQ(dcf.error().code, Errc::invalid);
    EXPECT_EQ(dcf.error().detail, at) << dcf.error().text;
    EXPECT_EQ(dcf.error().index, object.index);
    EXPECT_EQ(dcf.error().sub, object.sub);
  };
  refused({1}, 0);
  refused({1, 0, 0}, 0);
  refused({1, 0, 0, 0}, 0);                                                // promised and not there
  refused({0xFF, 0xFF, 0xFF, 0xFF, 1, 2, 3, 4, 5, 6, 7}, 0);               // a count that the rest cannot hold
  refused({1, 0, 0, 0, 0x17, 0x10, 0, 2, 0, 0, 0, 0xE8}, 7, {0x1017, 0});  // size 2, one byte left
  refused({1, 0, 0, 0, 0x17, 0x10, 5, 0xFF, 0xFF, 0xFF, 0xFF}, 7, {0x1017, 5});
  Bytes more = two_entries;
  more.push_back(0);
  refused(more, two_entries.size());
  Bytes fewer = two_entries;
  fewer[0] = 1;
  refused(fewer, 13);  // a whole entry behind the last one
  Bytes cut_head{2, 0, 0, 0, 0x17, 0x10, 0, 5, 0, 0, 0, 1, 2, 3, 4, 5, 0x00, 0x20, 1};
  refused(cut_head, 16);
}

RC_GTEST_PROP(ConciseDcf, E3_3_AnyConfigurationSurvivesAndAnyCutIsRefused, (std::uint64_t seed)) {
  Random random(seed);
  ConciseDcf dcf;
  for (auto n = random.below(8); n != 0; --n) {
    Bytes data(random.below(20));
    for (auto& byte : data) byte = static_cast<std::uint8_t>(random.next());
    dcf.entries.push_back(
        {{static_cast<std::uint16_t>(random.next()), static_cast<std::uint8_t>(random.next())}, std::move(data)});
  }
  const Bytes stream = encode(dcf);
  RC_ASSERT(decode_concise_dcf(stream).value() == dcf);
  const Bytes cut(stream.begin(), stream.begin() + static_cast<std::ptrdiff_t>(random.below(stream.size())));
  RC_ASSERT(cut.empty() || !decode_concise_dcf(cut).has_value());
}

// A2.1: text in a description, the value, and the bytes of an SDO are one and the same thing for every type.
RC_GTEST_PROP(ConciseDcf, A2_1_AnyValueOfAnyTypeSurvivesEncodeAndDecode, (std::uint64_t seed)) {
  Random random(seed);
  const auto all = od::all_data_types();
  const DataType type = all[random.below(all.size())];
  Literal value;
  if (od::byte_size(type) == 0) {
    Bytes bytes(2 + 2 * random.below(10));
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>('!' + random.below(90));
    value = Literal::octets(bytes);
  } else {
    value = Literal::number(od::wrap(type, type == DataType::boolean ? random.below(2) : random.next()));
  }
  const auto bytes = encode(value, type, NodeId());
  RC_ASSERT(bytes.has_value());
  RC_ASSERT(od::byte_size(type) == 0 || bytes->size() == od::byte_size(type));
  RC_ASSERT(decode(*bytes, type).value() == value);
  const auto parsed = od::parse(type, od::print(type, *bytes));
  RC_ASSERT(parsed.has_value());
  RC_ASSERT(encode(parsed->value, type, NodeId()).value() == *bytes);
  Bytes longer = *bytes;
  longer.push_back(0);
  RC_ASSERT(od::byte_size(type) == 0 || decode(longer, type).error().code == Errc::mismatch);
}

TEST(ConciseDcf, E3_3_ValuesOfTheWrongKindAreRefused) {
  EXPECT_EQ(encode(Literal{}, DataType::unsigned8, NodeId(1)).error().code, Errc::invalid);
  EXPECT_EQ(encode(Literal::text("x"), DataType::unsigned8, NodeId(1)).error().code, Errc::invalid);
  EXPECT_EQ(encode(Literal::number(1), DataType::domain, NodeId(1)).error().code, Errc::invalid);
  EXPECT_EQ(encode(Literal::node_id_plus(0x180), DataType::unsigned32, NodeId()).error().code, Errc::invalid)
      << "no node-ID, no COB-ID";
  EXPECT_EQ(*encode(Literal::node_id_plus(0x180), DataType::unsigned32, NodeId(5)), (Bytes{0x85, 1, 0, 0}));
}

/// A DCF with a TPDO, its mapping, a heartbeat and identity values of which some cannot be written.
Reading dcf_of(const std::string& cob_id = "$NODEID+0x180") {
  return read_text(
      file_with("[1017]\nParameterName=h\nDataType=6\nAccessType=rw\nParameterValue=1000\n"
                "[1020]\nParameterName=v\nObjectType=8\nSubNumber=3\n"
                "[1020sub0]\nParameterName=n\nDataType=5\nAccessType=ro\nDefaultValue=2\n"
                "[1020sub1]\nParameterName=date\nDataType=7\nAccessType=rw\nParameterValue=15000\n"
                "[1800]\nParameterName=t\nObjectType=9\nSubNumber=3\n"
                "[1800sub0]\nParameterName=n\nDataType=5\nAccessType=ro\nDefaultValue=2\n"
                "[1800sub1]\nParameterName=c\nDataType=7\nAccessType=rw\nDefaultValue=$NODEID+0x180\nParameterValue=" +
                    cob_id +
                    "\n[1800sub2]\nParameterName=t\nDataType=5\nAccessType=rw\nParameterValue=1\n"
                    "[1A00]\nParameterName=m\nObjectType=9\nSubNumber=3\n"
                    "[1A00sub0]\nParameterName=n\nDataType=5\nAccessType=rw\nParameterValue=1\n"
                    "[1A00sub1]\nParameterName=e\nDataType=7\nAccessType=rw\nParameterValue=0x20000020\n"
                    "[2000]\nParameterName=r\nDataType=7\nAccessType=ro\nParameterValue=7\n"
                    "[2001]\nParameterName=f\nDataType=7\nAccessType=rw\nObjFlags=1\nParameterValue=7\n"
                    "[2002]\nParameterName=s\nDataType=9\nAccessType=rw\nParameterValue=abc\n",
                {"0x1017", "0x1020", "0x1800", "0x1A00", "0x2000", "0x2001", "0x2002"}));
}

TEST(ConciseDcf, E3_3_FromADcfForANode) {
  const auto r = dcf_of();
  ASSERT_TRUE(r.usable()) << complaints(r);
  const auto dcf = concise_dcf(r.file, NodeId(5), Order::as_given);
  ASSERT_TRUE(dcf);
  std::map<ObjectRef, Bytes> values;
  for (const auto& each : dcf->entries) values[each.object] = each.data;
  EXPECT_EQ(values.size(), dcf->entries.size());
  EXPECT_EQ((values[{0x1800, 1}]), (Bytes{0x85, 1, 0, 0})) << "$NODEID resolved";
  EXPECT_EQ((values[{0x2002, 0}]), (Bytes{'a', 'b', 'c'}));
  EXPECT_EQ((values[{0x1017, 0}]), (Bytes{0xE8, 3}));
  EXPECT_FALSE(values.contains({0x2000, 0})) << "read-only";
  EXPECT_FALSE(values.contains({0x2001, 0})) << "ObjFlags bit 0: refuse write on download";
  EXPECT_EQ(values.size(), 7U);
  EXPECT_TRUE(std::ranges::is_sorted(dcf->entries, {}, &ConciseEntry::object));
  const auto nobody = concise_dcf(r.file, NodeId());
  ASSERT_FALSE(nobody);
  EXPECT_EQ(nobody.error().index, 0x1800);
  EXPECT_EQ(nobody.error().sub, 1);
}

TEST(ConciseDcf, E3_3_BackToParametersKeepsFormulas) {
  const auto r = dcf_of();
  const auto dcf = concise_dcf(r.file, NodeId(5));
  const auto back = parameters(*dcf, *r.file.description, NodeId(5));
  ASSERT_TRUE(back);
  std::vector<Parameter> wanted;
  for (const auto& each : r.file.parameters) {
    if (each.object.index != 0x2000 && each.object.index != 0x2001) wanted.push_back(each);
  }
  ASSERT_EQ(back->size(), wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    EXPECT_EQ((*back)[i].object, wanted[i].object);
    EXPECT_EQ((*back)[i].type, wanted[i].type);
    EXPECT_EQ((*back)[i].value, wanted[i].value) << i;
  }
  const auto other = parameters(*dcf, *r.file.description, NodeId(6));
  EXPECT_EQ((*other)[2].value, Literal::number(0x185)) << "185h is not 180h + 6";
  const auto missing = parameters({{{{0x2345, 6}, {1}}}}, *r.file.description, NodeId(5));
  EXPECT_EQ(missing.error().code, Errc::not_found);
  EXPECT_EQ(missing.error().index, 0x2345);
  const auto wrong = parameters({{{{0x1017, 0}, {1, 2, 3}}}}, *r.file.description, NodeId(5));
  EXPECT_EQ(wrong.error().code, Errc::mismatch);
}

/// A device that refuses what CiA 301 §7.5.2 lets it refuse, as the conformance test does.
struct StrictDevice {
  std::map<ObjectRef, std::uint32_t> values;

  std::uint32_t get(std::uint16_t index, std::uint8_t sub) const {
    const auto found = values.find({index, sub});
    return found == values.end() ? 0 : found->second;
  }
  bool write(const ConciseEntry& entry) {
    std::uint32_t value = 0;
    for (std::size_t i = entry.data.size(); i-- > 0;) value = value << 8U | entry.data[i];
    const std::uint16_t index = entry.object.index;
    const std::uint8_t sub = entry.object.sub;
    constexpr std::uint32_t off = 0x8000'0000;
    const bool communication = (index >= 0x1400 && index < 0x1600) || (index >= 0x1800 && index < 0x1A00);
    const bool mapping = (index >= 0x1600 && index < 0x1800) || (index >= 0x1A00 && index < 0x1C00);
    if (communication) {
      const bool valid = (get(index, 1) & off) == 0;
      if (sub == 1 && valid && (value & off) == 0 && value != get(index, 1)) return false;
      if (sub != 1 && valid) return false;
    }
    if (mapping) {
      if ((get(static_cast<std::uint16_t>(index - 0x200), 1) & off) == 0) return false;
      if (sub != 0 && get(index, 0) != 0) return false;
      if (sub == 0) {
        for (std::uint32_t i = 1; i <= value; ++i) {
          if (get(index, static_cast<std::uint8_t>(i)) == 0) return false;
        }
      }
    }
    const bool channel = index >= 0x1200 && index < 0x1300;
    if (channel && sub == 3 && ((get(index, 1) | get(index, 2)) & off) == 0) return false;
    if (channel && sub < 3 && sub > 0 && ((get(index, 1) | get(index, 2)) & off) == 0 && (value & off) == 0 &&
        value != get(index, sub)) {
      return false;
    }
    if (index == 0x1014 && (get(0x1014, 0) & off) == 0 && (value & off) == 0 && value != get(0x1014, 0)) return false;
    if (index == 0x1015 && (get(0x1014, 0) & off) == 0) return false;
    if (index == 0x1019 && get(0x1006, 0) != 0) return false;
    if (index == 0x1005 && (get(0x1005, 0) & 0x4000'0000) != 0 && (value & 0x4000'0000) != 0 &&
        value != get(0x1005, 0)) {
      return false;
    }
    values[entry.object] = value;
    return true;
  }
};

/// Any configuration of such a device, in any order, is taken whole in the working order.
RC_GTEST_PROP(ConciseDcf, E3_3_TheWorkingOrderIsTakenByAStrictDevice, (std::uint64_t seed)) {
  Random random(seed);
  std::map<ObjectRef, std::uint32_t> wanted;
  const auto set = [&](unsigned index, unsigned sub, std::uint32_t value) {
    wanted[{static_cast<std::uint16_t>(index), static_cast<std::uint8_t>(sub)}] = value;
  };
  StrictDevice device;
  for (const unsigned base : {0x1400U, 0x1800U, 0x1805U, 0x15FFU}) {
    const auto before = static_cast<std::uint32_t>(random.chance(500'000) ? 0x181 + random.below(50) : 0x8000'0000);
    device.values[{static_cast<std::uint16_t>(base), 1}] = before;
    device.values[{static_cast<std::uint16_t>(base + 0x200), 0}] = static_cast<std::uint32_t>(random.below(2));
    device.values[{static_cast<std::uint16_t>(base + 0x200), 1}] = 0x20000008;
    if (random.chance(200'000)) continue;
    set(base, 1, static_cast<std::uint32_t>(0x201 + random.below(100)) | (random.chance(300'000) ? 0x8000'0000 : 0));
    if (random.chance(700'000)) set(base, 2, static_cast<std::uint32_t>(1 + random.below(200)));
    if (random.chance(500'000)) set(base, 5, static_cast<std::uint32_t>(random.below(200)));
    if (random.chance(700'000)) {
      const auto count = static_cast<std::uint32_t>(random.below(4));
      for (unsigned i = 1; i <= count; ++i) set(base + 0x200, i, 0x20000008 + i);
      set(base + 0x200, 0, count);
    }
  }
  if (random.chance(500'000)) {
    set(0x1280, 1, 0x612);
    set(0x1280, 2, 0x592);
    set(0x1280, 3, 0x12);
  }
  device.values[{0x1014, 0}] = 0x81;
  if (random.chance(500'000)) {
    set(0x1014, 0, static_cast<std::uint32_t>(0x82 + random.below(10)) | (random.chance(200'000) ? 0x8000'0000 : 0));
    set(0x1015, 0, 100);
  }
  device.values[{0x1006, 0}] = static_cast<std::uint32_t>(random.below(2));
  device.values[{0x1005, 0}] = random.chance(500'000) ? 0x4000'0080 : 0x80;
  if (random.chance(500'000)) {
    set(0x1005, 0, random.chance(500'000) ? 0x4000'0081 : 0x81);
    set(0x1006, 0, 5000);
    set(0x1019, 0, 10);
  }
  set(0x2000, 0, 1);
  set(0x1020, 1, 15000);
  set(0x1020, 2, 1);
  set(0x1010, 1, 0x65766173);
  ConciseDcf dcf;
  for (const auto& [object, value] : wanted) {
    Bytes bytes(4);
    for (std::size_t i = 0; i < 4; ++i) bytes[i] = static_cast<std::uint8_t>(value >> (8 * i));
    dcf.entries.push_back({object, bytes});
  }
  for (std::size_t i = dcf.entries.size(); i > 1; --i) std::swap(dcf.entries[i - 1], dcf.entries[random.below(i)]);
  const ConciseDcf ordered = in_working_order(dcf);
  bool dated = false;
  for (const auto& each : ordered.entries) {
    if (!device.write(each))
      RC_FAIL("refused " + std::to_string(each.object.index) + ":" + std::to_string(each.object.sub));
    if (each.object.index == 0x1020) dated = true;
    RC_ASSERT(!dated || each.object.index == 0x1020 || each.object.index == 0x1010);
  }
  RC_ASSERT(ordered.entries.back().object == (ObjectRef{0x1010, 1}));
  for (const auto& [object, value] : wanted) RC_ASSERT(device.values[object] == value);
}

TEST(ConciseDcf, E3_3_AMappingAloneSwitchesItsPdoOffAndOn) {
  auto r = dcf_of();
  std::erase_if(r.file.parameters, [](const Parameter& each) { return each.object.index == 0x1800; });
  std::string text = r.file.document.text();
  text.erase(text.find("ParameterValue=$NODEID+0x180\n"), 29);
  const auto plain = read_text(text);
  std::vector<Parameter> mapping;
  for (const auto& each : plain.file.parameters) {
    if (each.object.index == 0x1A00) mapping.push_back(each);
  }
  const auto dcf = concise_dcf(*plain.file.description, mapping, NodeId(5));
  ASSERT_TRUE(dcf);
  const std::vector<ConciseEntry> expected{{{0x1800, 1}, {0x85, 1, 0, 0x80}},
                                           {{0x1A00, 0}, {0}},
                                           {{0x1A00, 1}, {0x20, 0, 0, 0x20}},
                                           {{0x1A00, 0}, {1}},
                                           {{0x1800, 1}, {0x85, 1, 0, 0}}};
  EXPECT_EQ(dcf->entries, expected);
}

}  // namespace
