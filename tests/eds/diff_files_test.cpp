// Two descriptions compared, and a description compared with what a device answers.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/eds/diff.hpp"

#include "berth/base/random.hpp"
#include "berth/od/abort_code.hpp"
#include "support.hpp"

namespace {

using namespace berth;
using namespace berth::eds;
using namespace berth::eds::test;

constexpr std::string_view two_objects =
    "[2000]\nParameterName=Speed\nObjectType=7\nDataType=6\nAccessType=rw\nDefaultValue=5\nLowLimit=1\nHighLimit="
    "9\nPDOMapping=1\n"
    "[2001]\nParameterName=List\nObjectType=8\nSubNumber=3\n[2001sub0]\nParameterName=n\nDataType=5\nAccessType="
    "ro\nDefaultValue=2\n"
    "[2001sub1]\nParameterName=a\nDataType=7\nAccessType=rw\n[2001sub2]\nParameterName=b\nDataType=7\nAccessType=rw\n";

Reading base(std::string_view change = {}, std::string_view into = {}) {
  std::string text = file_with(two_objects, {"0x2000", "0x2001"});
  if (!change.empty()) text.replace(text.find(change), change.size(), into);
  return read_text(text);
}

std::vector<std::string> lines(const File& a, const File& b) {
  std::vector<std::string> made;
  for (const auto& each : diff(a, b)) made.push_back(to_string(each));
  return made;
}

TEST(DiffFiles, EqualFilesHaveNoDifference) {
  const auto a = base();
  EXPECT_TRUE(diff(a.file, a.file).empty());
  // Another way to write the same.
  EXPECT_TRUE(diff(a.file, base("DefaultValue=5", "DefaultValue=0x05").file).empty());
  EXPECT_TRUE(diff(a.file, base("AccessType=rw\nDefaultValue=5", "AccessType=RW\nDefaultValue=5").file).empty());
}

TEST(DiffFiles, EveryAspectIsFound) {
  struct Case {
    const char* change;
    const char* into;
    Aspect aspect;
    ObjectRef object;
    const char* first;
    const char* second;
  };
  const auto a = base();
  for (const Case& each :
       {Case{"DataType=6", "DataType=7", Aspect::data_type, {0x2000, 0}, "UNSIGNED16", "UNSIGNED32"},
        Case{"AccessType=rw\nDefault", "AccessType=ro\nDefault", Aspect::access, {0x2000, 0}, "rw", "ro"},
        Case{"PDOMapping=1", "PDOMapping=0", Aspect::mapping, {0x2000, 0}, "yes", "no"},
        Case{"DefaultValue=5", "DefaultValue=6", Aspect::default_value, {0x2000, 0}, "5", "6"},
        Case{"DefaultValue=5", "", Aspect::default_value, {0x2000, 0}, "5", ""},
        Case{"LowLimit=1", "LowLimit=2", Aspect::low_limit, {0x2000, 0}, "1", "2"},
        Case{"HighLimit=9", "", Aspect::high_limit, {0x2000, 0}, "9", ""},
        Case{"ParameterName=Speed", "ParameterName=Velocity", Aspect::name, {0x2000, 0}, "Speed", "Velocity"},
        Case{"DefaultValue=5", "DefaultValue=5\nObjFlags=1", Aspect::obj_flags, {0x2000, 0}, "0", "1"},
        Case{"ObjectType=8", "ObjectType=9", Aspect::object_type, {0x2001, 0}, "ARRAY", "RECORD"},
        Case{"DefaultValue=5", "DefaultValue=5\nParameterValue=7", Aspect::value, {0x2000, 0}, "", "7"}}) {
    SCOPED_TRACE(each.into);
    const auto found = diff(a.file, base(each.change, each.into).file);
    ASSERT_EQ(found.size(), 1U) << to_string(found.empty() ? Difference{} : found[0]);
    EXPECT_EQ(found[0].aspect, each.aspect);
    EXPECT_EQ(found[0].object, each.object);
    EXPECT_EQ(found[0].first, each.first);
    EXPECT_EQ(found[0].second, each.second);
  }
}

TEST(DiffFiles, MissingObjectsAreOneEntryEach) {
  const auto a = base();
  const auto b = base(two_objects.substr(two_objects.find("[2001sub2]")), "");
  EXPECT_EQ(lines(a.file, b.file), std::vector<std::string>{"2001h:02  only in first   b"});
  EXPECT_EQ(lines(b.file, a.file), std::vector<std::string>{"2001h:02  only in second  b"});
  const auto c = base(two_objects.substr(two_objects.find("[2001]")), "");
  const auto found = diff(a.file, c.file);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_TRUE(found[0].whole);
  EXPECT_EQ(found[0].first, "List");
}

TEST(DiffFiles, IdentityComesFirst) {
  const auto found = diff(base().file, base("VendorNumber=1", "VendorNumber=0x147").file);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].aspect, Aspect::identity);
  EXPECT_EQ(found[0].field, "VendorNumber");
  EXPECT_EQ(found[0].first, "0x00000001");
  EXPECT_EQ(found[0].second, "0x00000147");
}

