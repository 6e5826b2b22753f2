// The dictionary of a device without a description file.
#include <array>

#include "berth/device/device.hpp"

namespace berth::device {

const std::shared_ptr<const od::Description>& minimal_description() {
  using od::Access;
  using od::DataType;
  using od::Literal;
  static const auto description = [] {
    od::DescriptionBuilder b;
    b.variable(0x1000, {.name = "Device type", .access = Access::ro, .initial = Literal::number(0)});
    b.variable(0x1001, {.name = "Error register",
                        .type = DataType::unsigned8,
                        .access = Access::ro,
                        .mappable = true,
                        .initial = Literal::number(0)});
    b.object(0x1003, od::ObjectCode::array, "Pre-defined error field");
    b.sub(0x1003, {.sub = 0, .name = "Number of errors", .type = DataType::unsigned8, .initial = Literal::number(0)});
    for (std::uint8_t i = 1; i <= 8; ++i)
      b.sub(0x1003, {.sub = i, .name = "Standard error field", .access = Access::ro});
    b.variable(0x1008, {.name = "Manufacturer device name",
                        .type = DataType::visible_string,
                        .access = Access::constant,
                        .initial = Literal::text("Berth simulated device"),
                        .capacity = 64});
    b.variable(0x100C, {.name = "Guard time", .type = DataType::unsigned16, .initial = Literal::number(0)});
    b.variable(0x100D, {.name = "Life time factor", .type = DataType::unsigned8, .initial = Literal::number(0)});
    b.variable(0x1014, {.name = "COB-ID EMCY", .initial = Literal::node_id_plus(0x80)});
    b.variable(0x1015, {.name = "Inhibit time EMCY", .type = DataType::unsigned16, .initial = Literal::number(0)});
    b.object(0x1016, od::ObjectCode::array, "Consumer heartbeat time");
    for (std::uint8_t i = 1; i <= 8; ++i) {
      b.sub(0x1016, {.sub = i, .name = "Consumer heartbeat time", .initial = Literal::number(0)});
    }
    b.variable(0x1017,
               {.name = "Producer heartbeat time", .type = DataType::unsigned16, .initial = Literal::number(0)});
    b.object(0x1018, od::ObjectCode::record, "Identity object", DataType::identity);
    const std::array<std::string_view, 4> parts{"Vendor-ID", "Product code", "Revision number", "Serial number"};
    for (std::uint8_t i = 1; i <= 4; ++i) {
      b.sub(0x1018, {.sub = i, .name = parts[i - 1U], .access = Access::ro, .initial = Literal::number(0)});
    }
    b.object(0x1029, od::ObjectCode::array, "Error behaviour");
    b.sub(0x1029,
          {.sub = 1, .name = "Communication error", .type = DataType::unsigned8, .initial = Literal::number(0)});
    b.object(0x1200, od::ObjectCode::record, "SDO server parameter", DataType::sdo_parameter);
    b.sub(0x1200,
          {.sub = 1, .name = "COB-ID client to server", .access = Access::ro, .initial = Literal::node_id_plus(0x600)});
    b.sub(0x1200,
          {.sub = 2, .name = "COB-ID server to client", .access = Access::ro, .initial = Literal::node_id_plus(0x580)});
    return b.build();
  }();
  return description;
}

}  // namespace berth::device
