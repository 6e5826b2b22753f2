/// A whole CANopen device: object dictionary, NMT slave, heartbeat, guarding, emergencies, SDO servers, PDOs, SYNC,
/// TIME, LSS slave and RAND slave on one port, with its own non-volatile memory. Simulated devices are made of it, and
/// the master's own device too (CiA 302: the master is a device); it knows nothing of device description files.
///
///     device::Device d(dispatcher, description, &flash, {.address = a}, &timed_port);
///     auto temperature = d.variable<std::int16_t>({0x6000, 1});
///     d.power_on();
///     temperature.set(215);
///
/// States: powered off -> booting (hears nothing, `Timing::boot`) -> without a node-ID: initialising, LSS and RAND
/// only, no boot-up message -> LSS gives one and switches to waiting: reset communication -> boot-up ->
/// pre-operational.
///
/// A service is there when the dictionary has its objects. What acts: 1001h and 1003h (errors), 1005h..1007h and 1019h
/// (`co::Sync`), 100Ch and 100Dh, 1010h and 1011h (`ParameterStore`), 1012h (`co::TimeStamp`), 1014h, 1015h, 1016h,
/// 1017h, 1020h (set to 0 by a write that changes a stored value), 1021h (`set_stored_eds`), 1028h, 1029h,
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
#include <optional>
#include <string>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/co/emcy_list.hpp"
#include "berth/co/nmt_slave.hpp"
#include "berth/co/pdo.hpp"
#include "berth/co/sdo_servers.hpp"
#include "berth/co/sync.hpp"
#include "berth/co/time_stamp.hpp"
#include "berth/device/application.hpp"
#include "berth/device/bus_off.hpp"
#include "berth/device/claiming.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/device/error_control.hpp"
#include "berth/device/errors.hpp"
#include "berth/device/host.hpp"
#include "berth/device/leds.hpp"
#include "berth/device/lss_habits.hpp"
#include "berth/device/negotiation.hpp"
#include "berth/device/node_id_methods.hpp"
#include "berth/device/nv_memory.hpp"
#include "berth/device/object_services.hpp"
#include "berth/device/own_identifiers.hpp"
#include "berth/device/parameter_store.hpp"
#include "berth/device/programs.hpp"
#include "berth/device/timed_port.hpp"
#include "berth/device/timing.hpp"
#include "berth/lss/answer_queue.hpp"
#include "berth/lss/slave.hpp"
#include "berth/od/values.hpp"

