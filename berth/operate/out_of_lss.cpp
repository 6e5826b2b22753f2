#include "berth/operate/out_of_lss.hpp"

namespace berth::operate {

void OutOfLss::in_vain(const Identity& device) {
  InVain& each = devices_[device];
  each = {each.times + 1, s_.executor.now()};
}

bool OutOfLss::contains(const Identity& device, NodeId uses) const {
  const auto it = devices_.find(device);
  if (it == devices_.end() || it->second.times < tries) return false;
  const auto booted = s_.boots.boot_up(uses);
  const bool anew = booted && *booted > it->second.last;
  return !anew && s_.executor.now() - it->second.last < asked_anew;
}

}  // namespace berth::operate
