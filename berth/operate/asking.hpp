/// Questions to one node-ID by SDO and guarding, and to one LSS address.
#pragma once

#include <optional>

#include "berth/lss/select_alone.hpp"
#include "berth/operate/found_devices.hpp"
#include "berth/operate/slot_table.hpp"
#include "berth/places/identity.hpp"

namespace berth::operate {

/// It has no serial number, and another that sits and is there, or was found, has its LSS address, too: what is said to
/// that address all of them do. `own`: a node-ID under which it is no other.
[[nodiscard]] bool has_equals(const SlotTable& slots, const FoundDevices& found, const Identity& device,
                              std::optional<NodeId> own = {});

/// Its LSS address is not known, or is said to others as well: its node-ID is not for LSS to give.
[[nodiscard]] bool has_no_address(const SlotTable& slots, const FoundDevices& found, const Identity& device);

class Asking {
 public:
  Asking(BusServices& services, SlotTable& slots, FoundDevices& found) noexcept
      : s_(services), slots_(slots), found_(found) {}

  /// To ask whether a device is there: silence is the expected answer, so it is not waited for long nor aborted. Of a
  /// node that was heard to answer later than that, as long as for any other of its answers.
  [[nodiscard]] co::SdoOptions patience(NodeId id, unsigned retries) const;
  /// For the first question to a node-ID where a device is to be, and was not heard: it waits as long as any other
  /// question, so that a slow device is not taken for none. Silence is not aborted.
  [[nodiscard]] co::SdoOptions first_patience() const;
  /// So many of those at once that they take half of the bus at most.
  [[nodiscard]] std::size_t most_first_at_once() const noexcept;
  /// So many questions at once that those that stay unanswered leave room on the bus for the answers to the others.
  [[nodiscard]] std::size_t most_at_once() const noexcept;
  /// LSS with pauses, so that a single-slot receive buffer loses none of the frames.
  [[nodiscard]] lss::MasterOptions with_pauses() const;

  /// True: a device answers SDO under this node-ID. Silence of SDO and guarding makes it vacant.
  rt::Task<bool> answers_at(NodeId id);
  /// The same, for a scope.
  rt::Task<void> vacancy(NodeId id);

  /// Of the slots and the devices found here.
  [[nodiscard]] bool has_equals(const Identity& device, std::optional<NodeId> own = {}) const {
    return operate::has_equals(slots_, found_, device, own);
  }
  /// The node-ID that the device with this address uses now, by LSS; every other device in waiting meanwhile. Errors:
  /// `timeout` no device has this address, or it has equals; `duplicate` two have; those of the bus. The turn must be
  /// held.
  rt::Task<Result<NodeId>> active_id(Identity device);
  /// Once, without pauses.
  rt::Task<Result<NodeId>> active_id_once(Identity device);
  /// What proves that the selected device is alone: every address that was seen here may be in LSS configuration.
  [[nodiscard]] lss::PartMask parts_to_ask(const Identity& device) const;
  /// Puts the device into LSS configuration state, where no other is. Errors: `timeout` absent; `mismatch` not alone;
  /// `duplicate` two devices have its address. The turn must be held.
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
