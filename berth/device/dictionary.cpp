#include "berth/device/dictionary.hpp"

#include <algorithm>
#include <array>

#include "berth/co/cob_id.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::device {
namespace {

using od::Access;
using od::DataType;
using od::DescriptionBuilder;
using od::Literal;

void add_text(DescriptionBuilder& b, std::uint16_t index, std::string_view name, std::string_view text) {
  if (text.empty()) return;
  b.variable(index, {.name = name,
                     .type = DataType::visible_string,
                     .access = Access::constant,
                     .initial = Literal::text(text),
                     .capacity = 64});
}

/// PDOs 1 to 4 get their predefined COB-ID from `offset`; the others are not valid. Bit 30 set: no remote frames.
void add_cob_id(DescriptionBuilder& b, std::uint16_t index, unsigned number, std::uint32_t offset) {
  const bool predefined = number <= 4;
  b.sub(index, {.sub = 1,
                .name = "COB-ID",
                .initial = predefined ? Literal::node_id_plus(offset + 0x100U * (number - 1))
                                      : Literal::number(co::CobId::invalid_bit | (offset & co::CobId::second_bit))});
}

void add_mapping(DescriptionBuilder& b, std::uint16_t index, const std::vector<co::PdoEntry>& map) {
  b.object(index, od::ObjectCode::record, "PDO mapping", DataType::pdo_mapping);
  b.sub(index, {.sub = 0,
                .name = "Number of mapped objects",
                .type = DataType::unsigned8,
                .initial = Literal::number(map.size())});
  const auto places = std::clamp<std::size_t>(map.size(), 8, co::PdoMapping::most_entries);
  for (std::size_t i = 0; i < places; ++i) {
    b.sub(index, {.sub = static_cast<std::uint8_t>(i + 1),
                  .name = "Mapped object",
                  .initial = Literal::number(i < map.size() ? map[i].raw() : 0)});
  }
}

}  // namespace

void add_device(DescriptionBuilder& b, const DeviceObjects& objects) {
  b.variable(0x1000, {.name = "Device type", .access = Access::ro, .initial = Literal::number(objects.type)});
  b.variable(0x1001, {.name = "Error register",
                      .type = DataType::unsigned8,
                      .access = Access::ro,
                      .mappable = true,
                      .initial = Literal::number(0)});
  b.object(0x1003, od::ObjectCode::array, "Pre-defined error field");
  b.sub(0x1003, {.sub = 0, .name = "Number of errors", .type = DataType::unsigned8, .initial = Literal::number(0)});
  for (unsigned i = 1; i <= objects.errors_kept; ++i) {
    b.sub(0x1003, {.sub = static_cast<std::uint8_t>(i), .name = "Standard error field", .access = Access::ro});
  }
  add_text(b, 0x1008, "Manufacturer device name", objects.name);
  add_text(b, 0x1009, "Manufacturer hardware version", objects.hardware_version);
  add_text(b, 0x100A, "Manufacturer software version", objects.software_version);
  b.variable(0x100C, {.name = "Guard time", .type = DataType::unsigned16, .initial = Literal::number(0)});
  b.variable(0x100D, {.name = "Life time factor", .type = DataType::unsigned8, .initial = Literal::number(0)});
  b.variable(0x1014, {.name = "COB-ID EMCY", .initial = Literal::node_id_plus(0x80)});
  b.variable(0x1015, {.name = "Inhibit time EMCY", .type = DataType::unsigned16, .initial = Literal::number(0)});
  b.object(0x1016, od::ObjectCode::array, "Consumer heartbeat time");
  for (unsigned i = 1; i <= objects.supervised; ++i) {
    b.sub(0x1016,
          {.sub = static_cast<std::uint8_t>(i), .name = "Consumer heartbeat time", .initial = Literal::number(0)});
  }
  b.variable(0x1017, {.name = "Producer heartbeat time",
                      .type = DataType::unsigned16,
                      .initial = Literal::number(objects.heartbeat_ms)});
  b.object(0x1018, od::ObjectCode::record, "Identity object", DataType::identity);
  constexpr std::array<std::string_view, 4> parts{"Vendor-ID", "Product code", "Revision number", "Serial number"};
  for (std::uint8_t i = 1; i <= 4; ++i) {
    b.sub(0x1018, {.sub = i, .name = parts[i - 1U], .access = Access::ro, .initial = Literal::number(0)});
  }
  b.object(0x1029, od::ObjectCode::array, "Error behaviour");
  b.sub(0x1029, {.sub = 1, .name = "Communication error", .type = DataType::unsigned8, .initial = Literal::number(0)});
  b.object(0x1200, od::ObjectCode::record, "SDO server parameter", DataType::sdo_parameter);
  b.sub(0x1200,
        {.sub = 1, .name = "COB-ID client to server", .access = Access::ro, .initial = Literal::node_id_plus(0x600)});
  b.sub(0x1200,
        {.sub = 2, .name = "COB-ID server to client", .access = Access::ro, .initial = Literal::node_id_plus(0x580)});
}

