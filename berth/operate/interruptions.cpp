#include "berth/operate/interruptions.hpp"

namespace berth::operate {

bool Interruptions::allow(rt::Time now, const discovery::Progress& here, rt::Duration within) noexcept {
  const bool got_on = !last_ || here.kind != last_->kind || here.is_beyond(*last_);
  if (got_on) last_ = here;
  if (got_on || now >= counted_until_) {
    count_ = 0;
    counted_until_ = now + within;
  }
  if (count_ == most) return false;
  ++count_;
  return true;
}

void Interruptions::search_ended() noexcept { last_.reset(); }

}  // namespace berth::operate
