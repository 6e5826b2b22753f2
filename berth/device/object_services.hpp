/// The services of CiA 301 that a device has only when its dictionary has their objects. Made by
/// `Device::make_services`.
#pragma once

#include <cstddef>
#include <memory>

#include "berth/co/emcy_list.hpp"
#include "berth/co/nmt.hpp"
#include "berth/co/pdo.hpp"
#include "berth/co/sync.hpp"
#include "berth/co/time_stamp.hpp"

namespace berth::device {

/// Each is null without its objects.
struct ObjectServices {
  std::unique_ptr<co::Pdos> pdos;           ///< 1400h to 1BFFh
  std::unique_ptr<co::Sync> sync;           ///< 1005h
  std::unique_ptr<co::TimeStamp> time;      ///< 1012h
  std::unique_ptr<co::EmcyList> emcy_list;  ///< 1028h

  /// The device enters an NMT state that has the services `now`, from one that had `was`.
  void change(const co::Services& was, const co::Services& now, NodeId id) noexcept;
  [[nodiscard]] std::size_t memory() const noexcept;
};

}  // namespace berth::device
