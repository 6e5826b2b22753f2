/// The PDOs of a device, and what may be changed in them. Internal to room `linker`.
#pragma once

#include <cstdint>
#include <vector>

#include "berth/co/cob_id.hpp"
#include "berth/co/pdo_mapping.hpp"
#include "berth/linker/network.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::linker {

inline constexpr std::uint32_t cob_id_invalid = co::CobId::invalid_bit;
inline constexpr unsigned mpdo_bits = 32;
inline constexpr std::uint8_t sam_mpdo = 254;

/// One PDO of a description.
struct DevicePdo {
  std::uint16_t number = 0;  ///< from 1
  bool kept = false;         ///< set by the existing configuration: left unchanged
  bool fixed_mapping = false;
  bool fixed_id = false;
  bool fixed_type = false;
  bool valid = false;        ///< at present
  std::uint32_t can_id = 0;  ///< at present; 29 bits and more: not of a base frame
  unsigned most_entries = 0;
  TransmissionType type = at_change;  ///< at present
  std::uint16_t inhibit = 0;          ///< at present, in 100 us
  std::uint16_t event_ms = 0;         ///< at present
  bool has_inhibit = false;
  bool has_event = false;
  std::vector<co::PdoEntry> mapping = {};  ///< at present
};

struct DevicePdos {
  std::vector<DevicePdo> tpdos;
  std::vector<DevicePdo> rpdos;
  unsigned granularity = 8;                   ///< bits; entries are multiples of it
  unsigned scanner = 0;                       ///< existing entries of the MPDO scanner list
  unsigned dispatching = 0;                   ///< entries of the MPDO dispatching list
  std::vector<unsigned> dummies = {};         ///< data types that may be mapped as dummies, longest first
  std::vector<std::uint32_t> other_ids = {};  ///< CAN-IDs of SYNC, TIME, EMCY and further SDO channels

  [[nodiscard]] const std::vector<DevicePdo>& of(co::PdoKind kind) const noexcept {
    return kind == co::PdoKind::tpdo ? tpdos : rpdos;
  }
  /// The linker may set its mapping and CAN-ID.
  [[nodiscard]] static bool free(const DevicePdo& pdo) noexcept {
    return !pdo.kept && !pdo.fixed_mapping && !(pdo.fixed_id && !pdo.valid);
  }
  [[nodiscard]] const DevicePdo* find(co::PdoKind kind, unsigned number) const noexcept;
};

[[nodiscard]] DevicePdos pdos_of(const Node& node);

/// True when the object lies in a segment of [DynamicChannels].
[[nodiscard]] bool is_dynamic(const eds::File& file, std::uint16_t index) noexcept;

}  // namespace berth::linker
