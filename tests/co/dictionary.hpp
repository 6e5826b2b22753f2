// The object dictionary that the SDO tests serve.
#pragma once

#include <cstdint>

#include "berth/od/values.hpp"

namespace berth::test {

inline std::shared_ptr<const od::Description> test_description() {
  using od::Access;
  using od::DataType;
  using od::Literal;
  od::DescriptionBuilder b;
  b.variable(0x1000, {.name = "Device type", .access = Access::ro, .initial = Literal::number(0x00020192)});
  b.variable(0x1008, {.name = "Device name",
                      .type = DataType::visible_string,
                      .access = Access::constant,
                      .initial = Literal::text("Tiny Node - Mega Domains !")});
  b.object(0x1018, od::ObjectCode::record, "Identity");
  for (std::uint8_t sub = 1; sub <= 4; ++sub) {
    b.sub(0x1018, {.sub = sub, .name = "id", .access = Access::ro, .initial = Literal::number(0x11111111U * sub)});
  }
  b.variable(0x2000, {.name = "U8", .type = DataType::unsigned8});
  b.variable(0x2001,
             {.name = "U16", .type = DataType::unsigned16, .low = Literal::number(10), .high = Literal::number(100)});
  b.variable(0x2002, {.name = "write only", .access = Access::wo});
  b.variable(0x2003, {.name = "text", .type = DataType::visible_string, .capacity = 2000});
  b.variable(0x2004, {.name = "domain", .type = DataType::domain, .capacity = 4000});
  b.variable(0x2005, {.name = "I64", .type = DataType::integer64});
  b.object(0x2006, od::ObjectCode::array, "array");
  for (const auto sub : {std::uint8_t{1}, std::uint8_t{2}, std::uint8_t{4}})
    b.sub(0x2006, {.sub = sub, .name = "e", .type = DataType::unsigned8});
  b.variable(0x2007, {.name = "octets", .type = DataType::octet_string, .capacity = 20});
  b.variable(0x2008, {.name = "refused"});
  return b.build();
}

// Refuses every access to 2008h with the code it holds.
struct Refuser final : od::Hook {
  od::AbortCode reading(const od::Values&, ObjectRef, std::span<const std::uint8_t>&) noexcept override { return code; }
  od::AbortCode writing(const od::Values&, ObjectRef, std::span<const std::uint8_t>) noexcept override { return code; }
  od::AbortCode code = od::AbortCode::device_state;
};

}  // namespace berth::test
