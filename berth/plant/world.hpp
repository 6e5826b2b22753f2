/// The simulated world of a plant file: buses, whole devices with their memory, and faults with their times.
///
///     Findings findings;
///     auto world = plant::World::make(plant, rates, findings);   // null when a finding is an error
///     auto port = world->attach_master("backbone");              // Berth's own node; destroy it before the world
///     world->start();
///     world->sim().run_for(1s);
///
/// The ground truth (`truth`, `duplicates`, `Observer`) is for tests, reports and Studio only; code that works on the
/// bus must not use it.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/device/device.hpp"
#include "berth/network/dictionary_manager.hpp"
#include "berth/plant/device_plan.hpp"
#include "berth/plant/odd_answers.hpp"
#include "berth/plant/plant_file.hpp"
#include "berth/plant/sim_gateway.hpp"
#include "berth/script/behaviour.hpp"
#include "berth/sim/world.hpp"

namespace berth::plant {

class World;

/// The true state, whatever Berth assumes.
struct Truth {
  std::string name;
  std::string bus;
  LssAddress address;  ///< what it answers; a changed serial number takes effect at the next power-on
  bool plugged = false;
  bool powered = false;        ///< plugged and switched on
  bool booting = false;        ///< powered, but not hearing yet
  bool deaf = false;           ///< because of `SimDevice::deaf`
  Duration late{0};            ///< because of `SimDevice::slow`: its answers are so much later
  NodeId active;               ///< in use now
  NodeId pending;              ///< active from the next reset communication
  NodeId persistent;           ///< loaded at the next power-on
  std::uint32_t bit_rate = 0;  ///< of its controller, bit/s
  NmtState state = NmtState::initialising;
  bool leads = false;                ///< a flying master, and the active one
  NodeId active_master;              ///< as this flying master knows it
  std::uint64_t memory_writes = 0;   ///< begun
  std::uint64_t memory_written = 0;  ///< completed
  device::Leds leds;                 ///< state of its indicators; dark without power

  /// True if a slot table's identity means this device; without a serial number the node-ID identifies it.
  [[nodiscard]] bool is(const Identity& named) const noexcept {
    const NodeId own = powered ? active : persistent;
    return Identity(address).agrees(named) && (named.has_serial() || own == named.at);
  }
  /// The same, but also by its stored node-ID, which it may use only after the next power-on.
  [[nodiscard]] bool is_or_will_be(const Identity& named) const noexcept {
    return is(named) || (persistent == named.at && Identity(address).agrees(named));
  }
};

/// One device of the plant: controller, host, dictionary and services, memory.
class SimDevice final : public GatewaySide, private device::Device::Observer, private device::SimFlash::Watcher {
 public:
  SimDevice(World& world, sim::Bus& bus, const PlantDevice& plan, const LssAddress& address,
            std::shared_ptr<const od::Description> description, Random random,
            std::optional<script::Script> script = {}, bool metered = false);
  ~SimDevice() override;

  /// Onto the bus, with power; no effect if it is plugged already.
  void plug() noexcept;
  /// Off the bus, without power.
  void unplug() noexcept;
  /// Power of a plugged device.
  void power(bool on) noexcept;
  /// The firmware restarts, as by a watchdog.
  void reset() noexcept;
  /// Hears nothing for `duration`; 0 = from now on.
  void deaf(Duration duration);
  /// Answers `latency` later for `duration`; 0 = from now on.
  void slow(Duration latency, Duration duration);
  /// Ends `deaf` and `slow`.
  friend void recover(SimDevice& device) noexcept {
    ++device.deafness_;
    ++device.slowness_;
    device.port_.deaf(device::TimedPort::Deaf::fault, false);
    device.port_.slow(Duration::zero());
  }
  /// Changes that take effect at its next power-on.
  struct NextPowerOn {
    std::optional<std::uint32_t> serial{};
    std::optional<NodeId> node_id{};  ///< the stored one, or the switches' setting
  };
  [[nodiscard]] NextPowerOn& next_power_on() noexcept { return next_; }

  [[nodiscard]] const std::string& name() const noexcept { return plan_.name; }
  [[nodiscard]] const PlantDevice& plan() const noexcept override { return plan_; }
  [[nodiscard]] sim::Bus& bus() noexcept { return *bus_; }
  [[nodiscard]] sim::Controller& controller() noexcept { return *controller_; }
  [[nodiscard]] device::TimedPort& host() noexcept { return port_; }
  [[nodiscard]] device::Device& device() noexcept override { return device_; }
  [[nodiscard]] const device::Device& device() const noexcept { return device_; }
  [[nodiscard]] device::SimFlash& memory() noexcept { return flash_; }
  /// The memory of its programs; null: it is not programmed.
  friend device::SimFlash* program_memory(SimDevice& device) noexcept { return device.program_flash_.get(); }
  /// The memory of the node-IDs that it has given; null: it is not a master, or a flying one.
  friend SimListMemory* list_memory(SimDevice& device) noexcept { return device.master_.memory.get(); }
  [[nodiscard]] bool plugged() const noexcept { return plugged_; }
  [[nodiscard]] bool powered() const noexcept override { return powered_; }
  [[nodiscard]] Truth truth() const;
  /// Bytes of memory for this device, without the shared description.
  [[nodiscard]] std::size_t memory_use() const noexcept;

