/// Objects that paper 3 (H. Saha: Multilevel CANopen networks) requires without an index, or with an index that is
/// another object's. Berth puts them in the manufacturer-specific area (docs/multilevel.md §Objects). Those of the SDO
/// gateway and of signals are in room `multilevel`; the ones here are also used in rooms below and beside it.
#pragma once

#include <cstdint>

#include "berth/base/ids.hpp"

namespace berth::od::paper3 {

/// UNSIGNED8 of a gateway, sub-index = its port: the bus below is optional (0) or mandatory (1). S3.9.
inline constexpr std::uint16_t mandatory_buses = 0x5F00;
/// UNSIGNED32 of any device: its hardware version as a number. S3.10.
inline constexpr ObjectRef hardware_version{0x5F01, 0};
/// UNSIGNED32 of a master, sub-index = node-ID: the hardware version expected of that node; 0: any. S3.10.
inline constexpr std::uint16_t expected_hardware = 0x5F02;
/// UNSIGNED8 of a gateway: the layout of its emergencies, by the paper's figure 7, 8 or 9; 0: the gateway chooses. One
/// layout applies to a whole machine. S3.16.
inline constexpr ObjectRef emcy_layout{0x5F03, 0};

/// UNSIGNED32 of a gateway, sub-indices 1 to 4: nodes below it whose emergencies have that layout too; bit n of
/// sub-index s is node 32 (s - 1) + n. For all others only code and register are forwarded upstream. S3.18.
inline constexpr std::uint16_t layout_speakers = 0x5F04;

/// Not in the paper. UNSIGNED32 of a master that assigns node-IDs, sub-indices 1 to 4: node-IDs fixed by their devices
/// (switches, a plug), which the master assigns to no device; bit n of sub-index s is node 32 (s - 1) + n.
inline constexpr std::uint16_t fixed_node_ids = 0x5F05;

}  // namespace berth::od::paper3
