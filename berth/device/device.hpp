/// A whole CANopen device: object dictionary, NMT slave, heartbeat, guarding, emergencies, SDO server, LSS slave and
/// RAND slave on one port, with its own non-volatile memory. Simulated devices are made of it, and the master's own
/// device too (CiA 302: the master is a device); it knows nothing of device description files.
///
///     device::Device d(dispatcher, description, &flash, {.address = a}, &timed_port);
///     d.power_on();
///
/// States: powered off -> booting (hears nothing, `Timing::boot`) -> without a node-ID: initialising, LSS and RAND
/// only, no boot-up message -> LSS gives one and switches to waiting: reset communication -> boot-up ->
/// pre-operational. Objects that act when they are written: 1003h, 1014h, 1015h, 1016h, 1017h, 100Ch, 100Dh; 1001h
/// shows the errors. 1010h and 1011h refuse every write (0800 0020): parameters are not stored yet.
///
/// All memory is taken by the constructor. Frames, timers, resets and changes of the node-ID use none, beyond what the
/// dispatcher's lists grow to at the first time.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/co/emcy.hpp"
#include "berth/co/guarding.hpp"
#include "berth/co/heartbeat.hpp"
#include "berth/co/nmt_slave.hpp"
#include "berth/co/sdo_server.hpp"
#include "berth/device/nv_memory.hpp"
#include "berth/device/timed_port.hpp"
#include "berth/device/timing.hpp"
#include "berth/lss/slave.hpp"
#include "berth/nodeid/rand_slave.hpp"
#include "berth/od/values.hpp"

