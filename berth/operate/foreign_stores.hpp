/// LSS store commands (17h) of other LSS masters on this bus: of the previous master, or of a tool. A device that is
/// still storing answers that master. The answer names no request (CiA 305, store configuration), so it looks like one
/// to this master's own 17h. Therefore this master stores nothing before `end`.
#pragma once

#include <algorithm>

#include "berth/can/dispatcher.hpp"
#include "berth/rt/executor.hpp"

namespace berth::operate {

class ForeignStores final : private can::Handler {
 public:
  /// `store_timeout`: how long a device may take to store.
  ForeignStores(can::Dispatcher& dispatcher, rt::Duration store_timeout);

  /// A store command of an earlier Berth run is complete by then.
  void earlier_run_stores_until(rt::Time end) noexcept { end_ = std::max(end_, end); }
  /// After this time no answer comes to a 17h of another master or an earlier run.
  [[nodiscard]] rt::Time end() const noexcept { return end_; }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override;

  rt::Duration store_timeout_;
  rt::Time end_{};
};

}  // namespace berth::operate
