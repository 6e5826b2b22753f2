/// A whole CANopen device: object dictionary, NMT slave, heartbeat, guarding, emergencies, SDO servers, PDOs, SYNC,
/// TIME, LSS slave and RAND slave on one port, with its own non-volatile memory. Simulated devices use it, and so does
/// the master's own device (CiA 302: the master is a device). It does not know device description files.
///
///     device::Device d(dispatcher, description, &flash, {.address = a}, &timed_port);
///     auto temperature = d.variable<std::int16_t>({0x6000, 1});
///     d.power_on();
///     temperature.set(215);
///
/// Its parts own their state (`DeviceParts`); `Lifecycle` orders power, resets and NMT states. Call the parts directly:
/// `d.errors().raise(0x4210, ...)`, `d.services().event(1)`, `d.lss().pending()`.
///
/// States: powered off -> booting (receives nothing, `Timing::boot`) -> without a node-ID: initialising, LSS and RAND
/// only, no boot-up message -> LSS gives one and switches to waiting: reset communication -> boot-up ->
/// pre-operational.
///
/// A service exists when the dictionary has its objects. These objects have an effect: 1001h and 1003h (errors),
/// 1005h..1007h and 1019h (`co::Sync`), 100Ch and 100Dh, 1010h and 1011h (`ParameterStore`), 1012h (`co::TimeStamp`),
/// 1014h, 1015h, 1016h, 1017h, 1020h (set to 0 by a write that changes a stored value), 1021h (`Options::eds`), 1028h,
/// 1029h, 1200h..127Fh, 1400h..1BFFh and 1FA0h.. (`co::Pdos`), 1F50h.. (`Programs`, with a memory for them). All others
/// only hold values: 1002h, 1008h..100Ah, 1013h, 1022h..1027h, 102Ah and the application's own.
///
/// After a reset an object has its default, or the `Preset`, or the value stored by 1010h. Reset communication affects
/// 1000h..1FFFh, reset node and power-on all objects.
///
/// The constructor and the `on_` calls allocate all memory. Frames, timers, resets and changes of the node-ID allocate
/// none, except for the dispatcher's lists at the first time.
#pragma once

#include <functional>
#include <memory>

#include "berth/base/ids.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/device/leds.hpp"
#include "berth/device/lifecycle.hpp"
#include "berth/device/nv_memory.hpp"
#include "berth/device/options.hpp"
#include "berth/device/timed_port.hpp"
#include "berth/device/timing.hpp"
#include "berth/od/values.hpp"

namespace berth::device {

class Device final {
 public:
  /// Called when the ground truth changed: power, NMT state, one of the node-IDs. Must only read.
  class Observer {
   public:
    virtual void device_changed(const Device& device) noexcept = 0;

   protected:
    ~Observer() = default;
  };

  /// Off until `power_on`. `memory`: null = nothing can be stored (LSS store is answered 01, 1010h 0800 0020); LSS uses
  /// its first `parameters_at` bytes, the rest is for 1010h, `memory_size` bytes in all are enough. `host`: the port
  /// beneath the dispatcher if it is this device's own: the device then makes it deaf and watches for bus-off.
  /// `programs`: memory for programs. All must outlive the device.
  Device(can::Dispatcher& dispatcher, std::shared_ptr<const od::Description> description, NvMemory* memory,
         Options options, TimedPort* host = nullptr, const Timing& timing = {}, const ProgramOptions& programs = {});

  /// Power comes on, or the firmware restarts (watchdog): pending and active are loaded from memory.
  void power_on() noexcept { life_.power_on(); }
  /// Silent at once; a write under way stops at its current byte.
  void power_off() noexcept { life_.power_off(); }
  [[nodiscard]] bool powered() const noexcept { return life_.powered(); }

