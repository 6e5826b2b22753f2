/// A device of several ports in a plant (`[[gateway]]`): paper 3's gateway between its device on the bus above and
/// those on the buses beneath (docs/multilevel.md). Inside of room `plant`.
#pragma once

#include <memory>
#include <vector>

#include "berth/multilevel/gateway_device.hpp"
#include "berth/plant/plant_file.hpp"
#include "berth/rt/later.hpp"

namespace berth::plant {

class SimDevice;

/// The built-in dictionary of a gateway with so many buses beneath.
[[nodiscard]] std::shared_ptr<const od::Description> gateway_description(unsigned ports);

class SimGateway {
 public:
  /// All stay. `levels_beneath`: gateways one beneath the other, under this one.
  SimGateway(rt::Executor& executor, SimDevice& above, std::vector<SimDevice*> beneath, const PlantGateway& plan,
             unsigned levels_beneath);
  /// Something of this device changed: one of the gateway's own is looked at soon.
  void changed(const SimDevice& device) noexcept;
  [[nodiscard]] multilevel::EmcyGateway& emcy() noexcept { return emcy_; }

 private:
  struct Port {
    Port(SimGateway& owner, SimDevice& device, multilevel::SdoGatewayOptions options);
    [[nodiscard]] bool boots_first() const noexcept;
    SimDevice* device;
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
  SimDevice* above_;
  multilevel::EmcyGateway emcy_;
  std::vector<std::unique_ptr<Port>> ports_;
  NmtState state_ = NmtState::initialising;  // above
  bool was_reset_ = false;
  rt::Later<SimGateway, &SimGateway::look> look_;
};

}  // namespace berth::plant
