// What is stored, by itself: no network side, no hooks.
#include <gtest/gtest.h>
#include <array>
#include <memory>

#include "berth/od/stored_values.hpp"

namespace {

using namespace berth;
using namespace berth::od;

std::shared_ptr<const Description> device() {
  DescriptionBuilder b;
  b.variable(0x1014, {.name = "COB-ID EMCY", .type = DataType::unsigned32, .initial = Literal::node_id_plus(0x80)});
  b.variable(0x2000, {.name = "Limited",
                      .type = DataType::integer16,
                      .access = Access::ro,
                      .initial = Literal::number(5),
                      .high = Literal::number(10)});
  b.variable(0x2002, {.name = "Text", .type = DataType::visible_string, .capacity = 8});
  return b.build();
}

TEST(OdStored, AccessTypeAndLimitsAreTheNetworks) {
  StoredValues v(device(), NodeId(5));
  EXPECT_EQ(v.set({0x2000, 0}, 1000), AbortCode::none);
  EXPECT_EQ(*v.get<int>({0x2000, 0}), 1000);
  EXPECT_EQ(v.set({0x2000, 0}, 40000), AbortCode::value_too_high);
  EXPECT_EQ(v.set({0x4711, 0}, 1), AbortCode::no_object);
  EXPECT_EQ(v.set({0x2000, 1}, 1), AbortCode::no_sub_index);
}

TEST(OdStored, NeverAWrongLength) {
  StoredValues v(device(), NodeId(5));
  const std::array<std::uint8_t, 9> bytes{};
  EXPECT_EQ(v.set_bytes({0x2000, 0}, std::span(bytes).first(1)), AbortCode::length_too_low);
  EXPECT_EQ(v.set_bytes({0x2000, 0}, std::span(bytes).first(3)), AbortCode::length_too_high);
  EXPECT_EQ(v.set_bytes({0x2002, 0}, bytes), AbortCode::length_too_high);
  EXPECT_EQ(v.set_text({0x2002, 0}, "eight ch"), AbortCode::none);
  EXPECT_EQ(v.get_text({0x2002, 0}), "eight ch");
}

TEST(OdStored, AResetRestoresItsAreaForTheNewNodeId) {
  StoredValues v(device(), NodeId(5));
  EXPECT_EQ(*v.get<std::uint32_t>({0x1014, 0}), 0x85U);
  v.set({0x2000, 0}, 7);
  v.reset(NodeId(9), Area::communication);
  EXPECT_EQ(*v.get<std::uint32_t>({0x1014, 0}), 0x89U);
  EXPECT_EQ(*v.get<int>({0x2000, 0}), 7);
  v.reset(NodeId(9), Area::application);
  EXPECT_EQ(*v.get<int>({0x2000, 0}), 5);
}

}  // namespace
