/// A device of several ports in a plant (`[[gateway]]`): paper 3's gateway between its device on the bus above and
/// those on the buses beneath (docs/multilevel.md), wherever these sit: on simulated buses or on ports. Inside of room
/// `plant`.
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

/// The built-in dictionary of a gateway with so many buses beneath; `signals`: `PlantGateway::signals`; `hardware`:
/// 5F01h, 0: no such object.
[[nodiscard]] std::shared_ptr<const od::Description> gateway_description(unsigned ports, unsigned signals = 0,
                                                                         std::uint32_t hardware = 0);
/// The places of signals and the PDOs for them, of any of a gateway's devices; 0: none.
void add_signals(od::DescriptionBuilder& builder, unsigned signals);

/// The built-in dictionary of such a device is the gateway's, or its description has the objects; else the finding
/// names it.
[[nodiscard]] bool check_gateway(const PlantGateway& plan, const device::Device& above, Findings& findings);

/// A device of the plant, as its gateway has it.
class GatewaySide {
 public:
  virtual ~GatewaySide() = default;
  [[nodiscard]] virtual const PlantDevice& plan() const noexcept = 0;
  [[nodiscard]] virtual device::Device& device() noexcept = 0;
  struct Inside {
    can::Dispatcher* dispatcher = nullptr;
    network::DictionaryManager* manager = nullptr;  ///< null: it is no NMT master
    multilevel::MeteredPort* meter = nullptr;       ///< where its frames go; null: no delay of a signal is known
  };
  [[nodiscard]] virtual Inside inside() noexcept = 0;
  /// Has power; it may still wait for the buses beneath.
  [[nodiscard]] virtual bool powered() const noexcept = 0;
  /// A device beneath: is on its bus and has power as `above` is and has.
  virtual void follow(const GatewaySide& above) noexcept = 0;

  /// @name Of the device above: with power on it waits until the buses beneath have booted
  /// @{
  [[nodiscard]] bool boots_last() const noexcept { return boots_last_; }
  void set_boots_last(bool last) noexcept { boots_last_ = last; }
  /// True: it has power on and is to wait.
  bool begin_wait() noexcept { return waits_ = boots_last_; }
  /// True: it waited, and is to boot.
  bool end_wait() noexcept { return std::exchange(waits_, false); }
  /// @}

 private:
  bool boots_last_ = false;
  bool waits_ = false;
};

class SimGateway {
 public:
  /// All stay. Which of its nodes beneath are gateways themselves, and how deep it goes, the plant says.
  SimGateway(rt::Executor& executor, GatewaySide& above, std::vector<GatewaySide*> beneath, const PlantGateway& plan,
             const PlantFile& plant);
  /// Something of this device changed: one of the gateway's own is looked at soon.
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
    std::unique_ptr<co::SdoClient> client;  // where the device is no NMT master, which has one
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
  multilevel::EmcyLayout layout_;  // as long as 5F03h says nothing
  std::vector<std::unique_ptr<Port>> ports_;
  NmtState state_ = NmtState::initialising;  // above
  bool was_reset_ = false;
  std::optional<multilevel::DeviceSignals> signals_;  // only with routing objects
  rt::Later<SimGateway, &SimGateway::look> look_;
};

}  // namespace berth::plant
