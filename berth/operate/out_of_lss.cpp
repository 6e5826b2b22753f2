#include "berth/operate/out_of_lss.hpp"

namespace berth::operate {

void OutOfLss::in_vain(const Identity& device, rt::Time now) {
  InVain& each = devices_[device];
  each = {each.times + 1, now};
}

bool OutOfLss::contains(const Identity& device, std::optional<rt::Time> booted, rt::Time now) const {
  const auto it = devices_.find(device);
  if (it == devices_.end() || it->second.times < tries) return false;
  const bool anew = booted && *booted > it->second.last;
  return !anew && now - it->second.last < asked_anew;
}

}  // namespace berth::operate