  /// Takes effect at the next power-on: another serial number, for example.
  void set_address(const LssAddress& address) noexcept { options_.address = address; }
  /// Takes effect at the next power-on: node-ID and bit rate for blank memory, or of the fixed source. `bit_rate` as in
  /// `Options`.
  void set_blank(NodeId id, std::uint32_t bit_rate) noexcept;
  /// Does what the same command over the bus would do: the master does not hear its own "start all".
  void apply(co::NmtCommand command) noexcept { life_.nmt().apply(command); }

  [[nodiscard]] od::Values& values() noexcept { return values_; }
  [[nodiscard]] const od::Values& values() const noexcept { return values_; }

  /// @name The application
  /// @{
  /// A typed handle to an object; check `valid`.
  template <class T>
  [[nodiscard]] Variable<T> variable(ObjectRef ref) noexcept {
    return Variable<T>(values_, *this, ref);
  }
  /// Calls `call` after the network wrote `ref`, by SDO or by a received PDO. To refuse a write or to supply a value,
  /// attach an `od::Hook` to `values()`.
  void on_write(ObjectRef ref, std::function<void()> call) { life_.parts().application.on_write(ref, std::move(call)); }
  /// The callbacks; the first call allocates them.
  [[nodiscard]] Callbacks& on() { return life_.parts().application.on(); }
  /// For raising and clearing errors: EMCY, 1001h and 1003h follow.
  [[nodiscard]] Errors& errors() noexcept { return life_.parts().errors; }
  /// SDO servers, PDOs, SYNC, TIME: events of TPDOs, values that the local side changed, TIME messages.
  [[nodiscard]] ObjectServices& services() noexcept { return life_.parts().services; }
  /// Input for the indicators of CiA 303-3, as far as the device knows it: `lit(leds(d.led_inputs()), time)`.
  [[nodiscard]] LedInputs led_inputs() const noexcept;
  /// @}

  /// @name Ground truth
  /// @{
  [[nodiscard]] NmtState state() const noexcept { return life_.nmt().state(); }
  /// Powered but not receiving yet: after power-on or during a reset.
  [[nodiscard]] bool booting() const noexcept { return life_.booting(); }
  /// The node-ID in use: unconfigured while booting, and while initialising without one.
  [[nodiscard]] NodeId node_id() const noexcept { return powered() && !booting() ? life_.nmt().node_id() : NodeId(); }
  /// Node-ID and bit rate, pending, active and stored; the identity; the LSS state.
  [[nodiscard]] const LssSlave& lss() const noexcept { return life_.parts().lss; }
  /// RAND, AND, negotiation, claiming.
  [[nodiscard]] const NodeIdSchemes& schemes() const noexcept { return life_.parts().schemes; }
  /// 1010h, 1011h, 1021h, and whether non-volatile memory is being written.
  [[nodiscard]] const StoredObjects& stored() const noexcept { return life_.parts().stored; }
  /// Null when the device is not programmed over the bus.
  [[nodiscard]] const Programs* programs() const noexcept;
  [[nodiscard]] const Options& options() const noexcept { return options_; }
  [[nodiscard]] const Timing& timing() const noexcept { return life_.parts().host.timing(); }
  /// @}
  /// Null: no more calls.
  void observe(Observer* observer) noexcept { told_.observer = observer; }

  /// Bytes that one more device of this type needs, without the shared description and the port.
  [[nodiscard]] std::size_t memory() const noexcept;

 private:
  struct StateRelay final : Lifecycle::Owner {
    explicit StateRelay(const Device& of) noexcept : device(&of) {}
    void device_changed() noexcept override {
      if (observer != nullptr) observer->device_changed(*device);
    }
    const Device* device;
    Observer* observer = nullptr;
  };

  Options options_;
  od::Values values_;
  StateRelay told_{*this};
  Lifecycle life_;
};

template <class T>
bool Variable<T>::set(T value) noexcept {
  if (!valid_) return false;
  const T before = get();
  if (values_->set(ref_, value) != od::AbortCode::none) return false;
  if (get() != before) device_->services().changed(ref_);
  return true;
}

}  // namespace berth::device