void add_storage(DescriptionBuilder& b) {
  constexpr std::array<std::string_view, 4> groups{"All parameters", "Communication parameters",
                                                   "Application parameters", "Manufacturer parameters"};
  for (const auto& [index, name] :
       {std::pair<std::uint16_t, std::string_view>{std::uint16_t{0x1010}, "Store parameters"},
        {std::uint16_t{0x1011}, "Restore default parameters"}}) {
    b.object(index, od::ObjectCode::array, name);
    for (std::size_t i = 1; i <= groups.size(); ++i) {
      b.sub(index, {.sub = static_cast<std::uint8_t>(i), .name = groups[i - 1U], .initial = Literal::number(1)});
    }
  }
  b.object(0x1020, od::ObjectCode::array, "Verify configuration");
  b.sub(0x1020, {.sub = 1, .name = "Configuration date", .initial = Literal::number(0)});
  b.sub(0x1020, {.sub = 2, .name = "Configuration time", .initial = Literal::number(0)});
}

void add_sync(DescriptionBuilder& b) {
  b.variable(0x1005, {.name = "COB-ID SYNC", .initial = Literal::number(co::sync_id)});
  b.variable(0x1006, {.name = "Communication cycle period", .initial = Literal::number(0)});
  b.variable(0x1007, {.name = "Synchronous window length", .initial = Literal::number(0)});
  b.variable(
      0x1019,
      {.name = "Synchronous counter overflow value", .type = DataType::unsigned8, .initial = Literal::number(0)});
}

void add_tpdo(DescriptionBuilder& b, unsigned number, const PdoObjects& pdo) {
  const auto index = od::communication_index(od::PdoKind::tpdo, number);
  b.object(index, od::ObjectCode::record, "TPDO communication parameter", DataType::pdo_communication);
  add_cob_id(b, index, number, co::CobId::second_bit | 0x180U);
  b.sub(index,
        {.sub = 2, .name = "Transmission type", .type = DataType::unsigned8, .initial = Literal::number(pdo.type)});
  b.sub(
      index,
      {.sub = 3, .name = "Inhibit time", .type = DataType::unsigned16, .initial = Literal::number(pdo.inhibit_100us)});
  b.sub(
      index,
      {.sub = 5, .name = "Event timer", .type = DataType::unsigned16, .initial = Literal::number(pdo.event_timer_ms)});
  b.sub(index, {.sub = 6, .name = "SYNC start value", .type = DataType::unsigned8, .initial = Literal::number(0)});
  add_mapping(b, od::mapping_index(od::PdoKind::tpdo, number), pdo.map);
}

void add_rpdo(DescriptionBuilder& b, unsigned number, const PdoObjects& pdo) {
  const auto index = od::communication_index(od::PdoKind::rpdo, number);
  b.object(index, od::ObjectCode::record, "RPDO communication parameter", DataType::pdo_communication);
  add_cob_id(b, index, number, 0x200);
  b.sub(index,
        {.sub = 2, .name = "Transmission type", .type = DataType::unsigned8, .initial = Literal::number(pdo.type)});
  b.sub(
      index,
      {.sub = 5, .name = "Event timer", .type = DataType::unsigned16, .initial = Literal::number(pdo.event_timer_ms)});
  add_mapping(b, od::mapping_index(od::PdoKind::rpdo, number), pdo.map);
}

const std::shared_ptr<const od::Description>& minimal_description() {
  static const auto description = [] {
    DescriptionBuilder b;
    add_device(b);
    return b.build();
  }();
  return description;
}

}  // namespace berth::device
