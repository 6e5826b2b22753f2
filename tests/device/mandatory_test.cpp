// A description without what CiA 301 wants of every device: what is missing, and the description with it.
#include <gtest/gtest.h>
#include <cstdint>
#include <vector>

#include "berth/device/mandatory.hpp"

#include "../pch.hpp"
#include "berth/device/dictionary.hpp"

namespace berth::device::test {
namespace {

using od::DataType;
using od::Literal;
using Refs = std::vector<ObjectRef>;

void add_application(od::DescriptionBuilder& b) {
  b.variable(0x2000, {.name = "Speed",
                      .type = DataType::integer16,
                      .access = od::Access::rww,
                      .mappable = true,
                      .initial = Literal::number(7),
                      .low = Literal::number(2),
                      .high = Literal::number(9),
                      .obj_flags = od::refuse_read_on_scan});
  b.variable(0x2001,
             {.name = "Place", .type = DataType::visible_string, .initial = Literal::text("here"), .capacity = 20});
  b.variable(0x2002, {.name = "Program", .type = DataType::domain});
  b.object(0x2003, od::ObjectCode::array, "Set points", DataType::unsigned32, od::refuse_write_on_download);
  b.sub(0x2003, {.sub = 3, .name = "Third", .initial = Literal::node_id_plus(0x180)});
  b.dummies(1U << 5U | 1U << 6U);
}

void expect_same(const od::Description& a, const od::Description& b, const od::Object& object) {
  const auto* const other = b.find(object.index);
  ASSERT_NE(other, nullptr);
  EXPECT_EQ(other->code, object.code);
  EXPECT_EQ(other->type, object.type);
  EXPECT_EQ(other->obj_flags, object.obj_flags);
  EXPECT_EQ(b.name(*other), a.name(object));
  ASSERT_EQ(other->count, object.count);
  for (const auto& sub : a.subs(object)) {
    SCOPED_TRACE(unsigned{sub.sub});
    const auto* const copy = b.find(*other, sub.sub);
    ASSERT_NE(copy, nullptr);
    EXPECT_EQ(copy->type, sub.type);
    EXPECT_EQ(copy->access, sub.access);
    EXPECT_EQ(copy->mappable, sub.mappable);
    EXPECT_EQ(copy->obj_flags, sub.obj_flags);
    EXPECT_EQ(copy->capacity, sub.capacity);
    EXPECT_EQ(copy->bounded, sub.bounded);
    EXPECT_EQ(b.name(*copy), a.name(sub));
    EXPECT_EQ(b.default_of(*copy), a.default_of(sub));
    ASSERT_EQ(b.limits(*copy) != nullptr, a.limits(sub) != nullptr);
    if (a.limits(sub) == nullptr) continue;
    EXPECT_EQ(b.limits(*copy)->low, a.limits(sub)->low);
    EXPECT_EQ(b.limits(*copy)->high, a.limits(sub)->high);
  }
}

TEST(Mandatory, WhatIsMissing) {
  const auto absent = [](auto add) {
    od::DescriptionBuilder b;
    add(b);
    return mandatory_absent(*b.build());
  };
  EXPECT_EQ(absent(add_application), (Refs{{0x1000, 0}, {0x1001, 0}, {0x1017, 0}, {0x1018, 0}}));
  EXPECT_EQ(absent([](auto& b) { add_device(b); }), Refs{});
  const auto but_heartbeat = [](od::DescriptionBuilder& b) {
    b.variable(0x1000, {}).variable(0x1001, {.type = DataType::unsigned8});
    b.sub(0x1018, {.sub = 1});
  };
  EXPECT_EQ(absent(but_heartbeat), (Refs{{0x1017, 0}}));
  const auto guarded = [&](od::DescriptionBuilder& b) {
    but_heartbeat(b);
    b.variable(0x100C, {.type = DataType::unsigned16}).variable(0x100D, {.type = DataType::unsigned8});
  };
  EXPECT_EQ(absent(guarded), Refs{}) << "guarding is error control too";
  const auto half_guarded = [&](od::DescriptionBuilder& b) {
    but_heartbeat(b);
    b.variable(0x100C, {.type = DataType::unsigned16});
  };
  EXPECT_EQ(absent(half_guarded), (Refs{{0x1017, 0}}));
}

TEST(Mandatory, AllElseStaysAsItWasDescribed) {
  od::DescriptionBuilder b;
  add_application(b);
  const auto described = b.build();
  const auto made = with_mandatory(*described);
  EXPECT_EQ(mandatory_absent(*made), Refs{});
  EXPECT_EQ(made->objects().size(), described->objects().size() + 4);
  for (const auto& object : described->objects()) {
    SCOPED_TRACE(object.index);
    expect_same(*described, *made, object);
  }
  for (std::uint16_t type = 1; type <= 0x1B; ++type) EXPECT_EQ(made->dummy_mappable(type), type == 5 || type == 6);
  for (const std::uint16_t index :
       {std::uint16_t{0x1000}, std::uint16_t{0x1001}, std::uint16_t{0x1017}, std::uint16_t{0x1018}}) {
    SCOPED_TRACE(index);
    expect_same(*minimal_description(), *made, *minimal_description()->find(index));
  }
}

// An identity of a serial number alone gets the vendor-ID, and keeps its own parts.
TEST(Mandatory, AnIdentityGetsItsVendorIdAlone) {
  od::DescriptionBuilder b;
  b.variable(0x1000, {.initial = Literal::number(0x191)}).variable(0x1001, {.type = DataType::unsigned8});
  b.variable(0x1017, {.type = DataType::unsigned16});
  b.sub(0x1018, {.sub = 4, .name = "Own words"});
  const auto described = b.build();
  EXPECT_EQ(mandatory_absent(*described), (Refs{{0x1018, 1}}));
  const auto made = with_mandatory(*described);
  EXPECT_EQ(mandatory_absent(*made), Refs{});
  EXPECT_EQ(made->find(0x1018)->count, 3) << "the count, the vendor-ID and the serial number";
  EXPECT_EQ(made->name(*made->find(ObjectRef{0x1018, 4})), "Own words");
  EXPECT_EQ(made->default_of(*made->find(ObjectRef{0x1000, 0})), Literal::number(0x191));
}

}  // namespace
}  // namespace berth::device::test
