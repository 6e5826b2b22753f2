/// The reports of a network list's master on its node-IDs: object 5F0Bh of its dictionary (docs/manager-objects.md).
///
///     5F0Bh:n    n a node-ID of the list: bits 7..0 `NodeIdTrouble`, bits 63..32 the serial number of the device that
///                it is about, 0 where none is known. Written 0: a person says that the device for which the node-ID
///                is kept is gone for good
///     5F0Bh:80h  read-only: bits 7..0 how many devices were found that have no place, bits 63..32 the serial number of
///                the first
///     5F0Bh:81h  read-only: bit n - 1 is set while 5F0Bh:n, n from 1 to 64, tells more than that its device is there
///                or that nobody was found
///     5F0Bh:82h  the same of 65 to 127, bit n - 65
///
/// Refused: another value (0609 0030h); while the node-ID is kept for no device that is away (0800 0022h).
#pragma once

#include <array>
#include <functional>
#include <span>

#include "berth/manager/list_bus.hpp"
#include "berth/manager/node_id_source.hpp"

namespace berth::manager {

class NodeIdReport final : private od::Hook {
 public:
  static constexpr std::uint16_t object = NodeIdSource::object;
  static constexpr std::uint8_t surplus = 0x80;   ///< sub-index
  static constexpr std::uint8_t troubled = 0x81;  ///< sub-index of the first 64; the next has the others

  /// `forget`: frees the node-ID; false: it is not kept.
  NodeIdReport(od::Values& values, std::function<bool(NodeId)> forget);

  void begin() noexcept { told_ = {}; }
  void tell(NodeId node, NodeIdTrouble trouble, std::uint32_t serial) noexcept;
  void tell_surplus(std::span<const Identity> devices) noexcept;
  [[nodiscard]] std::uint64_t told(std::uint8_t sub) const noexcept { return sub < told_.size() ? told_[sub] : 0; }

 private:
  od::AbortCode reading(const od::Values& values, ObjectRef ref,
                        std::span<const std::uint8_t>& value) noexcept override;
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;

  std::function<bool(NodeId)> forget_;
  std::array<std::uint64_t, 131> told_{};
  std::array<std::uint8_t, 8> shown_{};
};

}  // namespace berth::manager
