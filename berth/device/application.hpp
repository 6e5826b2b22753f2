/// The application's view of its device: callbacks, and handles to its own objects.
///
///     device::Variable<std::int16_t> temperature = device.variable<std::int16_t>({0x6000, 1});
///     device.on_write({0x6200, 1}, [&] { valve.set(position.get()); });
///     temperature.set(215);                    // and the TPDO that maps it goes out
///
/// The executor calls the callbacks in the middle of the device's work: they may use the device, must not destroy it
/// and must not throw (a thrown exception ends the program). Set them before `power_on`; setting one uses the heap.
#pragma once

#include <functional>
#include <map>
#include <memory>

#include "berth/co/emcy.hpp"
#include "berth/co/heartbeat.hpp"
#include "berth/co/pdo.hpp"
#include "berth/co/sync.hpp"
#include "berth/co/time_stamp.hpp"
#include "berth/od/values.hpp"

namespace berth::device {

class Device;

struct Callbacks {
  std::function<void()> start;                             ///< power-on or reset node: values are restored, no boot-up
                                                           ///< yet
  std::function<void(NmtState)> state;                     ///< the NMT state entered
  std::function<void(unsigned)> rpdo;                      ///< RPDO number 1..512 is stored
  std::function<void(unsigned)> rpdo_silent;               ///< the deadline 1400h:05 of RPDO 1..512 ran out
  std::function<void(std::uint8_t)> sync;                  ///< SYNC counter, 0 = without
  std::function<void(bool)> sync_missing;                  ///< as consumer: no SYNC for 1.5 times 1006h; or back
  std::function<void(const co::TimeOfDay&)> time;          ///< another node's TIME message (1012h bit 31)
  std::function<void(NodeId, const co::Emcy&)> emergency;  ///< from a node in 1028h
  std::function<void(const co::HeartbeatEvent&)> heartbeat;  ///< of a node in 1016h
  std::function<void()> parameters;                          ///< values were reloaded: power-on, reset, restore
};

/// Calls the functions given to `Device::on_write`.
class WriteWatch final : public od::Hook {
 public:
  void add(od::Values& values, ObjectRef ref, std::function<void()> call);
  /// An RPDO with this mapping record (1600h + number - 1) was stored.
  void mapped(const od::Values& values, std::uint16_t mapping) const noexcept;
  void one(ObjectRef ref) const noexcept;
  [[nodiscard]] std::size_t memory() const noexcept {
    constexpr std::size_t node = 4 * sizeof(void*);
    return calls_.size() * (sizeof(Calls::value_type) + node);
  }

 private:
  using Calls = std::multimap<ObjectRef, std::function<void()>>;  // those of one object in the order of adding
  void written(od::Values& values, ObjectRef ref) noexcept override;
  Calls::const_iterator call_from(Calls::const_iterator at, ObjectRef ref) const noexcept;
  Calls calls_;
};

/// Passes events of the device's services to the callbacks that were set. Without callbacks it is a few pointers.
class Application final : public co::Pdos::Observer,
                          public co::Sync::Observer,
                          public co::TimeStamp::Observer,
                          public co::EmcyConsumer::Observer,
                          public co::HeartbeatConsumer::Observer {
 public:
  explicit Application(od::Values& values) noexcept : values_(&values) {}

  /// The first call allocates the callbacks.
  [[nodiscard]] Callbacks& on();
  /// See `Device::on_write`.
  void on_write(ObjectRef ref, std::function<void()> call);
  /// Calls one of the callbacks, if it is set: `tell(&Callbacks::state, to)`.
  template <class Member, class... Arguments>
  void tell(Member member, Arguments&&... arguments) noexcept {
    if (callbacks_ != nullptr && ((*callbacks_).*member)) ((*callbacks_).*member)(arguments...);
  }
  /// The device ends: only functions given to `on_write` are still called.
  void silence() noexcept { callbacks_.reset(); }

  /// Bytes held outside the object.
  [[nodiscard]] std::size_t memory() const noexcept;

 private:
  void received(unsigned rpdo, rt::Time at) noexcept override;
  void received_mpdo(ObjectRef object, rt::Time at) noexcept override;
  void silent(unsigned rpdo, rt::Time) noexcept override { tell(&Callbacks::rpdo_silent, rpdo); }
  void synchronised(std::uint8_t counter, rt::Time) noexcept override { tell(&Callbacks::sync, counter); }
  void sync_missing(bool missing, rt::Time) noexcept override { tell(&Callbacks::sync_missing, missing); }
  void time_of_day(const co::TimeOfDay& time, rt::Time) noexcept override { tell(&Callbacks::time, time); }
  void emergency(NodeId node, const co::Emcy& message, rt::Time) noexcept override {
    tell(&Callbacks::emergency, node, message);
  }
  void heartbeat(const co::HeartbeatEvent& event, rt::Time) noexcept override { tell(&Callbacks::heartbeat, event); }

  od::Values* values_;
  std::unique_ptr<Callbacks> callbacks_;
  std::unique_ptr<WriteWatch> writes_;
};

/// One object of a device, typed. Cheap to copy; must not outlive the device. If there is no such object, or T cannot
/// hold its type, the handle is not `valid`: it reads 0 and sets nothing.
template <class T>
class Variable {
 public:
  Variable(od::Values& values, Device& device, ObjectRef ref) noexcept
      : values_(&values), device_(&device), ref_(ref), valid_(values.get<T>(ref).has_value()) {}

  [[nodiscard]] bool valid() const noexcept { return valid_; }
  [[nodiscard]] ObjectRef object() const noexcept { return ref_; }
  [[nodiscard]] T get() const noexcept { return values_->get_or<T>(ref_, T{}); }
  /// Stores, whatever the access type and limits; a changed value is an event for the TPDOs that map the object. False:
  /// not valid, or out of the type's range.
  bool set(T value) noexcept;
  /// Stores without an event: for values that a timer or SYNC sends.
  bool store(T value) noexcept { return valid_ && values_->set(ref_, value) == od::AbortCode::none; }

 private:
  od::Values* values_;
  Device* device_;
  ObjectRef ref_;
  bool valid_;
};

}  // namespace berth::device
