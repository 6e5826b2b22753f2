/// Questions that change nothing: whether a device answers under a node-ID (SDO and guarding), and which node-ID the
/// device of an LSS address uses (LSS). What every master asks before it gives a node-ID, or takes one away.
#pragma once

#include "berth/places/binder.hpp"

namespace berth::places {

class Inquiry {
 public:
  explicit Inquiry(const Binder::Services& services) noexcept : s_(services) {}

  /// True: a device answers SDO under this node-ID (1000h). Where SDO and guarding are silent the node-ID is vacant
  /// (`Binder::Services::vacancy`). `how`: for the SDO question.
  [[nodiscard]] rt::Task<bool> answers_at(NodeId id, co::SdoOptions how, rt::Duration guard_timeout);

  /// The node-ID that the device with this address uses now; every other device is in LSS waiting meanwhile. Errors:
  /// `timeout` no device has this address; `duplicate` two have; those of the bus. LSS belongs to this task.
  /// Of a device that does not tell it (5Eh) the one under which it answers SDO.
  /// `whole`: every window is listened to until its end, because a second device of the address may be there.
  [[nodiscard]] rt::Task<Result<NodeId>> active_id_once(LssAddress device, bool whole);
  /// The same, and when it is silent once more with `pause` between the frames: a single-slot receive buffer loses what
  /// comes back to back. The pauses stay (`lss::MasterOptions::inhibit`) where they have helped.
  [[nodiscard]] rt::Task<Result<NodeId>> active_id(LssAddress device, bool whole, rt::Duration pause);

  /// The node-ID under which a device of this LSS address answers SDO; unconfigured: under none. Every node-ID is asked
  /// that is not known to be vacant.
  [[nodiscard]] rt::Task<NodeId> where_it_answers(LssAddress device);

 private:
  rt::Task<void> look_at(NodeId id, LssAddress device, NodeId& found);
  Binder::Services s_;
};

}  // namespace berth::places
