#include "berth/od/values.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace {

using namespace berth;
using namespace berth::od;
using Bytes = std::vector<std::uint8_t>;

std::shared_ptr<const Description> value_device() {
  DescriptionBuilder b;
  b.variable(
      0x1000,
      {.name = "Device type", .type = DataType::unsigned32, .access = Access::ro, .initial = Literal::number(0x20192)});
  b.variable(0x1014, {.name = "COB-ID EMCY", .type = DataType::unsigned32, .initial = Literal::node_id_plus(0x80)});
  b.variable(0x1017, {.name = "Heartbeat", .type = DataType::unsigned16});
  b.object(0x1018, ObjectCode::record, "Identity");
  for (const std::uint8_t sub : std::array<std::uint8_t, 3>{1, 2, 4}) {  // 3 is a gap
    b.sub(0x1018, {.sub = sub, .name = "part", .type = DataType::unsigned32, .access = Access::ro});
  }
  b.variable(0x1008, {.name = "Name",
                      .type = DataType::visible_string,
                      .access = Access::constant,
                      .initial = Literal::text("probe")});
  b.variable(0x2000, {.name = "Limited",
                      .type = DataType::integer16,
                      .initial = Literal::number(5),
                      .low = Literal::number(static_cast<std::uint64_t>(-10)),
                      .high = Literal::number(10)});
  b.variable(0x2001, {.name = "Command", .type = DataType::unsigned8, .access = Access::wo});
  b.variable(0x2002, {.name = "Text", .type = DataType::visible_string, .capacity = 8});
  b.variable(0x2003, {.name = "File", .type = DataType::domain});
  b.variable(0x2004, {.name = "Flag", .type = DataType::boolean});
  b.variable(
      0x2005,
      {.name = "Upside down", .type = DataType::unsigned8, .low = Literal::number(9), .high = Literal::number(3)});
  b.variable(0x2006, {.name = "Real",
                      .type = DataType::real32,
                      .low = Literal::real(DataType::real32, -1),
                      .high = Literal::real(DataType::real32, 1)});
  b.variable(0x2007, {.name = "From the node-ID", .type = DataType::unsigned8, .low = Literal::node_id_plus(1)});
  b.variable(0x2008, {.name = "Wide", .type = DataType::unicode_string});
  b.variable(0x6000, {.name = "Big", .type = DataType::unsigned64});
  return b.build();
}

AbortCode write(Values& values, ObjectRef ref, const Bytes& bytes) { return values.write(ref, bytes); }
std::uint32_t hex(AbortCode code) { return static_cast<std::uint32_t>(code); }

// HC1.S18: the codes that a conformance test expects of a dictionary.
TEST(OdAccess, HC1_S18_AbortCodesOfAccess) {
  Values v(value_device(), NodeId(5));
  Bytes buffer(16);
  EXPECT_EQ(hex(v.read({0x3000, 0}, buffer).error()), 0x06020000U);
  EXPECT_EQ(hex(v.read({0x1018, 3}, buffer).error()), 0x06090011U) << "a gap";
  EXPECT_EQ(hex(v.read({0x1018, 5}, buffer).error()), 0x06090011U);
  EXPECT_EQ(hex(v.read({0x1018, 0xFF}, buffer).error()), 0x06090011U);
  EXPECT_EQ(hex(v.read({0x1000, 1}, buffer).error()), 0x06090011U) << "a VAR has only sub-index 0";
  EXPECT_EQ(hex(v.read({0x2001, 0}, buffer).error()), 0x06010001U);
  EXPECT_EQ(hex(v.size({0x2001, 0}).error()), 0x06010001U);
  EXPECT_EQ(hex(write(v, {0x1000, 0}, {1, 0, 0, 0})), 0x06010002U);
  EXPECT_EQ(hex(write(v, {0x1008, 0}, {1})), 0x06010002U);
  EXPECT_EQ(hex(write(v, {0x1018, 0}, {1})), 0x06010002U) << "sub-index 0";
  EXPECT_EQ(hex(write(v, {0x3000, 0}, {1})), 0x06020000U);
  EXPECT_EQ(hex(write(v, {0x1018, 3}, {1})), 0x06090011U);
  EXPECT_EQ(hex(v.check_write({0x1018, 3}, 4)), 0x06090011U);
  EXPECT_EQ(hex(v.check_write({0x1000, 0})), 0x06010002U);
  EXPECT_EQ(hex(v.check_write({0x1017, 0})), 0U);
}

