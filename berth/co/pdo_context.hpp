/// Shared by the PDOs of one device: port, values, timer, SYNC window. Each PDO has a pointer to it and does not know
/// the set that it is in.
#pragma once

#include "berth/can/dispatcher.hpp"
#include "berth/co/pdo_faults.hpp"
#include "berth/co/pdo_mapping.hpp"
#include "berth/od/values.hpp"

namespace berth::co {

class Tpdo;
class SamProducer;

/// Implemented by the application. May call `event`, `changed` and the values; must not destroy or stop the PDOs.
class PdoObserver {
 public:
  /// RPDO `number` (1..512) is stored.
  virtual void received(unsigned number, rt::Time at) noexcept = 0;
  /// An MPDO for `object` of this device is stored.
  virtual void received_mpdo(ObjectRef object, rt::Time at) noexcept {
    (void)object;
    (void)at;
  }
  /// The deadline of RPDO `number` (1400h:05) ran out; reported once, until it is received again.
  virtual void silent(unsigned number, rt::Time at) noexcept {
    (void)number;
    (void)at;
  }

 protected:
  ~PdoObserver() = default;
};

struct PdoContext {
  [[nodiscard]] rt::Time now() const noexcept { return dispatcher->executor().now(); }
  /// The timer is set at or before the earliest deadline; a deadline that moves later does not change it.
  void arm(rt::Time when) const noexcept {
    if (when == rt::never || (timer->timed() && timer->due() <= when)) return;
    dispatcher->executor().at(when, *timer);
  }

  can::Dispatcher* dispatcher;
  od::Values* values;
  ServiceOwner* owner;
  rt::Job* timer;      ///< the set's: looks at every PDO's deadlines
  std::uint8_t* base;  ///< start of the values
  PdoFaults faults;
  PdoObserver* observer = nullptr;
  Tpdo* tpdos = nullptr;  ///< all of them
  std::uint16_t tpdo_count = 0;
  NodeId node{};                    ///< the node that DAM MPDOs address
  SamProducer* sam = nullptr;       ///< only with a scanner list
  rt::Time window_end = rt::never;  ///< of the SYNC (1007h)
};

}  // namespace berth::co
