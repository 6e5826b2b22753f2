/// Other SDO clients on a bus where Berth is the master: which node each asks, and how long Berth does not use that
/// node's SDO channel. Both use one channel (600h + node-ID), and each would take the other's answers for its own.
/// Pure.
#pragma once

#include <array>
#include <bitset>
#include <functional>

#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::live {

class OtherClients {
 public:
  /// Time from another client's last request to a node until Berth asks that node again.
  static constexpr rt::Duration pause = std::chrono::milliseconds(500);

  /// Called when another SDO client asks this node for the first time.
  void on_first(std::function<void(NodeId node, const can::Frame& request)> told) { told_ = std::move(told); }
  /// Another client sent this request to a node.
  void asks(const can::Frame& request, rt::Time at) noexcept;
  /// The frame is an SDO request to a node whose channel another client uses.
  [[nodiscard]] bool owns_channel_of(const can::Frame& frame, rt::Time now) const noexcept;

 private:
  std::array<rt::Time, 128> until_{};  // by node-ID
  std::bitset<128> known_;
  std::function<void(NodeId, const can::Frame&)> told_;
};

}  // namespace berth::live
