#include "berth/multilevel/objects.hpp"

namespace berth::multilevel {

using od::DataType;
using od::Literal;

void add_sdo_gateway(od::DescriptionBuilder& builder, unsigned port) {
  const auto objects = SdoGatewayObjects::of(port);
  builder.variable(objects.node.index,
                   {.name = "Downstream node-ID", .type = DataType::unsigned8, .initial = Literal::number(0)});
  builder.variable(objects.data.index, {.name = "Downstream data", .type = DataType::domain, .capacity = 8});
  builder.variable(objects.command.index,
                   {.name = "Downstream command specifier and multiplexer", .initial = Literal::number(0)});
}

}  // namespace berth::multilevel
