/// LSS store commands (17h) of other LSS masters on this bus: of the master that this one takes over from, or of a
/// tool. A device that is still storing answers that master, and the answer looks like one to this master's own 17h,
/// because it names no request (CiA 305, store configuration). So this master stores nothing before `end`.
#pragma once

#include <algorithm>

#include "berth/can/dispatcher.hpp"
#include "berth/rt/executor.hpp"

namespace berth::operate {

class ForeignStores final : private can::Handler {
 public:
  /// `store_timeout`: how long a device may take to store.
  ForeignStores(can::Dispatcher& dispatcher, rt::Duration store_timeout);

  /// What an earlier run of this Berth told a device to store is stored then.
  void earlier_run_stores_until(rt::Time end) noexcept { end_ = std::max(end_, end); }
  /// No answer to another master's 17h, or to one of an earlier run, comes later.
  [[nodiscard]] rt::Time end() const noexcept { return end_; }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override;

  rt::Duration store_timeout_;
  rt::Time end_{};
};

}  // namespace berth::operate