// HC1.S17: lengths; 0-byte objects; an object larger than the caller's buffer.
TEST(OdAccess, HC1_S17_Lengths) {
  Values v(value_device(), NodeId(5));
  EXPECT_EQ(hex(write(v, {0x1017, 0}, {1, 2, 3})), 0x06070012U);
  EXPECT_EQ(hex(write(v, {0x1017, 0}, {1})), 0x06070013U);
  EXPECT_EQ(hex(write(v, {0x1017, 0}, {})), 0x06070013U);
  EXPECT_EQ(hex(v.check_write({0x1017, 0}, 4)), 0x06070012U);
  EXPECT_EQ(hex(write(v, {0x2002, 0}, Bytes(9, 'x'))), 0x06070012U);
  EXPECT_EQ(hex(write(v, {0x2002, 0}, Bytes(8, 'x'))), 0U);
  EXPECT_EQ(*v.size({0x2002, 0}), 8U);
  EXPECT_EQ(hex(write(v, {0x2002, 0}, {})), 0U);
  EXPECT_EQ(*v.size({0x2002, 0}), 0U);
  EXPECT_EQ(hex(write(v, {0x2008, 0}, {1, 2, 3})), 0x06070010U) << "UNICODE_STRING of odd length";
  Bytes small(3);
  EXPECT_EQ(hex(v.read({0x1000, 0}, small).error()), 0x05040005U);
  EXPECT_EQ(*v.length_of_unsized({0x1017, 0}, 4), 2U);
  EXPECT_EQ(*v.length_of_unsized({0x2002, 0}, 4), 4U);
  EXPECT_EQ(hex(v.length_of_unsized({0x6000, 0}, 4).error()), 0x06070013U);
}

