#include "berth/multilevel/objects.hpp"

#include "berth/od/paper3.hpp"

namespace berth::multilevel {

using od::DataType;
using od::Literal;

// These objects are commands, not settings: no configuration sets them, none is stored, and accesses through the
// gateway do not change its own configuration (1020h).
void add_sdo_gateway(od::DescriptionBuilder& builder, unsigned port) {
  const auto objects = SdoGatewayObjects::of(port);
  builder.variable(objects.node.index, {.name = "Downstream node-ID",
                                        .type = DataType::unsigned8,
                                        .initial = Literal::number(0),
                                        .obj_flags = od::refuse_write_on_download});
  builder.variable(objects.data.index, {.name = "Downstream data", .type = DataType::domain, .capacity = 8});
  builder.variable(objects.command.index, {.name = "Downstream command specifier and multiplexer",
                                           .initial = Literal::number(0),
                                           .obj_flags = od::refuse_write_on_download});
}

void add_emcy_layout(od::DescriptionBuilder& builder) {
  builder.variable(
      od::paper3::emcy_layout.index,
      {.name = "EMCY layout", .type = DataType::unsigned8, .initial = Literal::number(0), .high = Literal::number(9)});
  builder.object(od::paper3::layout_speakers, od::ObjectCode::array, "Nodes with the EMCY layout");
  for (std::uint8_t sub = 1; sub <= 4; ++sub) {
    builder.sub(od::paper3::layout_speakers,
                {.sub = sub, .name = "Nodes with the EMCY layout", .initial = Literal::number(0)});
  }
}

std::bitset<128> layout_speakers_of(const od::Values& upper) noexcept {
  std::bitset<128> all;
  for (unsigned node = 0; node < all.size(); ++node) {
    const auto sub = static_cast<std::uint8_t>(1 + node / 32);
    const auto bits = upper.get_or<std::uint32_t>({od::paper3::layout_speakers, sub}, 0U);
    all.set(node, (bits >> node % 32 & 1U) != 0);
  }
  return all;
}

EmcyLayout emcy_layout_of(const od::Values& upper, EmcyLayout own) noexcept {
  const auto value = upper.get_or<std::uint8_t>(od::paper3::emcy_layout, std::uint8_t{0});
  return value >= 7 && value <= 9 ? static_cast<EmcyLayout>(value) : own;
}

}  // namespace berth::multilevel
