/// Questions to one node-ID by SDO and guarding, and to one LSS address.
#pragma once

#include <optional>

#include "berth/lss/select_alone.hpp"
#include "berth/operate/found_devices.hpp"
#include "berth/operate/slot_table.hpp"
#include "berth/places/identity.hpp"

namespace berth::operate {

/// The device has no serial number, and another device has the same LSS address: one that is in its slot and present,
/// or one that was found. All of them obey a request to that address. `own`: the device itself is the one with this
/// node-ID.
[[nodiscard]] bool has_equals(const SlotTable& slots, const FoundDevices& found, const Identity& device,
                              std::optional<NodeId> own = {});

/// Its LSS address is unknown or shared with other devices: LSS cannot give it a node-ID.
[[nodiscard]] bool has_no_address(const SlotTable& slots, const FoundDevices& found, const Identity& device);

class Asking {
 public:
  Asking(BusServices& services, SlotTable& slots, FoundDevices& found) noexcept
      : s_(services), slots_(slots), found_(found) {}

  /// For asking whether a device is there. Silence is the expected answer, so the timeout is short and no abort is
  /// sent. A node that was heard to answer later gets the time that it needed (`co::SdoPatience`).
  [[nodiscard]] co::SdoOptions patience(unsigned retries) const;
  /// For the first question to a node-ID that should have a device and was not heard: the usual SDO timeout, so that a
  /// slow device is not missed. Silence is not aborted.
  [[nodiscard]] co::SdoOptions first_patience() const;
  /// How many first questions at once take at most half of the bus.
  [[nodiscard]] std::size_t most_first_at_once() const noexcept;
  /// How many questions at once leave room on the bus for answers, even if most stay unanswered.
  [[nodiscard]] std::size_t most_at_once() const noexcept;
  /// LSS with pauses, so that a device with a single receive buffer loses no frame.
  [[nodiscard]] lss::MasterOptions with_pauses() const;

  /// True: a device answers SDO under this node-ID. If it answers neither SDO nor guarding, the node-ID is vacant.
  rt::Task<bool> answers_at(NodeId id);
  /// The same, for a scope.
  rt::Task<void> vacancy(NodeId id);

  /// Of the slots and the devices found here.
  [[nodiscard]] bool has_equals(const Identity& device, std::optional<NodeId> own = {}) const {
    return operate::has_equals(slots_, found_, device, own);
  }
  /// The node-ID that the device with this address uses now, by LSS; every other device is in LSS waiting meanwhile.
  /// Errors: `timeout` no device has this address, or it has equals; `duplicate` two have; those of the bus. The turn
  /// must be held.
  rt::Task<Result<NodeId>> active_id(Identity device);
  /// Once, without pauses.
  rt::Task<Result<NodeId>> active_id_once(Identity device);
  /// The address parts to ask to prove that the selected device is alone: any address seen here may be in LSS
  /// configuration.
  [[nodiscard]] lss::PartMask parts_to_ask(const Identity& device) const;
  /// Puts this device alone into LSS configuration state. Errors: `timeout` absent; `mismatch` not alone; `duplicate`
  /// two devices have its address. The turn must be held.
  rt::Task<Result<void>> select_alone(Identity device);

  /// For `places::Binder`, and for `places::RecipeBinder`.
  [[nodiscard]] places::Binder::Services binder_services() const noexcept;
  [[nodiscard]] places::Binder::Options binder_options() const;

 private:
  [[nodiscard]] bool may_be_doubled(const Identity& device) const;
  BusServices& s_;
  SlotTable& slots_;
  FoundDevices& found_;
};

}  // namespace berth::operate
