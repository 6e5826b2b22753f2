/// A whole CANopen device: object dictionary, NMT slave, heartbeat, guarding, emergencies, SDO servers, PDOs, SYNC,
/// TIME, LSS slave and RAND slave on one port, with its own non-volatile memory. Simulated devices are made of it, and
/// the master's own device too (CiA 302: the master is a device); it knows nothing of device description files.
///
///     device::Device d(dispatcher, description, &flash, {.address = a}, &timed_port);
///     auto temperature = d.variable<std::int16_t>({0x6000, 1});
///     d.power_on();
///     temperature.set(215);
///
/// It is made of parts that own their state (`DeviceParts`), in an order of power, resets and NMT states (`Lifecycle`);
/// what concerns one of them is asked of it: `d.errors().raise(0x4210, ...)`, `d.services().event(1)`,
/// `d.lss().pending()`.
///
/// States: powered off -> booting (hears nothing, `Timing::boot`) -> without a node-ID: initialising, LSS and RAND
/// only, no boot-up message -> LSS gives one and switches to waiting: reset communication -> boot-up ->
/// pre-operational.
///
/// A service is there when the dictionary has its objects. What acts: 1001h and 1003h (errors), 1005h..1007h and 1019h
/// (`co::Sync`), 100Ch and 100Dh, 1010h and 1011h (`ParameterStore`), 1012h (`co::TimeStamp`), 1014h, 1015h, 1016h,
/// 1017h, 1020h (set to 0 by a write that changes a stored value), 1021h (`Options::eds`), 1028h, 1029h,
/// 1200h..127Fh, 1400h..1BFFh and 1FA0h.. (`co::Pdos`), 1F50h.. (`Programs`, with a memory for them). All others hold
/// values: 1002h, 1008h..100Ah, 1013h, 1022h..1027h, 102Ah and the application's own.
///
/// After a reset an object has its default, or the `Preset`, or what 1010h stored. Reset communication concerns
/// 1000h..1FFFh, reset node and power-on everything.
///
/// All memory is taken by the constructor and the `on_` calls. Frames, timers, resets and changes of the node-ID use
/// none, beyond what the dispatcher's lists grow to at the first time.
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
  /// Told that the ground truth changed: power, NMT state, one of the node-IDs. Must only look.
  class Observer {
   public:
    virtual void device_changed(const Device& device) noexcept = 0;

   protected:
    ~Observer() = default;
  };

  /// Off until `power_on`. `memory`: null = nothing can be stored (LSS store is answered 01, 1010h 0800 0020); LSS has
  /// its first `parameters_at` bytes, the rest is for 1010h, `memory_size` bytes in all are enough. `host`: the port
  /// beneath the dispatcher when it is this device's own: then the device makes it deaf and watches for bus-off.
  /// `programs`: what it keeps programs in. All must outlive the device.
  Device(can::Dispatcher& dispatcher, std::shared_ptr<const od::Description> description, NvMemory* memory,
         Options options, TimedPort* host = nullptr, const Timing& timing = {}, const ProgramOptions& programs = {});

  /// Power comes on, or the firmware starts anew (watchdog): pending and active are loaded from memory.
  void power_on() noexcept { life_.power_on(); }
  /// At once silent; a write under way stops at the byte where it is.
  void power_off() noexcept { life_.power_off(); }
  [[nodiscard]] bool powered() const noexcept { return life_.powered(); }

  /// From the next power-on: another serial number, say.
  void set_address(const LssAddress& address) noexcept { options_.address = address; }
  /// From the next power-on: what blank memory, or the fixed source, gives. `bit_rate` as in `Options`.
  void set_blank(NodeId id, std::uint32_t bit_rate) noexcept;
  /// What the device does when it is told so over the bus: the master's own "start all" does not hear itself.
  void apply(co::NmtCommand command) noexcept { life_.nmt().apply(command); }

  [[nodiscard]] od::Values& values() noexcept { return values_; }
  [[nodiscard]] const od::Values& values() const noexcept { return values_; }

  /// @name The application
  /// @{
  /// A typed handle to an object; ask it whether it is `valid`.
  template <class T>
  [[nodiscard]] Variable<T> variable(ObjectRef ref) noexcept {
    return Variable<T>(values_, *this, ref);
  }
  /// Calls `call` after the network wrote `ref`, by SDO or by a received PDO. To refuse a write or to supply a value,
  /// attach an `od::Hook` to `values()`.
  void on_write(ObjectRef ref, std::function<void()> call) { life_.parts().application.on_write(ref, std::move(call)); }
  /// The callbacks; from the first call on they take their memory.
  [[nodiscard]] Callbacks& on() { return life_.parts().application.on(); }
  /// Errors are raised and cleared here: EMCY, 1001h and 1003h follow.
  [[nodiscard]] Errors& errors() noexcept { return life_.parts().errors; }
  /// SDO servers, PDOs, SYNC, TIME: events of TPDOs, values that the local side changed, TIME messages.
  [[nodiscard]] ObjectServices& services() noexcept { return life_.parts().services; }
  /// What the indicators of CiA 303-3 go by, as far as the device knows: `lit(leds(d.led_inputs()), time)`.
  [[nodiscard]] LedInputs led_inputs() const noexcept;
  /// @}

  /// @name Ground truth
  /// @{
  [[nodiscard]] NmtState state() const noexcept { return life_.nmt().state(); }
  /// Powered, hears nothing yet: after power-on or during a reset.
  [[nodiscard]] bool booting() const noexcept { return life_.booting(); }
  /// In use: unconfigured while booting, and while initialising without one.
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
  /// Null: nothing is told any more.
  void observe(Observer* observer) noexcept { told_.observer = observer; }

  /// Bytes that one more device of this type takes, without the shared description and the port.
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