// Whatever differs one way differs the other way round, and a file is like itself.
RC_GTEST_PROP(DiffFiles, IsSymmetric, (std::uint64_t seed)) {
  Random random(seed);
  std::string text = file_with(two_objects, {"0x2000", "0x2001"});
  for (std::uint64_t i = 0; i < 3; ++i) text[random.below(text.size())] = static_cast<char>('0' + random.below(10));
  const auto a = base();
  const auto b = read_text(text);
  const auto there = diff(a.file, b.file);
  const auto back = diff(b.file, a.file);
  RC_ASSERT(there.size() == back.size());
  for (std::size_t i = 0; i < there.size(); ++i) {
    RC_ASSERT(there[i].first == back[i].second);
    RC_ASSERT(there[i].object == back[i].object);
  }
  RC_ASSERT(diff(b.file, b.file).empty());
}

// ---- against a device ----

/// What a device of this description answers.
std::vector<LiveAnswer> answers(const Reading& r, const LiveOptions& options = {}) {
  od::Values device(r.file.description, NodeId(5));
  std::vector<LiveAnswer> made;
  std::vector<std::uint8_t> buffer(4096);
  for (const ObjectRef ref : to_read(r.file, options)) {
    LiveAnswer answer{.object = ref, .abort_code = 0, .failure = {}, .bytes = {}};
    if (const auto length = device.read(ref, buffer)) {
      answer.bytes.assign(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(*length));
    } else {
      answer.abort_code = static_cast<std::uint32_t>(length.error());
    }
    made.push_back(answer);
  }
  return made;
}

LiveAnswer& of(std::vector<LiveAnswer>& all, ObjectRef ref) {
  return *std::ranges::find_if(all, [ref](const LiveAnswer& each) { return each.object == ref; });
}

TEST(DiffLive, ADeviceOfThisDescriptionHasNoDifference) {
  const auto r = base();
  EXPECT_EQ(to_read(r.file).size(), 8U) << "1000h, 1001h, two of 1018h, 2000h, three of 2001h";
  EXPECT_TRUE(diff_live(r.file, answers(r), NodeId(5)).empty());
}

TEST(DiffLive, RefusalsLengthsAndIdentity) {
  const auto r = base();
  auto all = answers(r);
  of(all, {0x1018, 1}).bytes = {0x47, 1, 0, 0};
  of(all, {0x2000, 0}).bytes = {1, 2, 3, 4};
  of(all, {0x2001, 0}).bytes = {7};
  of(all, {0x2001, 1}) = {.object = {0x2001, 1}, .abort_code = 0x0609'0011, .failure = {}, .bytes = {}};
  of(all, {0x2001, 2}) = {.object = {0x2001, 2}, .abort_code = 0x0800'0022, .failure = {}, .bytes = {}};
  of(all, {0x1001, 0}) = {.object = {0x1001, 0}, .abort_code = 0, .failure = "no answer", .bytes = {}};
  const auto found = diff_live(r.file, all, NodeId(5));
  ASSERT_EQ(found.size(), 6U);
  EXPECT_EQ(found[0].aspect, Aspect::identity);
  EXPECT_EQ(found[0].first, "0x00000001");
  EXPECT_EQ(found[0].second, "0x00000147");
  EXPECT_EQ(found[1].aspect, Aspect::unreadable);
  EXPECT_EQ(found[1].second, "no answer");
  EXPECT_EQ(found[2].aspect, Aspect::data_type);
  EXPECT_EQ(found[2].second, "a value of 4 bytes");
  EXPECT_EQ(found[3].aspect, Aspect::only_in_second);
  EXPECT_EQ(found[4].aspect, Aspect::only_in_first);
  EXPECT_EQ(found[4].object, (ObjectRef{0x2001, 1}));
  EXPECT_EQ(found[5].aspect, Aspect::unreadable);
  EXPECT_NE(found[5].second.find("08000022h"), std::string::npos);
}

TEST(DiffLive, AMissingObjectIsOneDifference) {
  const auto r = base();
  auto all = answers(r);
  for (auto& each : all) {
    if (each.object.index == 0x2001)
      each = {.object = each.object, .abort_code = 0x0602'0000, .failure = {}, .bytes = {}};
  }
  const auto found = diff_live(r.file, all, NodeId(5));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_TRUE(found[0].whole);
  EXPECT_EQ(found[0].aspect, Aspect::only_in_first);
}

TEST(DiffLive, ValuesOnlyWhenAskedFor) {
  const auto r = base("DefaultValue=5", "DefaultValue=5\nParameterValue=$NODEID+1");
  auto all = answers(r);
  EXPECT_TRUE(diff_live(r.file, all, NodeId(5), {.values = true}).empty()) << "5 + 1";
  of(all, {0x2000, 0}).bytes = {8, 0};
  EXPECT_TRUE(diff_live(r.file, all, NodeId(5)).empty());
  const auto found = diff_live(r.file, all, NodeId(5), {.values = true});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].aspect, Aspect::value);
  EXPECT_EQ(found[0].first, "6");
  EXPECT_EQ(found[0].second, "8");
}

TEST(DiffLive, WhatMayNotBeReadIsNotAsked) {
  const auto r =
      read_text(file_with("[2000]\nParameterName=w\nObjectType=7\nDataType=5\nAccessType=wo\n[2001]\nParameterName="
                          "d\nObjectType=2\nDataType=0xF\nAccessType=rw\n"
                          "[2002]\nParameterName=f\nObjectType=7\nDataType=5\nAccessType=ro\nObjFlags=2\n",
                          {"0x2000", "0x2001", "0x2002"}));
  for (const ObjectRef ref : to_read(r.file)) EXPECT_LT(ref.index, 0x2000);
}

}  // namespace