// A string or DOMAIN whose description gives no length has none that a write could exceed: what does not fit is the
// device's memory (0504 0005), not the description (0607 0012).
TEST(OdAccess, HC1_S17_WithoutADescribedLengthTheMemoryEnds) {
  DescriptionBuilder b;
  b.variable(0x2000, {.type = DataType::visible_string});
  b.variable(0x2001, {.type = DataType::visible_string, .initial = Literal::text("four")});
  b.variable(0x2002, {.type = DataType::domain});
  b.variable(0x2003, {.type = DataType::visible_string, .capacity = 300});
  Values v(b.build());
  for (const std::uint16_t text : {std::uint16_t{0x2000}, std::uint16_t{0x2001}}) {
    EXPECT_EQ(hex(write(v, {text, 0}, Bytes(250, 'x'))), 0U) << "more than any name takes";
    EXPECT_EQ(hex(v.check_write({text, 0}, 100'000)), 0x05040005U);
    EXPECT_EQ(hex(write(v, {text, 0}, Bytes(100'000, 'x'))), 0x05040005U);
  }
  EXPECT_EQ(hex(write(v, {0x2002, 0}, Bytes(10'000, 1))), 0U);
  EXPECT_EQ(hex(write(v, {0x2002, 0}, Bytes(1'000'000, 1))), 0x05040005U);
  EXPECT_EQ(hex(write(v, {0x2003, 0}, Bytes(301, 1))), 0x06070012U) << "described";
}

// A description with very many of them does not take very much memory for each.
TEST(OdAccess, TheRoomForValuesWithoutADescribedLengthIsBounded) {
  DescriptionBuilder b;
  for (unsigned i = 0; i < 2000; ++i) b.variable(static_cast<std::uint16_t>(0x2000 + i), {.type = DataType::domain});
  EXPECT_LT(b.build()->value_bytes(), 2U << 20U);
}

// HU.17: limits are in the dictionary and must be enforced.
TEST(OdAccess, LimitsAreEnforced) {
  Values v(value_device(), NodeId(5));
  EXPECT_EQ(hex(write(v, {0x2000, 0}, {10, 0})), 0U);
  EXPECT_EQ(hex(write(v, {0x2000, 0}, {11, 0})), 0x06090031U);
  EXPECT_EQ(hex(write(v, {0x2000, 0}, {0xF6, 0xFF})), 0U) << "-10";
  EXPECT_EQ(hex(write(v, {0x2000, 0}, {0xF5, 0xFF})), 0x06090032U) << "-11";
  EXPECT_EQ(*v.get<std::int16_t>({0x2000, 0}), -10) << "a refused write changes nothing";
  EXPECT_EQ(hex(write(v, {0x2004, 0}, {2})), 0x06090030U) << "BOOLEAN";
  EXPECT_EQ(hex(write(v, {0x2004, 0}, {1})), 0U);
  EXPECT_EQ(hex(write(v, {0x2005, 0}, {5})), 0x06090036U);
  EXPECT_EQ(hex(write(v, {0x2006, 0}, {0, 0, 0xC0, 0x7F})), 0x06090030U) << "NaN is within no limits";
  EXPECT_EQ(hex(write(v, {0x2006, 0}, {0, 0, 0, 0x40})), 0x06090031U) << "2.0";
  EXPECT_EQ(hex(write(v, {0x2007, 0}, {5})), 0x06090032U) << "limit $NODEID+1 is 6";
  EXPECT_EQ(hex(write(v, {0x2007, 0}, {6})), 0U);
}

// HC1.S17, HC1.S18: no data available.
TEST(OdAccess, DomainWithoutValueHasNoData) {
  Values v(value_device());
  EXPECT_EQ(hex(v.size({0x2003, 0}).error()), 0x08000024U);
  EXPECT_EQ(hex(write(v, {0x2003, 0}, {})), 0U);
  EXPECT_EQ(*v.size({0x2003, 0}), 0U);
  v.reset(NodeId(5));
  EXPECT_EQ(hex(v.size({0x2003, 0}).error()), 0x08000024U);
}

TEST(OdAccess, SubIndexZeroOfRecords) {
  Values v(value_device());
  EXPECT_EQ(*v.get<std::uint8_t>({0x1018, 0}), 4) << "highest sub-index, not the number of them";
}

TEST(OdReset, NodeIdDefaultsAndAreas) {
  Values v(value_device());
  EXPECT_EQ(*v.get<std::uint32_t>({0x1014, 0}), 0x80U) << "unconfigured";
  v.reset(NodeId(7));
  EXPECT_EQ(*v.get<std::uint32_t>({0x1014, 0}), 0x87U);
  const auto change = [&] {
    EXPECT_EQ(hex(v.set({0x1017, 0}, 500)), 0U);
    EXPECT_EQ(hex(v.set({0x2000, 0}, -3)), 0U);
    EXPECT_EQ(hex(v.set({0x6000, 0}, 3)), 0U);
    EXPECT_EQ(hex(v.set({0x1014, 0}, 0x99U)), 0U);
  };
  change();
  v.reset(NodeId(8), Area::communication);
  EXPECT_EQ(*v.get<std::uint16_t>({0x1017, 0}), 0);
  EXPECT_EQ(*v.get<std::uint32_t>({0x1014, 0}), 0x88U);
  EXPECT_EQ(*v.get<std::int16_t>({0x2000, 0}), -3);
  EXPECT_EQ(*v.get<std::uint64_t>({0x6000, 0}), 3U);
  change();
  v.reset(NodeId(9), Area::application);
  EXPECT_EQ(*v.get<std::uint16_t>({0x1017, 0}), 500);
  EXPECT_EQ(*v.get<std::uint32_t>({0x1014, 0}), 0x99U);
  EXPECT_EQ(*v.get<std::int16_t>({0x2000, 0}), 5);
  EXPECT_EQ(*v.get<std::uint64_t>({0x6000, 0}), 0U);
}

TEST(OdLocal, TypedAccess) {
  Values v(value_device(), NodeId(5));
  EXPECT_EQ(*v.get<std::uint32_t>({0x1000, 0}), 0x20192U);
  EXPECT_EQ(*v.get<std::uint64_t>({0x1000, 0}), 0x20192U) << "wider is fine";
  EXPECT_EQ(*v.get<std::int64_t>({0x1000, 0}), 0x20192);
  EXPECT_EQ(hex(v.get<std::uint16_t>({0x1000, 0}).error()), 0x06070010U);
  EXPECT_EQ(hex(v.get<std::int32_t>({0x1000, 0}).error()), 0x06070010U) << "half of UNSIGNED32 does not fit";
  EXPECT_EQ(hex(v.get<std::uint32_t>({0x2000, 0}).error()), 0x06070010U);
  EXPECT_EQ(v.get_or<std::uint32_t>({0x4711, 0}, 42), 42U);
  EXPECT_EQ(hex(v.set({0x1017, 0}, 65536)), 0x06090031U);
  EXPECT_EQ(hex(v.set({0x1017, 0}, -1)), 0x06090032U);
  EXPECT_EQ(hex(v.set({0x2000, 0}, -32769)), 0x06090032U);
  EXPECT_EQ(hex(v.set({0x2000, 0}, 32767)), 0U) << "local access is above the limits";
  EXPECT_EQ(hex(v.set({0x2006, 0}, 0.5)), 0U);
  EXPECT_EQ(*v.get<double>({0x2006, 0}), 0.5);
  EXPECT_EQ(*v.get<float>({0x2006, 0}), 0.5F);
  EXPECT_EQ(hex(v.set({0x2006, 0}, 1e300)), 0x06090031U);
  EXPECT_EQ(hex(v.set({0x2004, 0}, true)), 0U);
  EXPECT_TRUE(*v.get<bool>({0x2004, 0}));
  EXPECT_EQ(v.get_text({0x1008, 0}), "probe");
  EXPECT_EQ(hex(v.set_text({0x1008, 0}, "another probe")), 0U);
  EXPECT_EQ(v.get_text({0x1008, 0}), "another probe");
  EXPECT_EQ(hex(v.set({0x1018, 4}, 0xDEADBEEFU)), 0U) << "the device itself writes its read-only objects";
}

class Watcher final : public Hook {
 public:
  std::vector<std::string> calls;
  AbortCode answer = AbortCode::none;
  std::optional<Bytes> supply;
  std::string name;
  explicit Watcher(std::string n = "") : name(std::move(n)) {}

  AbortCode reading(const Values&, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept override {
    calls.push_back(name + "r" + std::to_string(ref.sub));
    if (supply) value = *supply;
    return answer;
  }
  AbortCode writing(const Values&, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override {
    calls.push_back(name + "w" + std::to_string(ref.sub) + ":" + std::to_string(value.size()));
    return answer;
  }
  void written(Values& values, ObjectRef ref) noexcept override {
    calls.push_back(name + "d" + std::to_string(values.bytes(ref)[0]));
  }
};

TEST(OdHooks, SeeRefuseAndSupply) {
  Values v(value_device(), NodeId(5));
  Watcher hook;
  v.attach(hook, 0x1017);
  EXPECT_EQ(hex(write(v, {0x1017, 0}, {1, 2})), 0U);
  EXPECT_EQ(hex(write(v, {0x2002, 0}, {1, 2})), 0U) << "not in its range";
  EXPECT_EQ(hook.calls, (std::vector<std::string>{"w0:2", "d1"}));
  hook.answer = AbortCode::device_state;
  EXPECT_EQ(hex(write(v, {0x1017, 0}, {3, 2})), 0x08000022U);
  EXPECT_EQ(*v.get<std::uint16_t>({0x1017, 0}), 0x0201);
  EXPECT_EQ(hex(v.size({0x1017, 0}).error()), 0x08000022U);
  hook.answer = AbortCode::none;
  hook.supply = Bytes(300, 7);
  EXPECT_EQ(*v.size({0x1017, 0}), 300U);
  EXPECT_EQ(*v.get<std::uint16_t>({0x1017, 0}), 0x0201) << "what is stored is not what the network sees";
  hook.calls.clear();
  EXPECT_EQ(hex(write(v, {0x1017, 0}, {1})), 0x06070013U);
  EXPECT_TRUE(hook.calls.empty()) << "a refused length never reaches the hook";
}

TEST(OdHooks, SupplyForADomainWithoutValue) {
  Values v(value_device());
  Watcher hook;
  hook.supply = Bytes{1, 2, 3};
  v.attach(hook, 0x2003);
  Bytes buffer(8);
  ASSERT_EQ(*v.read({0x2003, 0}, buffer), 3U);
  EXPECT_EQ(buffer[2], 3);
}

TEST(OdHooks, OrderRangesAndLeaving) {
  Watcher outlives("o");
  Values v(value_device(), NodeId(5));
  {
    Watcher first("a");
    Watcher second("b");
    v.attach(first, 0x1000, 0x1FFF);
    v.attach(second, 0x1017);
    v.attach(outlives, 0x1017);
    EXPECT_EQ(hex(write(v, {0x1017, 0}, {9, 0})), 0U);
    EXPECT_EQ(first.calls, (std::vector<std::string>{"aw0:2", "ad9"}));
    EXPECT_EQ(second.calls, (std::vector<std::string>{"bw0:2", "bd9"}));
    first.answer = AbortCode::local_control;
    EXPECT_EQ(hex(write(v, {0x1017, 0}, {9, 0})), 0x08000021U);
    EXPECT_EQ(second.calls.size(), 2U) << "the first refusal ends it";
  }
  outlives.calls.clear();
  EXPECT_EQ(hex(write(v, {0x1017, 0}, {9, 0})), 0U);
  EXPECT_EQ(outlives.calls.size(), 2U);
  Values other(value_device());
  other.attach(outlives, 0x1017);
  EXPECT_EQ(hex(write(v, {0x1017, 0}, {9, 0})), 0U);
  EXPECT_EQ(outlives.calls.size(), 2U) << "a hook belongs to one dictionary";
}

TEST(OdBuilder, LastDefinitionCountsAndOrderIsFree) {
  DescriptionBuilder b;
  b.sub(0x2001, {.sub = 2, .name = "two", .type = DataType::unsigned16});
  b.variable(0x2000, {.name = "first", .type = DataType::unsigned8});
  b.variable(0x2000, {.name = "second", .type = DataType::unsigned32, .initial = Literal::number(77)});
  b.sub(0x2001, {.sub = 1, .name = "one", .type = DataType::unsigned8});
  b.object(0x2001, ObjectCode::array, "list");
  EXPECT_TRUE(b.has(0x2000));
  EXPECT_TRUE(b.has(ObjectRef{0x2001, 2}));
  EXPECT_FALSE(b.has(ObjectRef{0x2001, 3}));
  const auto d = b.build();
  ASSERT_EQ(d->objects().size(), 2U);
  const Object* var = d->find(0x2000);
  ASSERT_NE(var, nullptr);
  EXPECT_EQ(d->name(*var), "second");
  ASSERT_EQ(d->subs(*var).size(), 1U);
  EXPECT_EQ(d->subs(*var)[0].type, DataType::unsigned32);
  EXPECT_EQ(d->default_of(d->subs(*var)[0]), Literal::number(77));
  const Object* list = d->find(0x2001);
  EXPECT_EQ(list->code, ObjectCode::array);
  ASSERT_EQ(d->subs(*list).size(), 3U);
  EXPECT_EQ(d->name(d->subs(*list)[1]), "one");
  EXPECT_EQ(d->name(*list), "list");
  EXPECT_FALSE(b.has(0x2000)) << "the builder is empty afterwards";
}

TEST(OdBuilder, DummiesAndEmptyDescription) {
  DescriptionBuilder b;
  b.dummies(0b1010'0000);
  const auto d = b.build();
  EXPECT_TRUE(d->dummy_mappable(5));
  EXPECT_TRUE(d->dummy_mappable(7));
  EXPECT_FALSE(d->dummy_mappable(6));
  EXPECT_FALSE(d->dummy_mappable(0x13));
  EXPECT_EQ(d->find(0), nullptr);
  Values v(d, NodeId(1));
  v.reset(NodeId(2), Area::communication);
  EXPECT_EQ(hex(v.size({0x1000, 0}).error()), 0x06020000U);
}

/// A model of lookup: whatever objects there are, each is found and nothing else is.
RC_GTEST_PROP(OdBuilder, LookupFindsExactlyWhatIsThere, ()) {
  const auto keys = *rc::gen::container<std::set<std::pair<std::uint16_t, std::uint8_t>>>(
      rc::gen::pair(rc::gen::inRange<std::uint16_t>(0x2000, 0x2020), rc::gen::inRange<std::uint8_t>(0, 6)));
  DescriptionBuilder b;
  for (const auto& [index, sub] : keys) {
    if (!b.has(index)) b.object(index, ObjectCode::deftype, "x");
    b.sub(index, {.sub = sub, .type = DataType::unsigned16, .initial = Literal::number(index * 8U + sub)});
  }
  Values v(b.build());
  for (std::uint16_t index = 0x1FFF; index <= 0x2021; ++index) {
    for (std::uint8_t sub = 0; sub < 8; ++sub) {
      const auto value = v.get<std::uint16_t>({index, sub});
      RC_ASSERT(value.has_value() == keys.contains({index, sub}));
      if (value) RC_ASSERT(*value == static_cast<std::uint16_t>(index * 8U + sub));
    }
  }
}

/// Writes from the network keep the dictionary's promise: accepted values read back equal and lie within the limits.
RC_GTEST_PROP(OdAccess, AcceptedValuesReadBackAndKeepTheLimits, (std::int16_t low, std::int16_t high, Bytes bytes)) {
  DescriptionBuilder b;
  const auto word = [](std::int16_t value) { return static_cast<std::uint64_t>(static_cast<std::int64_t>(value)); };
  b.variable(0x2000,
             {.type = DataType::integer16, .low = Literal::number(word(low)), .high = Literal::number(word(high))});
  Values v(b.build());
  bytes.resize(std::min<std::size_t>(bytes.size(), 3));
  const auto code = v.write({0x2000, 0}, bytes);
  if (bytes.size() != 2) {
    RC_ASSERT(code == (bytes.size() > 2 ? AbortCode::length_too_high : AbortCode::length_too_low));
    return;
  }
  const auto value = static_cast<std::int16_t>(bytes[0] | (bytes[1] << 8));
  RC_ASSERT((code == AbortCode::none) == (low <= high && low <= value && value <= high));
  RC_ASSERT(*v.get<std::int16_t>({0x2000, 0}) == (code == AbortCode::none ? value : 0));
}

}  // namespace
