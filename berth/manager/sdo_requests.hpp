/// The SDO manager of a device by its own dictionary (docs/sdo-manager.md §Objects): any node can request a channel by
/// SDO. CiA 302-5 has objects with these numbers; their content is not public, and this one is Berth's.
///
///     1F00h         request SDO, UNSIGNED32 written: bits 7 to 0 client, 15 to 8 server, 31 to 16 lease in s
///                   (0: the default)
///     1F01h         release SDO, UNSIGNED32 written: bits 7 to 0 client, 15 to 8 server
///     1F10h:CLIENT  dynamic SDO connection state, UNSIGNED32 read: the client's last request: bits 7 to 0
///                   0 none, 1 under way, 2 connected, 3 failed, 4 released; 15 to 8 server; 31 to 16 the client's
///                   object (1280h ff.) with its CAN-IDs
///
/// Refused: 0800 0022 this device is not the active master, or too many requests wait; 0609 0030 not two node-IDs.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>

#include "berth/manager/sdo_manager.hpp"
#include "berth/od/values.hpp"

namespace berth::manager {

class SdoRequests final : private od::Hook {
 public:
  enum class State : std::uint8_t { none, under_way, connected, failed, released };

  /// All must outlive this.
  SdoRequests(can::Dispatcher& dispatcher, co::SdoClient& sdo, od::Values& values);

  /// The device is the active master of these nodes: reads what an earlier manager left.
  void begin(SdoManagerOptions options);
  /// Alternative: `begin` at the first request, with the result of this function; empty: this device is not the active
  /// master now, and the request is refused.
  using Begin = std::function<std::optional<SdoManagerOptions>()>;
  void begin_when_asked(Begin options) { when_asked_ = std::move(options); }
  /// The device is no longer the active master. Connections stay.
  void end() noexcept;
  /// Null while the device is not the active master.
  [[nodiscard]] const SdoManager* manager() const noexcept { return manager_ ? &*manager_ : nullptr; }
  /// The same, after beginning if possible: for requests of the device itself.
  [[nodiscard]] SdoManager* manager_for_request();

 private:
  struct Last {
    State state = State::none;
    std::uint8_t server = 0;
    std::uint16_t object = 0;
  };
  od::AbortCode reading(const od::Values& values, ObjectRef ref,
                        std::span<const std::uint8_t>& value) noexcept override;
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  rt::Task<void> recover();
  rt::Task<void> connect(NodeId client, NodeId server, rt::Duration lease);
  rt::Task<void> release(NodeId client, NodeId server);

  can::Dispatcher* dispatcher_;
  co::SdoClient* sdo_;
  Begin when_asked_;
  std::optional<SdoManager> manager_;
  std::array<Last, 128> last_{};
  std::array<std::uint8_t, 4> shown_{};
  rt::Scope scope_;  // the last member: its tasks use the others
};
/// 1F00h, 1F01h, 1F10h for clients up to `most`.
void add_sdo_manager_objects(od::DescriptionBuilder& builder, std::uint8_t most);

}  // namespace berth::manager
