/// Dictionaries made in code: the objects of CiA 301 that nearly every device has, so that a device maker only adds the
/// device's own. Room `eds` makes the same from a description file. An object added later replaces an earlier one.
///
///     od::DescriptionBuilder b;
///     device::add_device(b, {.name = "Thermometer"});
///     device::add_storage(b);
///     b.variable(0x2000, {.name = "Temperature", .type = od::DataType::integer16, .access = od::Access::ro,
///                         .mappable = true});
///     device::add_tpdo(b, 1, {.map = {{{0x2000, 0}, 16}}, .inhibit_100us = 100});
///     auto description = b.build();
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "berth/co/pdo_mapping.hpp"
#include "berth/od/description.hpp"

namespace berth::device {

struct DeviceObjects {
  std::uint32_t type = 0;  ///< 1000h: profile number in bits 15..0
  std::string_view name = "Berth simulated device";
  std::string_view hardware_version = {};  ///< 1009h; empty: no such object
  std::string_view software_version = {};  ///< 100Ah
  std::uint8_t errors_kept = 8;            ///< 1003h, 1..16
  std::uint8_t supervised = 8;             ///< 1016h, 1..127 entries
  std::uint16_t heartbeat_ms = 0;          ///< 1017h
};
/// 1000h, 1001h, 1003h, 1008h, (1009h, 100Ah), 100Ch, 100Dh, 1014h..1018h, 1029h, 1200h.
void add_device(od::DescriptionBuilder& builder, const DeviceObjects& objects = {});
/// 1010h and 1011h with sub-indices 1..4, 1020h. Call it before computing `memory_size` for the `Device`.
void add_storage(od::DescriptionBuilder& builder);
/// 1005h, 1006h, 1007h, 1019h: a consumer of SYNC 080h; 1005h bit 30 makes it a producer.
void add_sync(od::DescriptionBuilder& builder);

/// A PDO with 8 places for mapping entries, more when `map` is longer. The first four of each kind have their
/// predefined identifiers; all others are not valid until they get one.
struct PdoObjects {
  std::vector<co::PdoEntry> map = {};  ///< mapped objects: object, sub-index, bits
  std::uint8_t type = 0xFF;            ///< transmission type
  std::uint16_t inhibit_100us = 0;     ///< TPDO
  std::uint16_t event_timer_ms = 0;    ///< TPDO: longest time between two; RPDO: deadline
};
/// `number` 1..512.
void add_tpdo(od::DescriptionBuilder& builder, unsigned number, const PdoObjects& pdo);
void add_rpdo(od::DescriptionBuilder& builder, unsigned number, const PdoObjects& pdo);

/// The dictionary of a device without a description file: `add_device` alone. One for the whole process.
[[nodiscard]] const std::shared_ptr<const od::Description>& minimal_description();

}  // namespace berth::device
