/// Watches for other nodes that send with this node's identifiers (SX.7): those of its SDO answers, its error control
/// and its EMCYs, and of SYNC and TIME if it produces them. A frame from another node raises 8150h "CAN-ID collision".
/// `co::Pdos` watches those of TPDOs.
#pragma once

#include "berth/co/nmt_slave.hpp"
#include "berth/device/errors.hpp"
#include "berth/od/values.hpp"

namespace berth::device {

class OwnIdentifiers final : private can::Handler, private od::Hook {
 public:
  class Owner {
   public:
    /// Another node sent with an identifier of this one; the error has been raised.
    virtual void doubled() noexcept = 0;

   protected:
    ~Owner() = default;
  };
  /// `on`: whether it listens at all. All must outlive it.
  OwnIdentifiers(can::Dispatcher& dispatcher, od::Values& values, const co::NmtSlave& nmt, Errors& errors, Owner& owner,
                 bool on);

  /// A node-ID is in use: listens to the identifiers in the objects, and follows their changes.
  void listen() noexcept;
  void stop() noexcept { dispatcher_->remove(*this); }

 private:
  template <class Visit>
  void for_each(const Visit& visit) const noexcept;
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void written(od::Values&, ObjectRef) noexcept override { listen(); }

  can::Dispatcher* dispatcher_;
  od::Values* values_;
  const co::NmtSlave* nmt_;
  Errors* errors_;
  Owner* owner_;
  bool on_;
};

}  // namespace berth::device
