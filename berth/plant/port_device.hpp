/// A device of a plant file on a port outside the simulator, such as SocketCAN, in real time, among real devices.
///
///     PortDevices devices(executor);
///     auto* device = devices.add(plan, std::move(port), 125'000, random, findings);   // null: findings say why
///     auto kept = devices.keep_state("left.state");
///     device->power(true);
///
/// Each has its own port, and so its own place in the order of frames. A plant file's settings for the wire (`queue`,
/// `disturb`, `overrun`, cables) belong to the port and have no effect here.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/base/random.hpp"
#include "berth/base/result.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/can/port.hpp"
#include "berth/device/device.hpp"
#include "berth/plant/device_plan.hpp"
#include "berth/plant/odd_answers.hpp"
#include "berth/plant/plant_file.hpp"
#include "berth/plant/sim_gateway.hpp"
#include "berth/script/behaviour.hpp"

namespace berth::plant {

class PortDevices;

class PortDevice final : public GatewaySide,
                         private device::Device::Observer,
                         private device::SimFlash::Watcher,
                         private script::Behaviour::Listener {
 public:
  /// Its parts besides its plan.
  struct Parts {
    const Described* described = nullptr;
    std::optional<script::Script> script;
    std::unique_ptr<can::Port> port;
    std::uint32_t rate = 0;  ///< bit/s for its blank memory, if the plan gives none; 0: it knows none
    bool metered = false;    ///< part of a gateway
  };
  PortDevice(PortDevices& all, rt::Executor& executor, const PlantDevice& plan, Parts parts, Random random);
  ~PortDevice() override;
  PortDevice(const PortDevice&) = delete;
  PortDevice& operator=(const PortDevice&) = delete;

  void power(bool on) noexcept;
  [[nodiscard]] bool powered() const noexcept override { return powered_; }
  [[nodiscard]] const std::string& name() const noexcept { return plan_.name; }
  [[nodiscard]] const PlantDevice& plan() const noexcept override { return plan_; }
  [[nodiscard]] const device::Device& device() const noexcept { return device_; }
  [[nodiscard]] device::Device& device() noexcept override { return device_; }
  [[nodiscard]] can::Status port_status() const noexcept { return port_->status(); }
  /// Frames lost because its firmware was slow or deaf, as planned; the port's own losses are in `port_status`.
  [[nodiscard]] std::uint64_t lost() const noexcept { return host_.lost(); }

 private:
  friend class PortDevices;
  [[nodiscard]] Inside inside() noexcept override {
    return {&dispatcher_, master_.manager.get(), meter_ ? &*meter_ : nullptr};
  }
  void follow(const GatewaySide& above) noexcept override { power(above.powered()); }
  void device_changed(const device::Device& device) noexcept override;
  void write_began() noexcept override {}
  void write_ended() noexcept override;
  void cut() noexcept override {}
  void script_told(const script::Message& told) noexcept override;
  bool script_must_end() noexcept override;

  PortDevices* all_;
  PlantDevice plan_;
  device::Timing timing_;
  device::SimFlash flash_;
  std::unique_ptr<device::SimFlash> program_flash_;  // only with programs
  std::unique_ptr<can::Port> port_;
  device::TimedPort host_;
  std::optional<multilevel::MeteredPort> meter_;  // only of a gateway
  can::Dispatcher dispatcher_;
  mutable device::Device device_;
  std::unique_ptr<script::Behaviour> behaviour_;  // only with a script
  OddAnswers odd_;
  PlantMastery master_;
  bool powered_ = false;
};

/// The devices of one process, and the file that keeps what they remember.
class PortDevices {
 public:
  /// Called from jobs, after the event. Must only look.
  class Observer {
   public:
    virtual void device_changed(const PortDevice& device) noexcept = 0;
    /// `keep_state`'s file could not be written; its content is unchanged.
    virtual void state_not_kept() noexcept = 0;
    /// Its script printed a line or ended.
    virtual void script_told(const PortDevice&, const script::Message&) noexcept {}
    /// As `script::Behaviour::Listener::script_must_end`, of every script.
    virtual bool scripts_must_end() noexcept { return false; }

   protected:
    ~Observer() = default;
  };

  explicit PortDevices(rt::Executor& executor, Observer* observer = nullptr)
      : executor_(&executor), observer_(observer) {}

  /// Adds a device without power. Null: its description or its script cannot be read. `rate` as in `PortDevice::Parts`.
  /// `part`: its part in a gateway (`PlantFile::gateway_part`).
  PortDevice* add(const PlantDevice& plan, std::unique_ptr<can::Port> port, std::uint32_t rate, Random random,
                  Findings& findings, GatewayPart part = {});
  /// Joins devices that are here to this gateway of the plant; the devices beneath share the power of the one above.
  /// False: one is not here, or (an error) its description has no objects of a gateway. Before `power`.
  [[nodiscard]] bool add_gateway(const PlantGateway& plan, const PlantFile& plant, Findings& findings);
  [[nodiscard]] std::span<const std::unique_ptr<PortDevice>> all() const noexcept { return devices_; }

  /// What survives the process, as text with one line per device, in the form of `World::state`. Lines of devices that
  /// are not here are kept unchanged.
  [[nodiscard]] std::string state() const;
  [[nodiscard]] Result<void> restore(std::string_view state);
  /// Restores from the file if it exists, and from then on rewrites it whenever a device's memory was written. Before
  /// `power`.
  [[nodiscard]] Result<void> keep_state(const std::string& path);

 private:
  friend class PortDevice;
  [[nodiscard]] PortDevice* find(std::string_view name) noexcept;
  void tell(const PortDevice& device) noexcept;
  void save() noexcept;

  rt::Executor* executor_;
  Observer* observer_;
  Descriptions descriptions_;
  Scripts scripts_;
  std::vector<std::unique_ptr<PortDevice>> devices_;
  std::vector<std::unique_ptr<SimGateway>> gateways_;  // of these
  std::vector<Kept> others_;
  std::string state_path_;
};

}  // namespace berth::plant
