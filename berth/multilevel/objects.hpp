/// The objects of a gateway that paper 3 needs without giving an index (S3.9, S3.10, S3.12, S3.22): Berth has them in
/// the manufacturer-specific area, once for each bus beneath the gateway (docs/multilevel.md §Objects).
#pragma once

#include <bitset>
#include <cstdint>

#include "berth/base/ids.hpp"
#include "berth/multilevel/emcy_layout.hpp"
#include "berth/od/description.hpp"
#include "berth/od/values.hpp"

namespace berth::multilevel {

/// The three objects of the SDO gateway for one bus beneath (paper 3 Figure 11).
struct SdoGatewayObjects {
  ObjectRef node{};     ///< UNSIGNED8: downstream node-ID
  ObjectRef data{};     ///< DOMAIN
  ObjectRef command{};  ///< UNSIGNED32: command specifier in bits 7..0, index in 23..8, sub-index in 31..24

  /// `port` 1..8: 5F30h to 5F32h, 5F34h to 5F36h, ...
  [[nodiscard]] static constexpr SdoGatewayObjects of(unsigned port) noexcept {
    const auto first = static_cast<std::uint16_t>(first_index + 4 * (port - 1));
    return {{first, 0}, {static_cast<std::uint16_t>(first + 1), 0}, {static_cast<std::uint16_t>(first + 2), 0}};
  }
  static constexpr std::uint16_t first_index = 0x5F30;
  static constexpr std::uint16_t last_index = 0x5F4F;
  /// An access to such an object goes through a gateway itself.
  [[nodiscard]] static constexpr bool contain(ObjectRef ref) noexcept {
    return ref.index >= first_index && ref.index <= last_index;
  }
};

/// 5F03h: 7, 8 or 9 if a client has chosen the layout of emergencies; 0: the gateway's own. 5F04h: nodes beneath whose
/// emergencies use it.
void add_emcy_layout(od::DescriptionBuilder& builder);
/// The layout in 5F03h of the upstream dictionary, else `own`.
[[nodiscard]] EmcyLayout emcy_layout_of(const od::Values& upper, EmcyLayout own) noexcept;
/// By 5F04h.
[[nodiscard]] std::bitset<128> layout_speakers_of(const od::Values& upper) noexcept;

/// Adds the three objects for this bus beneath.
void add_sdo_gateway(od::DescriptionBuilder& builder, unsigned port = 1);

}  // namespace berth::multilevel
