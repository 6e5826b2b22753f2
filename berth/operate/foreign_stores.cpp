#include "berth/operate/foreign_stores.hpp"

#include "berth/lss/frames.hpp"

namespace berth::operate {

ForeignStores::ForeignStores(can::Dispatcher& dispatcher, rt::Duration store_timeout) : store_timeout_(store_timeout) {
  dispatcher.add(can::only(lss::master_cob_id), *this);
}

// This master's own requests do not come back to it.
void ForeignStores::received(const can::Frame& frame, rt::Time at) noexcept {
  const bool stores = frame.size > 0 && lss::command(frame) == lss::Command::store;
  if (stores) end_ = at + store_timeout_;
}

}  // namespace berth::operate
