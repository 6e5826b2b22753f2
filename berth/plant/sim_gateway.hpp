/// A device with several ports in a plant (`[[gateway]]`): paper 3's gateway between its device on the bus above and
/// those on the buses beneath (docs/multilevel.md), on simulated buses or on ports. Inside of room `plant`.
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/device/device.hpp"
#include "berth/multilevel/gateway_device.hpp"
#include "berth/network/dictionary_manager.hpp"
#include "berth/plant/plant_file.hpp"
#include "berth/rt/later.hpp"

namespace berth::plant {

/// The built-in dictionary of a gateway with this number of buses beneath; `signals`: `PlantGateway::signals`;
/// `hardware`: 5F01h, 0: no such object.
[[nodiscard]] std::shared_ptr<const od::Description> gateway_description(unsigned ports, unsigned signals = 0,
                                                                         std::uint32_t hardware = 0);
/// Adds the places of signals and their PDOs to any device of a gateway; 0: none.
void add_signals(od::DescriptionBuilder& builder, unsigned signals);

/// True: the device has the gateway's built-in dictionary, or its description has the objects; else the finding names
/// it.
[[nodiscard]] bool check_gateway(const PlantGateway& plan, const device::Device& above, Findings& findings);

/// A device of the plant, as seen by its gateway.
class GatewaySide {
 public:
  virtual ~GatewaySide() = default;
  [[nodiscard]] virtual const PlantDevice& plan() const noexcept = 0;
  [[nodiscard]] virtual device::Device& device() noexcept = 0;
  struct Inside {
    can::Dispatcher* dispatcher = nullptr;
    network::DictionaryManager* manager = nullptr;  ///< null: it is not an NMT master
    multilevel::MeteredPort* meter = nullptr;       ///< for its frames; null: delays of signals are unknown
  };
  [[nodiscard]] virtual Inside inside() noexcept = 0;
  /// It has power; it may still wait for the buses beneath.
  [[nodiscard]] virtual bool powered() const noexcept = 0;
  /// For a device beneath: takes over from `above` whether it is on its bus and has power.
  virtual void follow(const GatewaySide& above) noexcept = 0;

  /// @name For the device above: after power-on it waits until the buses beneath have booted
  /// @{
  [[nodiscard]] bool boots_last() const noexcept { return boots_last_; }
  void set_boots_last(bool last) noexcept { boots_last_ = last; }
  /// True: it has power and must wait.
  bool begin_wait() noexcept { return waits_ = boots_last_; }
  /// True: it waited, and may boot.
  bool end_wait() noexcept { return std::exchange(waits_, false); }
  /// @}

 private:
  bool boots_last_ = false;
  bool waits_ = false;
};

class SimGateway {
 public:
  /// All must outlive it. `plant` says which of its nodes beneath are gateways themselves, and how deep it goes.
  SimGateway(rt::Executor& executor, GatewaySide& above, std::vector<GatewaySide*> beneath, const PlantGateway& plan,
             const PlantFile& plant);
  /// Something of this device changed; if it is the gateway's, it is checked soon.
  void changed(const device::Device& device) noexcept;
  [[nodiscard]] multilevel::EmcyGateway& emcy() noexcept { return emcy_; }
  /// Null: it has no routing objects.
  [[nodiscard]] multilevel::DeviceSignals* signals() noexcept { return signals_ ? &*signals_ : nullptr; }

 private:
  struct Port {
    Port(SimGateway& owner, GatewaySide& side, multilevel::SdoGatewayOptions options);
    [[nodiscard]] bool boots_first() const noexcept;
    GatewaySide* side;
    unsigned number;
    std::unique_ptr<co::SdoClient> client;  // if the device is not an NMT master, which has its own
    multilevel::SdoGateway sdo;
    multilevel::SubBus bus;
  };
  void look() noexcept;
  void look_above() noexcept;
  [[nodiscard]] bool settled() const noexcept;
  [[nodiscard]] static multilevel::EmcyGatewayOptions emcy_options(const PlantGateway& plan);

  rt::Executor* executor_;
  GatewaySide* above_;
  multilevel::EmcyGateway emcy_;
  multilevel::EmcyLayout layout_;  // unless 5F03h sets another
  std::vector<std::unique_ptr<Port>> ports_;
  NmtState state_ = NmtState::initialising;  // above
  bool was_reset_ = false;
  std::optional<multilevel::DeviceSignals> signals_;  // only with routing objects
  rt::Later<SimGateway, &SimGateway::look> look_;
};

}  // namespace berth::plant
