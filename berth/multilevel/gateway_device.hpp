/// A whole gateway: a device on the bus above, one on each bus beneath, and the gateway processes of paper 3 between
/// them (docs/multilevel.md). Its application decides which signals cross, and when that is safe.
///
///     multilevel::GatewayDevice gateway(executor, above, {.upper = {.address = a, .node_id = NodeId(3)}});
///     gateway.add_bus(beneath, {.device = {.address = b, .node_id = NodeId(1)}});
///     gateway.power_on();
///
/// A bus beneath that has an NMT master in this device (`network::DictionaryManager`) is booted first:
///
///     auto& boom = gateway.add_bus(beneath, {.device = {...}, .description = with_manager_objects, .boots_first =
///     true}); network::DictionaryManager master(boom.dispatcher(), boom.device().values(),
///                                       [&](co::NmtCommand command) { boom.device().apply(command); });
///     boom.use(master.bus().sdo());
///     boom.device().on().state = [&](NmtState state) { master.own_state(state, NodeId(1)); };
///     master.network().observe([&](const network::NetworkEvent& event) {
///       if (event.kind == Kind::operational) boom.sub_bus().booted();
///       if (event.kind == Kind::halted) boom.sub_bus().failed(event.node);
///     });
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "berth/device/device.hpp"
#include "berth/multilevel/device_signals.hpp"
#include "berth/multilevel/emcy_gateway.hpp"
#include "berth/multilevel/metered_port.hpp"
#include "berth/multilevel/sdo_gateway.hpp"
#include "berth/multilevel/sub_bus.hpp"

namespace berth::multilevel {

struct GatewayOptions {
  device::Options upper{};
  device::TimedPort* host = nullptr;  ///< the slow host above, see `device::Device`
  /// Null: the objects of CiA 301 and of a gateway with `ports` buses beneath. Use `add_gateway_objects` for your own
  /// dictionary.
  std::shared_ptr<const od::Description> description{};
  unsigned ports = 1;
  device::NvMemory* memory = nullptr;
  EmcyGatewayOptions emcy{};
};
struct BusOptions {
  device::Options device{};
  std::shared_ptr<const od::Description> description{};  ///< null: the objects of CiA 301
  device::NvMemory* memory = nullptr;
  SdoGatewayOptions sdo{};   ///< its port is set
  bool boots_first = false;  ///< the upstream side starts after this bus has booted or failed
  device::TimedPort* host = nullptr;
};

/// All objects of a gateway for buses 1 to `ports`: SDO gateways, 5F00h, 5F03h, 5F04h, 1029h:F1h..
void add_gateway_objects(od::DescriptionBuilder& builder, unsigned ports = 1);

class GatewayDevice final : private device::Device::Observer {
 public:
  /// One bus beneath.
  class Bus {
   public:
    [[nodiscard]] device::Device& device() noexcept { return device_; }
    [[nodiscard]] can::Dispatcher& dispatcher() noexcept { return dispatcher_; }
    [[nodiscard]] MeteredPort& port() noexcept { return port_; }
    [[nodiscard]] SdoGateway& sdo() noexcept { return *gateway_; }
    [[nodiscard]] SubBus& sub_bus() noexcept { return sub_bus_; }
    /// Uses its master's client in place of its own. Before `power_on`; it must outlive this.
    void use(co::SdoClient& client) noexcept;
    /// `GatewayDevice::add_bus` makes it. Heartbeats that the device beneath supervises (1016h) are reported above; a
    /// master that hears them itself passes each event to `sub_bus().heartbeat`.
    Bus(GatewayDevice& owner, can::Port& port, unsigned number, const BusOptions& options);
    ~Bus();
    Bus(const Bus&) = delete;
    Bus& operator=(const Bus&) = delete;

   private:
    friend class GatewayDevice;
    MeteredPort port_;
    can::Dispatcher dispatcher_;
    device::Device device_;
    SubBus sub_bus_;
    std::optional<co::SdoClient> client_;
    std::optional<SdoGateway> gateway_;
    unsigned number_;
    bool boots_first_;
  };

  /// `above` must outlive it.
  GatewayDevice(rt::Executor& executor, can::Port& above, const GatewayOptions& options);
  ~GatewayDevice();
  /// `port` must outlive it. At most `most_ports` buses; before `power_on`. The reference stays valid.
  Bus& add_bus(can::Port& port, const BusOptions& options);

  /// Starts the buses beneath first, and the upstream side after all that boot first have booted or failed.
  void power_on();
  void power_off();
  [[nodiscard]] device::Device& upper() noexcept { return upper_; }
  [[nodiscard]] EmcyGateway& emcy() noexcept { return emcy_; }
  [[nodiscard]] Bus& bus(unsigned number) noexcept { return *buses_[number - 1]; }
  [[nodiscard]] std::size_t buses() const noexcept { return buses_.size(); }

  /// Sets the routing database, once, after all buses are added. Returns its errors; those signals are left out. Late
  /// signals are reported above (FF05h). Forwarding waits for `signals().set_safe(true)` and until all sides are
  /// operational: then the start-up is complete.
  std::vector<SignalProblem> set_signals(std::vector<Signal> table);
  /// Alternative, once: the table is in the objects of the upstream dictionary (`add_routing_objects`), which any SDO
  /// client may write; it takes effect at the device's next start. Safe until the application says otherwise.
  void signals_from_objects();
  /// Exists after `set_signals`, or after the objects were read.
  [[nodiscard]] SignalGateway& signals() noexcept { return *signals_->engine(); }

 private:
  void device_changed(const device::Device& device) noexcept override;
  void look() noexcept;
  void come_up() noexcept;
  void make_signals();

  rt::Executor* executor_;
  MeteredPort port_;
  can::Dispatcher dispatcher_;
  device::Device upper_;
  EmcyGateway emcy_;
  EmcyLayout layout_;  // unless 5F03h sets another
  std::vector<std::unique_ptr<Bus>> buses_;
  std::optional<DeviceSignals> signals_;
  NmtState upper_state_ = NmtState::initialising;
  bool waits_ = false;      // for the buses beneath
  bool was_reset_ = false;  // the upstream side, since `look`
  rt::Later<GatewayDevice, &GatewayDevice::look> look_;
};

}  // namespace berth::multilevel
