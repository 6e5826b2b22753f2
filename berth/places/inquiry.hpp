/// Questions that change nothing: whether a device answers under a node-ID (SDO and guarding), and which node-ID the
/// device with an LSS address uses (LSS). Every master asks them before it gives a node-ID or takes one away.
#pragma once

#include "berth/places/binder.hpp"

namespace berth::places {

class Inquiry {
 public:
  explicit Inquiry(const Binder::Services& services) noexcept : s_(services) {}

  /// True: a device answers SDO under this node-ID (1000h). If SDO and guarding are silent, the node-ID is vacant
  /// (`Binder::Services::vacancy`). `how`: for the SDO question.
  [[nodiscard]] rt::Task<bool> answers_at(NodeId id, co::SdoOptions how, rt::Duration guard_timeout);

  /// The node-ID that the device with this address uses; every other device is in LSS waiting meanwhile. Errors:
  /// `timeout` no device has this address; `duplicate` two have; those of the bus. LSS belongs to this task. If the
  /// device does not answer 5Eh: the node-ID under which it answers SDO. `whole`: listen to the end of every window,
  /// because a second device with the address may exist.
  [[nodiscard]] rt::Task<Result<NodeId>> active_id_once(LssAddress device, bool whole);
  /// The same; if it is silent, again with `pause` between the frames: a single-slot receive buffer loses consecutive
  /// frames. The pauses stay (`lss::MasterOptions::inhibit`) if they helped.
  [[nodiscard]] rt::Task<Result<NodeId>> active_id(LssAddress device, bool whole, rt::Duration pause);

  /// The node-ID under which a device with this LSS address answers SDO; unconfigured: none. Asks every node-ID that is
  /// not known to be vacant.
  [[nodiscard]] rt::Task<NodeId> where_it_answers(LssAddress device);

 private:
  rt::Task<void> look_at(NodeId id, LssAddress device, NodeId& found);
  Binder::Services s_;
};

}  // namespace berth::places
