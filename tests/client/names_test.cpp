// Objects by name.
#include <gtest/gtest.h>
#include <string>

#include "../pch.hpp"
#include "rig.hpp"

namespace berth::client::test {
namespace {

TEST(ClientNames, EachWayToNameAnObject) {
  const Names names(dictionary());
  const ObjectRef vendor{0x1018, 1};
  for (const char* text : {"1018:01", "1018:1", "1018h:01", "1018h:01h", "0x1018:0x1", "0X1018:01"}) {
    EXPECT_EQ(names.find(text), vendor) << text;
  }
  EXPECT_EQ(names.find(vendor), vendor);
  EXPECT_EQ(names.find("1000"), (ObjectRef{0x1000, 0}));
  EXPECT_EQ(names.find("Axis.Speed"), (ObjectRef{0x2104, 2}));
  EXPECT_EQ(names.find("Speed"), (ObjectRef{0x2104, 2})) << "no other sub-object is called so";
  EXPECT_EQ(names.find("Limited"), (ObjectRef{0x2100, 0}));
  EXPECT_EQ(names.find(std::string("Other axis.Position")), (ObjectRef{0x2105, 1}));
  EXPECT_EQ(names.find("5000:01"), (ObjectRef{0x5000, 1})) << "whether it is there is the access's question";
}

TEST(ClientNames, WhatNamesNothingIsToldWithAHint) {
  const Names names(dictionary());
  for (const char* text : {"", ":", "1018:", ":01", "10188:01", "1018:001", "101g", "1018:01:02", " 1018", "h", "0x",
                           "Axis.", ".Speed", "Axis.Torque", "-1", "1018 :1"}) {
    const auto found = names.find(text);
    ASSERT_FALSE(found.has_value()) << text;
    EXPECT_FALSE(found.error().ambiguous);
    EXPECT_EQ(found.error().what, "no object is called \"" + std::string(text) + "\"");
  }
  EXPECT_EQ(names.find("axis.SPEED").error().what, "no object is called \"axis.SPEED\"; there is \"Axis.Speed\"");
}

TEST(ClientNames, ANameOfSeveralIsRefusedWithThese) {
  const Names names(dictionary());
  const auto found = names.find("Position");
  ASSERT_FALSE(found.has_value());
  EXPECT_TRUE(found.error().ambiguous);
  EXPECT_EQ(
      found.error().what,
      "2 objects are called \"Position\": 2104h:01 \"Axis.Position\", 2105h:01 \"Other axis.Position\"; use one of "
      "these");
}

TEST(ClientNames, ANameGoesBeforeAnIndex) {
  od::DescriptionBuilder b;
  b.variable(0x2000, {.name = "1018"});
  b.object(0x2001, od::ObjectCode::record, "a.b");
  b.sub(0x2001, {.sub = 1, .name = "c"});
  b.object(0x2002, od::ObjectCode::record, "a");
  b.sub(0x2002, {.sub = 1, .name = "b.c"});
  const Names names(b.build());
  EXPECT_EQ(names.find("1018"), (ObjectRef{0x2000, 0}));
  EXPECT_TRUE(names.find("a.b.c").error().ambiguous) << "dots in names do not decide";
  EXPECT_EQ(names.find("c"), (ObjectRef{0x2001, 1}));
}

TEST(ClientNames, Labels) {
  const Names names(dictionary());
  EXPECT_EQ(names.label({0x2104, 2}), "object 2104h:02 \"Axis.Speed\"");
  EXPECT_EQ(names.label({0x2100, 0}), "object 2100h:00 \"Limited\"");
  EXPECT_EQ(names.label({0x2100, 1}), "object 2100h:01");
  EXPECT_EQ(names.label({0x5FFF, 0}), "object 5FFFh:00");
}

}  // namespace
}  // namespace berth::client::test