namespace berth::device {

/// Where the node-ID comes from at power-on (S4.2).
enum class NodeIdSource : std::uint8_t {
  nonvolatile,  ///< from memory, `Options::node_id` while memory is blank; LSS changes it
  fixed,        ///< firmware, switches or plug: LSS configure node-ID is answered "out of range"
};

/// An object whose write is believed only with this value: "save", a password.
struct Signature {
  ObjectRef object;
  std::uint64_t value = 0;  ///< little-endian on the wire
};

/// How a device behaves as an LSS slave.
struct LssOptions {
  bool on = true;                                            ///< it is one
  bool fastscan = true;                                      ///< answers LSS Fastscan (51h)
  lss::Feedback feedback = lss::Feedback::none;              ///< with `fastscan`
  std::uint16_t feedback_base = lss::default_feedback_base;  ///< `Feedback::base`: first of the sixteen identifiers
  LssHabit habit = LssHabit::none;                           ///< as a known stack's slave does
  std::uint64_t habit_seed = 0;                              ///< of what such a slave does at random
  bool changes_at_waiting = false;  ///< a configured device takes a new node-ID already at `04 00`
};

struct Options {
  LssAddress address{};  ///< identity, 1018h:01..04
  NodeIdSource source = NodeIdSource::nonvolatile;
  NodeId node_id{};            ///< fixed, or what blank memory counts as
  std::uint32_t bit_rate = 0;  ///< what blank memory counts as, bit/s; 0 or not in CiA's table: the port's own is kept
  LssOptions lss{};
  RandMode rand = RandMode::on;
  bool rand_resume = false;   ///< RAND's extension: answers for any prefix of its address (docs/rand.md)
  bool and_protocol = false;  ///< answers AND
  bool claim = false;         ///< claims a node-ID as SAE J1939-81 does when it has none
  NegotiationMode negotiation = NegotiationMode::off;
  nodeid::NegotiatorOptions negotiator{};  ///< with `negotiation`; its address and `literal` are the device's
  bool detect_collision = true;            ///< reports another node that sends with its identifiers (EMCY 8150h; SX.7)
  rt::Duration never_seen{0};        ///< a node in 1016h with no heartbeat for so long is told (`Callbacks`); 0 = no
  rt::Duration bus_off_recovery{0};  ///< restarts its controller so long after bus-off; 0 = never
  /// The node-ID is this object too (1 byte or more; the dictionary must have it): a write is stored at once, or with
  /// the signature's, and in use after the next reset.
  std::optional<ObjectRef> node_id_object{};
  std::optional<Signature> node_id_signature{};
  std::string name{};  ///< 1008h; empty: as described
  std::vector<Preset> presets{};
  GroupOf parameter_group = default_parameter_group;  ///< what 1010h stores, by sub-index
  bool send_tpdos_at_start = true;                    ///< types FEh and FFh: once when operational is entered
};

class Device final : private co::NmtSlave::Owner,
                     private lss::SlaveOwner,
                     private NvMemory::Done,
                     private Errors::Owner,
                     private OwnIdentifiers::Owner,
                     private Negotiation::Owner,
                     private Claiming::Owner,
                     private ParameterStore::Owner,
                     private can::Handler,
                     private od::Hook,
                     private rt::Job {
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
  /// beneath
  /// the dispatcher when it is this device's own: then the device makes it deaf and watches for bus-off. `programs`:
  /// what it keeps programs in. All must outlive the device.
  Device(can::Dispatcher& dispatcher, std::shared_ptr<const od::Description> description, NvMemory* memory,
         Options options, TimedPort* host = nullptr, const Timing& timing = {}, const ProgramOptions& programs = {});
  ~Device();
  static constexpr std::size_t parameters_at = 64;
  [[nodiscard]] static std::size_t memory_size(const od::Description& description,
                                               GroupOf group_of = default_parameter_group) noexcept {
    return parameters_at + ParameterStore::footprint(description, group_of);
  }

  /// Power comes on, or the firmware starts anew (watchdog): pending and active are loaded from memory.
  void power_on() noexcept;
  /// At once silent; a write under way stops at the byte where it is.
  void power_off() noexcept;
  [[nodiscard]] bool powered() const noexcept { return powered_; }

  /// From the next power-on: another serial number, say.
  void set_address(const LssAddress& address) noexcept { options_.address = address; }
  /// From the next power-on: what blank memory, or the fixed source, gives. `bit_rate` as in `Options`.
  void set_blank(NodeId id, std::uint32_t bit_rate) noexcept;
  /// What the device does when it is told so over the bus: the master's own "start all" does not hear itself.
  void apply(co::NmtCommand command) noexcept { nmt_.apply(command); }

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
  void on_write(ObjectRef ref, std::function<void()> call) { application_.on_write(ref, std::move(call)); }
  /// The callbacks; from the first call on they take their memory.
  [[nodiscard]] Callbacks& on() { return application_.on(); }
  /// Errors of the application and of the device: raised and cleared here, EMCY, 1001h and 1003h follow.
  [[nodiscard]] Errors& errors() noexcept { return errors_; }
  /// An event of TPDO 1..512 (types 00h, FEh, FFh); false when it is not active or knows no events.
  bool tpdo_event(unsigned number) noexcept { return services_.pdos && services_.pdos->event(number); }
  /// The object's value was changed by the local side: an event of the TPDOs that map it.
  void value_changed(ObjectRef ref) noexcept override {
    if (services_.pdos) services_.pdos->changed(ref);
  }
  /// What 1021h uploads; must outlive the device. Empty: as described (no data).
  void set_stored_eds(std::span<const std::uint8_t> eds) noexcept { eds_ = eds; }
  /// Sends a TIME message; `closed`: no producer (1012h bit 30), or not in a state with TIME.
  can::Queued send_time(const co::TimeOfDay& time) noexcept {
    return services_.time ? services_.time->send(time) : can::Queued::closed;
  }
  /// PDOs; null when the dictionary has none.
  [[nodiscard]] co::Pdos* pdos() noexcept { return services_.pdos.get(); }
  /// What the indicators of CiA 303-3 go by, as far as the device knows: `lit(leds(d.led_inputs()), time)`.
  [[nodiscard]] LedInputs led_inputs() const noexcept;
  /// @}

  /// @name Ground truth
  /// @{
  [[nodiscard]] NmtState state() const noexcept { return nmt_.state(); }
  /// Powered, hears nothing yet: after power-on or during a reset.
  [[nodiscard]] bool booting() const noexcept { return begin_ != Begin::nothing; }
  /// In use: unconfigured while booting, and while initialising without one.
  [[nodiscard]] NodeId node_id() const noexcept { return powered_ && !booting() ? nmt_.node_id() : NodeId(); }
  /// LSS: the next reset communication takes it.
  [[nodiscard]] const lss::Settings& pending() const noexcept { return lss_->pending(); }
  [[nodiscard]] const lss::Settings& active() const noexcept { return lss_->active(); }
  /// What the next power-on would load.
  [[nodiscard]] lss::Settings persistent() noexcept;
  [[nodiscard]] const LssAddress& address() const noexcept { return lss_->address(); }
  [[nodiscard]] lss::State lss_state() const noexcept { return lss_->state(); }
  /// Null when the device is not programmed over the bus.
  [[nodiscard]] const Programs* programs() const noexcept { return programming_ ? &programming_->programs : nullptr; }
  /// Null when the device does not claim.
  [[nodiscard]] const nodeid::ClaimSlave* claimer() const noexcept { return claiming_ ? &claiming_->slave() : nullptr; }
  /// Null when the device does not negotiate.
  [[nodiscard]] const nodeid::Negotiator* negotiator() const noexcept {
    return negotiation_ ? &negotiation_->negotiator() : nullptr;
  }
  [[nodiscard]] nodeid::Identification identification() const noexcept { return methods_.identification(); }
  [[nodiscard]] nodeid::Identification and_identification() const noexcept { return methods_.and_identification(); }
  /// Non-volatile memory is being written: LSS store, 1010h or 1011h.
  [[nodiscard]] bool storing() const noexcept {
    return (record_ && record_->busy()) || (parameters_ && parameters_->busy());
  }
  [[nodiscard]] const Options& options() const noexcept { return options_; }
  [[nodiscard]] const Timing& timing() const noexcept { return host_.timing(); }
  /// @}
  void observe(Observer* observer) noexcept { observer_ = observer; }

  /// Bytes that one more device of this type takes, without the shared description and the port.
  [[nodiscard]] std::size_t memory() const noexcept;

 private:
  enum class Begin : std::uint8_t { nothing, power_on, reset_node, reset_communication };
  // NMT
  void reset(co::NmtReset what, rt::Time at) noexcept override;
  void state_changed(NmtState from, NmtState to, rt::Time at) noexcept override;
  void run() noexcept override;
  void begin(Begin what, rt::Duration own_time) noexcept;
  void finish_reset() noexcept;
  void make_services(NvMemory* memory);
  void load_settings() noexcept;
  void reset_values(od::Area area) noexcept;
  void start_services() noexcept;
  void stop_services() noexcept;
  void set_services(const co::Services& was, const co::Services& now) noexcept;
  void self_start() noexcept;
  void listen() noexcept;
  [[nodiscard]] rt::Duration in_world(rt::Duration own) const noexcept override { return host_.in_world(own); }
  // LSS and RAND
  std::optional<lss::StoreResult> store(const lss::Settings& settings) noexcept override;
  void wants_reset_communication() noexcept override;
  void boot_by_nmt(const can::Frame& frame) noexcept;
  void switch_bit_rate(lss::BitRateIndex index) noexcept override;
  void silence_over() noexcept override;
  void written(bool ok) noexcept override;
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  [[nodiscard]] lss::Answers answer_lss(const can::Frame& frame) noexcept;
  void use_bit_rate() noexcept;
  // Negotiation (device_negotiation.cpp)
  void make_negotiation(NvMemory* memory);
  void note_other_schemes(bool answers) noexcept;
  void negotiated(NodeId id) noexcept override;
  void negotiation_lost(NodeId id, nodeid::IdLoss why) noexcept override;
  void negotiation_failed() noexcept override { tell(); }
  void negotiation_kept(NodeId id) noexcept override;
  void claimed(NodeId id) noexcept override { negotiated(id); }
  void claim_lost(NodeId id) noexcept override;
  void doubled() noexcept override {
    if (negotiation_) negotiation_->doubled();
  }
  // The node-ID as an object
  od::AbortCode writing_node_id(ObjectRef ref, std::span<const std::uint8_t> value) noexcept;
  od::AbortCode keep_node_id(ObjectRef ref, NodeId id) noexcept;
  void node_id_kept(bool ok) noexcept;
  // Objects
  od::AbortCode reading(const od::Values& values, ObjectRef ref,
                        std::span<const std::uint8_t>& value) noexcept override;
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  void written(od::Values&, ObjectRef) noexcept override {}
  od::AbortCode writing_storage(ObjectRef ref, std::span<const std::uint8_t> value) noexcept;
  void parameters_written(bool ok) noexcept override;
  void tell() noexcept {
    if (observer_ != nullptr) observer_->device_changed(*this);
  }

  /// Sees every write that changes a stored value: then the configuration is not the verified one any more (1020h).
  class ConfigurationWatch final : public od::Hook {
   public:
    explicit ConfigurationWatch(Device& device) noexcept : device_(&device) {}

   private:
    od::AbortCode writing(const od::Values& values, ObjectRef ref,
                          std::span<const std::uint8_t> value) noexcept override;
    void written(od::Values& values, ObjectRef ref) noexcept override;
    Device* device_;
    bool changes_ = false;
  };

  /// Of `Programs`.
  class ProgramHost final : public Programs::Owner {
   public:
    explicit ProgramHost(Device& device) noexcept : device_(&device) {}
    void restart() noexcept override { device_->nmt_.apply(co::NmtCommand::reset_node); }
    void answer(ObjectRef object, od::AbortCode code) noexcept override { device_->sdo_.complete(object, code); }

   private:
    Device* device_;
  };
  struct Programming {
    Programming(Device& device, const ProgramOptions& options, TypeCode type)
        : host(device), programs(device.dispatcher_->executor(), device.values_, options, type, host) {}
    ProgramHost host;
    Programs programs;
  };

  can::Dispatcher* dispatcher_;
  Host host_;
  Options options_;
  od::Values values_;
  std::optional<NvRecord> record_;
  std::optional<lss::Slave> lss_;
  lss::AnswerQueue lss_answers_;
  std::unique_ptr<LssHabits> habits_;  // only with LssOptions::habit
  NodeIdMethods methods_;
  co::NmtSlave nmt_;
  co::SdoServers sdo_;
  Application application_;
  Errors errors_;
  ErrorControl error_control_;
  BusOffRecovery bus_off_;
  OwnIdentifiers own_identifiers_;
  ObjectServices services_;
  std::unique_ptr<ParameterStore> parameters_;         // only with object 1010h and a memory that has room
  std::unique_ptr<ConfigurationWatch> configuration_;  // only with object 1020h
  std::unique_ptr<Programming> programming_;           // only with a memory for programs
  std::unique_ptr<Negotiation> negotiation_;           // only with Options::negotiation
  std::unique_ptr<Claiming> claiming_;                 // only with Options::claim
  std::span<const std::uint8_t> eds_;
  bool keeps_node_id_ = false;  // `storing_` is the node-ID's object or its signature's
  ObjectRef storing_{};         // the sub-object of 1010h or 1011h whose write is to be confirmed
  Observer* observer_ = nullptr;
  lss::Settings memory_{};  // what the record holds, or stands for blank memory
  lss::Settings being_stored_{};
  lss::BitRateMask bit_rates_ = 0;
  std::array<std::uint8_t, 4> scratch_{};  // what `reading` shows
  Begin begin_ = Begin::nothing;
  bool powered_ = false;
};

template <class T>
bool Variable<T>::set(T value) noexcept {
  if (!valid_) return false;
  const T before = get();
  if (values_->set(ref_, value) != od::AbortCode::none) return false;
  if (get() != before) device_->value_changed(ref_);
  return true;
}

}  // namespace berth::device
