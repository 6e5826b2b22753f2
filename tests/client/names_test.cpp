// Objects by name.
#include <gtest/gtest.h>
#include <string>

#include "../pch.hpp"
#include "berth/od/names.hpp"
#include "rig.hpp"

namespace berth::client::test {
namespace {

TEST(ClientNames, EachWayToNameAnObject) {
  const Names names(dictionary());
  const ObjectRef vendor{0x1018, 1};
  for (const char* text : {"1018h:01", "1018h:01h", "0x1018:0x1", "0X1018:01", "1018h/1", "1018sub1"}) {
    EXPECT_EQ(names.find(text), vendor) << text;
  }
  EXPECT_EQ(names.find(vendor), vendor);
  EXPECT_EQ(names.find("1000h"), (ObjectRef{0x1000, 0}));
  EXPECT_EQ(names.find("Axis/Speed"), (ObjectRef{0x2104, 2}));
  EXPECT_EQ(names.find("Axis.Speed"), (ObjectRef{0x2104, 2}));
  EXPECT_EQ(names.find("axis/SPEED"), (ObjectRef{0x2104, 2}));
  EXPECT_EQ(names.find("Ax/Sp"), (ObjectRef{0x2104, 2}));
  EXPECT_EQ(names.find("Speed"), (ObjectRef{0x2104, 2})) << "no other sub-object is called so";
  EXPECT_EQ(names.find("Limited"), (ObjectRef{0x2100, 0}));
  EXPECT_EQ(names.find(std::string("Other axis/Position")), (ObjectRef{0x2105, 1}));
  EXPECT_EQ(names.find("5000h:01"), (ObjectRef{0x5000, 1})) << "whether it is there is the access's question";
}

TEST(ClientNames, WhatNamesNothingIsToldWithAHint) {
  const Names names(dictionary());
  for (const char* text : {"", ":", ":01", "101g", "0x", ".Speed", "-1"}) {
    const auto found = names.find(text);
    ASSERT_FALSE(found.has_value()) << text;
    EXPECT_EQ(found.error().kind, od::NoObject::Kind::other) << text;
    EXPECT_EQ(found.error().why, "no object is called \"" + std::string(text) + "\"");
  }
  EXPECT_EQ(names.find("Limitde").error().why, "no object is called \"Limitde\"; did you mean \"Limited\"?");
  EXPECT_EQ(names.find("Axis/Torque").error().why,
            "\"Axis\" has no part \"Torque\"; it has 2104h:01 Position, 2104h:02 Speed");
  EXPECT_EQ(names.find("HER ax").error().why, "no object is called \"HER ax\"; names with this word: 2105h Other axis");
  EXPECT_EQ(names.find("1018").error().why,
            "\"1018\" is 1018h or, read as a decimal number, 03FAh: write the one that is meant");
}

TEST(ClientNames, ANameOfSeveralIsRefusedWithThese) {
  const Names names(dictionary());
  const auto found = names.find("Position");
  ASSERT_FALSE(found.has_value());
  EXPECT_EQ(found.error().kind, od::NoObject::Kind::several);
  EXPECT_EQ(found.error().why,
            "2 objects are called \"Position\": 2104h:01 Axis/Position, 2105h:01 Other axis/Position");
}

// The table of whole names is a short way and no second notation.
TEST(ClientNames, MeanWhatTheyMeanToTheCommands) {
  od::DescriptionBuilder b;
  b.variable(0x2000, {.name = "1018"});
  b.object(0x2001, od::ObjectCode::record, "a.b");
  b.sub(0x2001, {.sub = 1, .name = "c"});
  b.object(0x2002, od::ObjectCode::record, "a");
  b.sub(0x2002, {.sub = 1, .name = "b.c"});
  b.variable(0x2003, {.name = "1000h"});
  b.object(0x2004, od::ObjectCode::record, "c");
  const auto description = b.build();
  const Names names(description);
  for (const char* text : {"1018", "1000h", "a.b.c", "a/b.c", "a.b", "a", "b.c", "c", "C", "A/B.C", "x", ""}) {
    const auto meant = od::find_object(*description, text);
    const auto found = names.find(text);
    ASSERT_EQ(found.has_value(), meant.has_value()) << text;
    if (meant) {
      EXPECT_EQ(*found, *meant) << text;
    } else {
      EXPECT_EQ(found.error().why, meant.error().why) << text;
    }
  }
  EXPECT_EQ(names.find("1000h"), (ObjectRef{0x1000, 0})) << "an index goes before a name";
  EXPECT_EQ(names.find("a/b.c"), (ObjectRef{0x2002, 1}));
  EXPECT_EQ(names.find("a.b.c").error().kind, od::NoObject::Kind::several) << "dots in names do not decide";
}

TEST(ClientNames, Labels) {
  const Names names(dictionary());
  EXPECT_EQ(names.label({0x2104, 2}), "object 2104h:02 \"Axis/Speed\"");
  EXPECT_EQ(names.label({0x2100, 0}), "object 2100h:00 \"Limited\"");
  EXPECT_EQ(names.label({0x2100, 1}), "object 2100h:01");
  EXPECT_EQ(names.label({0x5FFF, 0}), "object 5FFFh:00");
}

}  // namespace
}  // namespace berth::client::test
