// Objects by name.
#include "berth/od/names.hpp"
#include "tests/pch.hpp"

namespace berth::od {
namespace {

std::shared_ptr<const Description> pump() {
  DescriptionBuilder builder;
  builder.variable(0x1017, {.name = "Producer heartbeat time", .type = DataType::unsigned16});
  builder.object(0x1018, ObjectCode::record, "Identity object");
  builder.sub(0x1018, {.sub = 0, .name = "Number of entries", .type = DataType::unsigned8});
  builder.sub(0x1018, {.sub = 1, .name = "Vendor-ID"});
  builder.sub(0x1018, {.sub = 4, .name = "Serial number"});
  builder.object(0x2000, ObjectCode::array, "Speed");
  builder.sub(0x2000, {.sub = 1, .name = "Set"});
  builder.sub(0x2000, {.sub = 2, .name = "Actual"});
  builder.object(0x2001, ObjectCode::array, "Torque");
  builder.sub(0x2001, {.sub = 1, .name = "Set"});
  builder.variable(0x2002, {.name = "Supply 24 V/5 V \"main\"", .type = DataType::unsigned8});
  builder.variable(0x2003, {.name = "⚙️ Getriebe/Übersetzung", .type = DataType::unsigned8});
  builder.variable(0x2004, {.name = "mode", .type = DataType::unsigned8});
  builder.variable(0x2005, {.name = "Mode", .type = DataType::unsigned8});
  builder.variable(0x2006, {.name = "Mode of operation", .type = DataType::unsigned8});
  return builder.build();
}

using Found = std::vector<NamedObject>;

TEST(Names, OfObjectsAndSubObjects) {
  const auto d = pump();
  EXPECT_EQ(find_named(*d, "Producer heartbeat time"), (Found{{0x1017, std::nullopt}}));
  EXPECT_EQ(find_named(*d, "Serial number"), (Found{{0x1018, 4}}));
  EXPECT_EQ(find_named(*d, "Identity object/Serial number"), (Found{{0x1018, 4}}));
  EXPECT_EQ(find_named(*d, "Identity object.Serial number"), (Found{{0x1018, 4}})) << "as `berth trace` prints it";
  EXPECT_EQ(find_named(*d, "Identity object"), (Found{{0x1018, std::nullopt}}));
}

TEST(Names, UniquePrefixesInEitherCase) {
  const auto d = pump();
  EXPECT_EQ(find_named(*d, "prod"), (Found{{0x1017, std::nullopt}}));
  EXPECT_EQ(find_named(*d, "ident/ser"), (Found{{0x1018, 4}}));
  EXPECT_EQ(find_named(*d, "SPEED/set"), (Found{{0x2000, 1}}));
  EXPECT_EQ(find_named(*d, "nothing"), Found{});
  EXPECT_EQ(find_named(*d, ""), Found{});
  EXPECT_EQ(find_named(*d, "/"), Found{});
  EXPECT_EQ(find_named(*d, "Speed/"), Found{});
  EXPECT_EQ(find_named(*d, "heartbeat"), Found{}) << "a prefix, no part";
}

TEST(Names, AmbiguousOnesAreAllGiven) {
  const auto d = pump();
  EXPECT_EQ(find_named(*d, "Set"), (Found{{0x2000, 1}, {0x2001, 1}}));
  EXPECT_EQ(find_named(*d, "se"), (Found{{0x1018, 4}, {0x2000, 1}, {0x2001, 1}}));
}

TEST(Names, TheBestMatchCounts) {
  const auto d = pump();
  EXPECT_EQ(find_named(*d, "Mode"), (Found{{0x2005, std::nullopt}})) << "exactly, before either case and prefixes";
  EXPECT_EQ(find_named(*d, "MODE"), (Found{{0x2004, std::nullopt}, {0x2005, std::nullopt}}));
  EXPECT_EQ(find_named(*d, "mode o"), (Found{{0x2006, std::nullopt}}));
}

TEST(Names, WithQuotesSlashesAndEmoji) {
  const auto d = pump();
  EXPECT_EQ(find_named(*d, "Supply 24 V/5 V \"main\""), (Found{{0x2002, std::nullopt}}));
  EXPECT_EQ(find_named(*d, "⚙️ Getriebe/Übersetzung"), (Found{{0x2003, std::nullopt}}));
  EXPECT_EQ(full_name(*d, {0x2003, 0}), "⚙️ Getriebe/Übersetzung");
  EXPECT_EQ(full_name(*d, {0x1018, 4}), "Identity object/Serial number");
  EXPECT_EQ(full_name(*d, {0x1018, 3}), "");
  EXPECT_EQ(full_name(*d, {0x3000, 0}), "");
}

// Whatever the names are: what is printed finds the object, alone unless another is called the same.
RC_GTEST_PROP(Names, WhatIsPrintedIsFound, ()) {
  const auto name = rc::gen::container<std::string>(rc::gen::element('a', 'B', '/', '.', ' ', '"', '\xC3', '9'));
  const auto names = *rc::gen::container<std::vector<std::string>>(12, name);
  DescriptionBuilder builder;
  std::vector<ObjectRef> all;
  for (std::uint16_t i = 0; i < 4; ++i) {
    const auto index = static_cast<std::uint16_t>(0x2000 + i);
    if (i % 2 == 0) {
      builder.variable(index, {.name = names[i * 3U], .type = DataType::unsigned8});
      all.push_back({index, 0});
      continue;
    }
    builder.object(index, ObjectCode::record, names[i * 3U]);
    for (std::uint8_t sub = 1; sub < 3; ++sub) {
      builder.sub(index, {.sub = sub, .name = names[i * 3U + sub], .type = DataType::unsigned8});
      all.push_back({index, sub});
    }
  }
  const auto d = builder.build();
  for (const ObjectRef ref : all) {
    const std::string printed = full_name(*d, ref);
    if (printed.empty()) continue;
    const auto found = find_named(*d, printed);
    RC_ASSERT(std::ranges::any_of(found, [&](const NamedObject& o) { return o.ref() == ref; }));
  }
}

}  // namespace
}  // namespace berth::od