namespace berth::device {

/// Where the node-ID comes from at power-on (S4.2).
enum class NodeIdSource : std::uint8_t {
  nonvolatile,  ///< from memory, `Options::node_id` while memory is blank; LSS changes it
  fixed,        ///< firmware, switches or plug: LSS configure node-ID is answered "out of range"
};

/// How RAND requests are answered.
enum class RandMode : std::uint8_t {
  off,
  on,       ///< in every LSS state
  literal,  ///< in LSS configuration state only, as paper 1 has it (S1.31)
};

/// A value that the device has after every reset instead of the description's default.
struct Preset {
  ObjectRef object;
  std::uint64_t value = 0;
};

struct Options {
  LssAddress address{};  ///< identity, 1018h:01..04
  NodeIdSource source = NodeIdSource::nonvolatile;
  NodeId node_id{};            ///< fixed, or what blank memory counts as
  std::uint32_t bit_rate = 0;  ///< what blank memory counts as, bit/s; 0 or not in CiA's table: the port's own is kept
  bool lss = true;
  RandMode rand = RandMode::on;
  bool lss_changes_at_waiting = false;  ///< a configured device takes a new node-ID already at `04 00`
  bool detect_collision = true;         ///< reports another node that sends with its identifiers (EMCY 8150h; SX.7)
  rt::Duration bus_off_recovery{0};     ///< restarts its controller so long after bus-off; 0 = never
  std::string name{};                   ///< 1008h; empty: as described
  std::vector<Preset> presets{};
};

class Device final : private co::NmtSlave::Owner,
                     private co::GuardingSlave::Observer,
                     private co::HeartbeatConsumer::Observer,
                     private lss::SlaveOwner,
                     private NvMemory::Done,
                     private can::StatusHandler,
                     private can::Handler,
                     private od::Hook,
                     private rt::Job {
 public:
  /// Who wants to know that the ground truth changed: power, NMT state, one of the node-IDs. Must only look.
  class Observer {
   public:
    virtual void device_changed(const Device& device) noexcept = 0;

   protected:
    ~Observer() = default;
  };

  /// Off until `power_on`. `memory`: null = nothing can be stored (LSS store is answered 01). `host`: the port beneath
  /// the dispatcher when it is this device's own: then the device makes it deaf and watches for bus-off. All must
  /// outlive the device.
  Device(can::Dispatcher& dispatcher, std::shared_ptr<const od::Description> description, NvMemory* memory,
         Options options, TimedPort* host = nullptr, const Timing& timing = {});
  ~Device();

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
  /// Raise and clear errors here; 1001h and 1003h follow.
  bool raise(std::uint16_t code, std::uint8_t register_bits, const std::array<std::uint8_t, 5>& info = {}) noexcept;
  bool clear(std::uint16_t code) noexcept;
  [[nodiscard]] const co::EmcyProducer& emcy() const noexcept { return emcy_; }

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
  [[nodiscard]] nodeid::Identification identification() const noexcept { return rand_.state(); }
  [[nodiscard]] bool storing() const noexcept { return record_ && record_->busy(); }
  [[nodiscard]] const Options& options() const noexcept { return options_; }
  [[nodiscard]] const Timing& timing() const noexcept { return timing_; }
  /// @}
  void observe(Observer* observer) noexcept { observer_ = observer; }

  /// Bytes that one more device of this type takes, without the shared description and the port.
  [[nodiscard]] std::size_t memory() const noexcept;

 private:
  enum class Begin : std::uint8_t { nothing, power_on, reset_node, reset_communication };
  class Recovery final : public rt::Job {  // from bus-off
   public:
    explicit Recovery(Device& device) noexcept : device_(&device) {}
    void run() noexcept override { device_->recover(); }

   private:
    Device* device_;
  };
  // NMT
  void reset(co::NmtReset what, rt::Time at) noexcept override;
  void state_changed(NmtState from, NmtState to, rt::Time at) noexcept override;
  void run() noexcept override;
  void begin(Begin what, rt::Duration own_time) noexcept;
  void finish_reset() noexcept;
  void load_settings() noexcept;
  void reset_values(od::Area area) noexcept;
  void start_services() noexcept;
  void stop_services() noexcept;
  void set_services(const co::Services& was, const co::Services& now) noexcept;
  void self_start() noexcept;
  void listen() noexcept;
  // Errors
  void life_guarding(bool lost, rt::Time at) noexcept override;
  void heartbeat(const co::HeartbeatEvent& event, rt::Time at) noexcept override;
  void error_control() noexcept;
  void error_event() noexcept;
  void recover() noexcept;
  void changed(const can::Status& status, rt::Time at) noexcept override;
  // LSS and RAND
  std::optional<lss::StoreResult> store(const lss::Settings& settings) noexcept override;
  void wants_reset_communication() noexcept override;
  void switch_bit_rate(lss::BitRateIndex index) noexcept override;
  void silence_over() noexcept override;
  void written(bool ok) noexcept override;
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  [[nodiscard]] std::optional<can::Frame> answer_lss(const can::Frame& frame) noexcept;
  [[nodiscard]] bool is_mine(std::uint32_t key) const noexcept;
  void use_bit_rate() noexcept;
  // Objects
  od::AbortCode reading(const od::Values& values, ObjectRef ref,
                        std::span<const std::uint8_t>& value) noexcept override;
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  void written(od::Values& values, ObjectRef ref) noexcept override;
  od::AbortCode writing_emcy_id(std::uint32_t value) const noexcept;
  void apply_object(std::uint16_t index) noexcept;
  void apply_consumer_entries() noexcept;
  [[nodiscard]] rt::Duration milliseconds(std::uint16_t index) const noexcept;
  void tell() noexcept {
    if (observer_ != nullptr) observer_->device_changed(*this);
  }

  can::Dispatcher* dispatcher_;
  TimedPort* host_;
  Timing timing_;
  Options options_;
  od::Values values_;
  std::optional<NvRecord> record_;
  std::optional<lss::Slave> lss_;
  nodeid::RandSlave rand_;
  co::NmtSlave nmt_;
  co::HeartbeatProducer producer_;
  std::unique_ptr<co::HeartbeatConsumer> consumer_;  // only with object 1016h
  co::GuardingSlave guarding_;
  co::EmcyProducer emcy_;
  std::unique_ptr<co::ErrorField> errors_;  // only with object 1003h
  co::SdoServerService sdo_;
  Observer* observer_ = nullptr;
  lss::Settings memory_{};  // what the record holds, or stands for blank memory
  lss::Settings being_stored_{};
  lss::BitRateMask bit_rates_ = 0;
  std::array<std::uint8_t, 4> scratch_{};  // what `reading` shows
  Recovery recovery_{*this};
  std::size_t sdo_buffer_;
  std::size_t consumer_size_ = 0;
  Begin begin_ = Begin::nothing;
  bool powered_ = false;
  bool bus_off_ = false;
  bool heartbeat_lost_ = false;
  bool life_lost_ = false;
  bool error_control_raised_ = false;
};

/// The dictionary of a device without a description file: 1000h, 1001h, 1003h, 1008h, 100Ch, 100Dh, 1014h, 1015h,
/// 1016h (8 entries), 1017h, 1018h, 1029h, 1200h. One for the whole process.
[[nodiscard]] const std::shared_ptr<const od::Description>& minimal_description();

}  // namespace berth::device
