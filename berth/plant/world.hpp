/// The simulated world that a plant file describes: buses, whole devices with their memory, and what goes wrong when.
///
///     Findings findings;
///     auto world = plant::World::make(plant, rates, findings);   // null when a finding is an error
///     auto port = world->attach_master("backbone");              // Berth's own node; destroy it before the world
///     world->start();
///     world->sim().run_for(1s);
///
/// The ground truth (`truth`, `duplicates`, `Observer`) is for tests, reports and Studio; nothing that works on the bus
/// may look at it.
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

/// What is so, whatever Berth believes.
struct Truth {
  std::string name;
  std::string bus;
  LssAddress address;  ///< what it answers; a changed serial number counts from the next power-on
  bool plugged = false;
  bool powered = false;        ///< plugged and switched on
  bool booting = false;        ///< powered, and hears nothing yet
  bool deaf = false;           ///< by `SimDevice::deaf`
  Duration late{0};            ///< by `SimDevice::slow`: it answers so much later
  NodeId active;               ///< in use now
  NodeId pending;              ///< taken at the next reset communication
  NodeId persistent;           ///< what the next power-on would load
  std::uint32_t bit_rate = 0;  ///< of its controller, bit/s
  NmtState state = NmtState::initialising;
  bool leads = false;                ///< a flying master, and the active one
  NodeId active_master;              ///< as a flying master knows it
  std::uint64_t memory_writes = 0;   ///< begun
  std::uint64_t memory_written = 0;  ///< ended, with all that was to be written
  device::Leds leds;                 ///< what its indicators show; dark without power

  /// It is the device that a slot table calls so: one without a serial number is known by its node-ID.
  [[nodiscard]] bool is(const Identity& named) const noexcept {
    const NodeId own = powered ? active : persistent;
    return Identity(address).agrees(named) && (named.has_serial() || own == named.at);
  }
  /// The same by the node-ID that it has stored as well, which it may use from the next power-on only.
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

  /// Onto the bus, with power; nothing happens when it is plugged already.
  void plug() noexcept;
  /// Off the bus, without power.
  void unplug() noexcept;
  /// Power of a plugged device.
  void power(bool on) noexcept;
  /// The firmware starts anew, as by a watchdog.
  void reset() noexcept;
  /// Hears nothing for `duration`; 0 = from now on.
  void deaf(Duration duration);
  /// Answers `latency` later than it would for `duration`; 0 = from now on.
  void slow(Duration latency, Duration duration);
  /// Hears, and answers as fast, as before `deaf` and `slow`.
  friend void recover(SimDevice& device) noexcept {
    ++device.deafness_;
    ++device.slowness_;
    device.port_.deaf(device::TimedPort::Deaf::fault, false);
    device.port_.slow(Duration::zero());
  }
  /// What its next power-on finds changed.
  struct NextPowerOn {
    std::optional<std::uint32_t> serial{};
    std::optional<NodeId> node_id{};  ///< the stored one, or what switches say
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
  /// Of its programs; null: it is not programmed.
  friend device::SimFlash* program_memory(SimDevice& device) noexcept { return device.program_flash_.get(); }
  /// Of the node-IDs that it has given; null: it is no master, or a flying one.
  friend SimListMemory* list_memory(SimDevice& device) noexcept { return device.master_.memory.get(); }
  [[nodiscard]] bool plugged() const noexcept { return plugged_; }
  [[nodiscard]] bool powered() const noexcept override { return powered_; }
  [[nodiscard]] Truth truth() const;
  /// Bytes that this device takes, without the shared description.
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
  unsigned deafness_ = 0;  // number of the last `deaf`, so that an older one's end does not end it
  unsigned slowness_ = 0;
  std::optional<unsigned> error_flags_;  // the fault that they are; only of a controller of CAN 2.0A
  bool plugged_ = false;
  bool powered_ = false;
};

/// A bus of the machine file: what a plant bus without a bit rate of its own gets.
struct BusRate {
  std::string name;
  std::uint32_t bit_rate = 0;  ///< bit/s
};

class World {
 public:
  /// Told from jobs, after the fact. Must only look.
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

  /// Builds it; nothing has power until `start`. Findings: a bus without a bit rate anywhere, a device description that
  /// cannot be read (errors); what an EDS reader has to say about one (as it says it, errors only). A bus of `rates`
  /// that the plant does not name is made too: a machine may have a bus with nothing on it. Null with errors.
  [[nodiscard]] static std::unique_ptr<World> make(const PlantFile& plant, std::span<const BusRate> rates,
                                                   Findings& findings);
  ~World();
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  /// Plugs in what is plugged in at time 0, and plans the events after `start`. Once.
  void start();
  /// Berth reached it: events that wait for it are planned. Only the first call of each counts.
  void milestone(After after);

  [[nodiscard]] sim::World& sim() noexcept { return sim_; }
  [[nodiscard]] rt::Executor& executor() noexcept { return sim_.executor(); }
  /// Null when there is none of that name.
  [[nodiscard]] sim::Bus* bus(std::string_view name) noexcept { return sim_.find_bus(name); }
  /// Berth's own node on a bus, by which events mean "master". Null when there is no such bus.
  [[nodiscard]] std::unique_ptr<sim::Controller> attach_master(std::string_view bus,
                                                               sim::ControllerOptions options = {});

  /// In the order of the plant file.
  [[nodiscard]] std::span<const std::unique_ptr<SimDevice>> devices() const noexcept { return devices_; }
  [[nodiscard]] SimDevice* find(std::string_view name) noexcept;
  /// Does an event now, whatever it waits for. False when it names a device, bus or node that is not there.
  bool perform(const PlantEvent& event);

  [[nodiscard]] std::vector<Truth> truth() const;
  /// Pairs of powered devices on one bus with the same node-ID in use.
  [[nodiscard]] std::vector<std::pair<const SimDevice*, const SimDevice*>> duplicates() const;
  void add_observer(Observer& observer) { observers_.push_back(&observer); }
  void remove_observer(Observer& observer) noexcept { std::erase(observers_, &observer); }

  /// What outlives a process: each device's memory, serial number, stored node-ID and whether it is plugged in. Text,
  /// one line per device. A state of other devices is refused.
  [[nodiscard]] std::string state() const;
  [[nodiscard]] Result<void> restore(std::string_view state);
  /// Restores from the file when it is there, and from now on writes it anew (by renaming, so that it is whole at any
  /// time) whenever a device's memory was written or a device was plugged or unplugged. Before `start`.
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
