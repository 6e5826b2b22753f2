/// Devices whose memory no longer holds a node-ID, but which use the old one until they are switched off and on. A slot
/// of that node-ID waits for them: answers that two devices send at once are useless.
#pragma once

#include <map>
#include <string>

#include "berth/base/ids.hpp"
#include "berth/places/plan.hpp"

namespace berth::operate {

class ErasedNodeIds {
 public:
  /// The device confirmed that its memory holds no node-ID; it still uses this one.
  void note(const Identity& device, NodeId uses) { devices_[device] = {uses}; }
  /// It was switched off and on, or left. Returns the node-ID it used; unconfigured: it was not noted.
  NodeId forget(const Identity& device);
  /// True: the device is not told again this time to give up its node-ID (`tells_again`). `active`: what it uses now.
  [[nodiscard]] bool rests(const Identity& device, NodeId active, bool& told_one) noexcept;
  [[nodiscard]] bool uses(const Identity& device, NodeId id) const noexcept;
  [[nodiscard]] bool contains(const Identity& device) const noexcept { return devices_.contains(device); }
  /// Null: none of them uses this node-ID.
  [[nodiscard]] const Identity* user_of(NodeId id) const noexcept;
  /// Whether a device that waits for its power cycle is told again at this look. Rarely, and more rarely the longer it
  /// waits, to spare its memory; and only one device a round, because the others on the bus wait meanwhile. `looks`: so
  /// far; `told_one`: in this round.
  [[nodiscard]] static bool tells_again(unsigned& looks, bool& told_one) noexcept;
  /// One that may sit in this slot after a power cycle. Null: none.
  [[nodiscard]] const Identity* waits_for(const places::SlotSpec& slot) const noexcept;
  /// For users: why a slot waits for this device.
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
