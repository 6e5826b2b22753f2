/// Devices whose memory has no node-ID any more and that use the one that they had until they are switched off and on.
/// A slot of that node-ID waits with them: what two devices answer at once is nobody's answer.
#pragma once

#include <map>
#include <string>

#include "berth/base/ids.hpp"
#include "berth/places/plan.hpp"

namespace berth::operate {

class ErasedNodeIds {
 public:
  /// The device confirmed that its memory has no node-ID; it uses this one.
  void note(const Identity& device, NodeId uses) { devices_[device] = {uses}; }
  /// It was switched off and on, or left. What it used; unconfigured: it was not noted.
  NodeId forget(const Identity& device);
  /// It is told to give its node-ID up again now and then only (`tells_again`). `active`: what it uses now.
  [[nodiscard]] bool rests(const Identity& device, NodeId active, bool& told_one) noexcept;
  [[nodiscard]] bool uses(const Identity& device, NodeId id) const noexcept;
  [[nodiscard]] bool contains(const Identity& device) const noexcept { return devices_.contains(device); }
  /// Null: none of them uses this node-ID.
  [[nodiscard]] const Identity* user_of(NodeId id) const noexcept;
  /// Is a device that waits for its power cycle told again at this look at it? Seldom, and more seldom the longer it
  /// waits, for its memory's sake; and one device in a round, as the others of the bus wait for that. `looks`: so far;
  /// `told_one`: in this round.
  [[nodiscard]] static bool tells_again(unsigned& looks, bool& told_one) noexcept;
  /// One that may sit in this slot when it was switched off and on. Null: none.
  [[nodiscard]] const Identity* waits_for(const places::SlotSpec& slot) const noexcept;
  /// Why a slot waits for this device: for people.
  [[nodiscard]] static std::string reason(const Identity& device);

 private:
  static bool is_time(unsigned look) noexcept { return look >= 8 && (look & (look - 1)) == 0; }
  struct Device {
    NodeId uses;
    unsigned looked_at = 0;
  };
  std::map<Identity, Device> devices_;
};

}  // namespace berth::operate