 private:
  friend class World;
  [[nodiscard]] Inside inside() noexcept override {
    return {&dispatcher_, master_.manager.get(), meter_ ? &*meter_ : nullptr};
  }
  void follow(const GatewaySide& above) noexcept override;
  void refuse_extended_frames();
  void switch_on() noexcept;
  void switch_off() noexcept;
  void device_changed(const device::Device& device) noexcept override;
  void write_began() noexcept override {}
  void write_ended() noexcept override;
  void cut() noexcept override;

  World* world_;
  sim::Bus* bus_;
  PlantDevice plan_;
  device::Timing timing_;
  device::SimFlash flash_;
  std::unique_ptr<device::SimFlash> program_flash_;  // only with programs
  std::unique_ptr<sim::Controller> controller_;
  device::TimedPort port_;
  std::optional<multilevel::MeteredPort> meter_;  // only of a gateway
  can::Dispatcher dispatcher_;
  mutable device::Device device_;
  class Scripted;
  std::unique_ptr<Scripted> scripted_;  // only with a script
  OddAnswers odd_;
  PlantMastery master_;
  NextPowerOn next_;
  unsigned deafness_ = 0;  // number of the last `deaf`, so that the end of an older one has no effect
  unsigned slowness_ = 0;
  std::optional<unsigned> error_flags_;  // the fault for its error flags; only for a CAN 2.0A controller
  bool plugged_ = false;
  bool powered_ = false;
};

/// A bus of the machine file, for a plant bus without its own bit rate.
struct BusRate {
  std::string name;
  std::uint32_t bit_rate = 0;  ///< bit/s
};

class World {
 public:
  /// Called from jobs, after the event. Must only look.
  class Observer {
   public:
    virtual void plant_changed(const SimDevice& device) noexcept = 0;
    /// The script of a device printed a line or ended.
    virtual void script_told(const SimDevice&, const script::Message&) noexcept {}
    /// As `script::Behaviour::Listener::script_must_end`, of every script.
    virtual bool scripts_must_end() noexcept { return false; }

   protected:
    ~Observer() = default;
  };

  /// Builds the world; nothing has power until `start`. Findings: a bus without a bit rate anywhere, a device
  /// description that cannot be read (errors); what the EDS reader reports about one (its own texts, errors only). Also
  /// makes buses of `rates` that the plant does not name: a machine may have a bus with nothing on it. Null with
  /// errors.
  [[nodiscard]] static std::unique_ptr<World> make(const PlantFile& plant, std::span<const BusRate> rates,
                                                   Findings& findings);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  /// Plugs in the devices that are plugged in at time 0, and plans the events after `start`. Call it once.
  void start();
  /// Berth reached this milestone: plans the events that wait for it. Only the first call for each has an effect.
  void milestone(After after);

  [[nodiscard]] sim::World& sim() noexcept { return sim_; }
  [[nodiscard]] rt::Executor& executor() noexcept { return sim_.executor(); }
  /// Null if there is none with this name.
  [[nodiscard]] sim::Bus* bus(std::string_view name) noexcept { return sim_.find_bus(name); }
  /// Berth's own node on a bus, which events call "master". Null if there is no such bus.
  [[nodiscard]] std::unique_ptr<sim::Controller> attach_master(std::string_view bus,
                                                               sim::ControllerOptions options = {});

  /// In the order of the plant file.
  [[nodiscard]] std::span<const std::unique_ptr<SimDevice>> devices() const noexcept { return devices_; }
  [[nodiscard]] SimDevice* find(std::string_view name) noexcept;
  /// Carries out an event now, whatever it waits for. False if its device, bus or node does not exist.
  bool perform(const PlantEvent& event);

  [[nodiscard]] std::vector<Truth> truth() const;
  /// Pairs of powered devices on one bus with the same node-ID in use.
  [[nodiscard]] std::vector<std::pair<const SimDevice*, const SimDevice*>> duplicates() const;
  void add_observer(Observer& observer) { observers_.push_back(&observer); }
  void remove_observer(Observer& observer) noexcept { std::erase(observers_, &observer); }

  /// What survives the process: each device's memory, serial number, stored node-ID and whether it is plugged in. Text,
  /// one line per device. A state of other devices is refused.
  [[nodiscard]] std::string state() const;
  [[nodiscard]] Result<void> restore(std::string_view state);
  /// Restores from the file if it exists, and from then on rewrites it (by renaming, so that it is always whole)
  /// whenever a device's memory was written or a device was plugged or unplugged. Before `start`.
  [[nodiscard]] Result<void> keep_state(const std::string& path);

 private:
  friend class SimDevice;
  explicit World(std::uint64_t seed) : sim_(seed) {}
  bool make_buses(const PlantFile& plant, std::span<const BusRate> rates, Findings& findings);
  bool strike(const PlantEvent& event);
  bool nodes(const PlantEvent& event, std::vector<sim::Controller*>& found);
  bool make_gateways(const PlantFile& plant, Findings& findings);
  void tell(const SimDevice& device) noexcept;
  void save() noexcept;

  sim::World sim_;
  Descriptions descriptions_;
  Scripts scripts_;
  std::vector<std::unique_ptr<SimDevice>> devices_;
  std::vector<std::unique_ptr<SimGateway>> gateways_;
  std::vector<PlantEvent> events_;
  std::vector<Observer*> observers_;
  std::vector<After> reached_;
  std::string state_path_;
  bool started_ = false;
};

}  // namespace berth::plant
