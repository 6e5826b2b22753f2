/// Makes a device the NMT master of its bus (CiA 302-2), based on its own object dictionary:
///
///     network::add_manager_objects(builder);              // to the objects of its description
///     device::Device device(dispatcher, builder.build(), &flash, options);
///     network::DictionaryManager manager(dispatcher, device.values(),
///                                        [&](co::NmtCommand command) { device.apply(command); });
///     device.on().state = [&](NmtState state) { manager.own_state(state, device.node_id()); };
///     manager.network().observe([](const NetworkEvent& event) { print(text(event)); });
///     device.power_on();
///
/// Each time the device has booted, it reads its dictionary and boots the network (`DictionarySource` has the objects).
/// If bit 0 of its 1F80h is 0, it does nothing. Any SDO client may write the objects. Writes take effect at the next
/// boot-up of the device; those to a slave's configuration and to bits 2 and 3 of its 1F81h (boots, mandatory) at the
/// next boot-up of the slave; requests at once.
///
/// With bit 5 of 1F80h it is a flying master (`FlyingMaster`, with 1F90h): it boots the network when it becomes the
/// active master, and stops when it is no longer active. Call `power_off` when the device is switched off.
///
/// With 1F00h in its dictionary it is also the SDO manager, while it is the active master (`SdoRequests`).
///
/// Refused writes: 1F80h with a reserved bit, or with bit 5 but without 1F90h, 0609 0030; 1F90h:03 above 2, 0609 0030.
/// `NetworkRequests` handles 1F82h and 1F83h, which read the known states of the slaves; `ConfigurationRequests` 1F25h,
/// `ConfigurationUploads` 5F0Ah. Writing 1F25h of the device's own node-ID applies its entry in 1F22h to its own
/// dictionary (`configure_itself`), so that one transfer can configure a whole network list.
#pragma once

#include <array>
#include <bitset>
#include <functional>
#include <memory>
#include <optional>

#include "berth/manager/flying_master.hpp"
#include "berth/manager/node_id_source.hpp"
#include "berth/manager/sdo_requests.hpp"
#include "berth/network/configuration_requests.hpp"
#include "berth/network/configuration_uploads.hpp"
#include "berth/network/dictionary_source.hpp"
#include "berth/network/managed_bus.hpp"
#include "berth/network/network_requests.hpp"
#include "berth/od/values.hpp"

namespace berth::network {

struct ManagerObjects {
  std::uint8_t most = 127;              ///< highest node-ID of a slave, 1..127
  std::uint32_t startup = 1;            ///< default of 1F80h
  std::uint32_t longest_concise = 512;  ///< bytes for each slave in 1F22h; 0: no such object
  std::uint32_t longest_dcf = 0;        ///< in 1F20h; 0: neither 1F20h nor 1F21h
  std::uint32_t longest_eds = 0;        ///< in 1F23h; 0: neither 1F23h nor 1F24h
  std::uint32_t longest_program = 0;    ///< in 1F58h; 0: no such object
  bool flying = false;                  ///< 1F90h with CiA 302-2's times
  std::uint8_t priority = 1;            ///< default of 1F90h:03: 0 high, 1 medium, 2 low
  bool sdo_manager = false;             ///< 1F00h, 1F01h, 1F10h (`SdoRequests`)
  bool node_ids = false;                ///< 5F0Bh: the results for the node-IDs of the list (`NodeIdReport`); 5F05h
};
/// 102Ah, (1F20h, 1F21h), (1F22h), (1F23h, 1F24h), 1F25h to 1F27h, 1F53h to 1F55h, (1F58h), 1F80h to 1F8Ah without
/// 1F87h's kind of check, (1F90h), (1F00h, 1F01h, 1F10h), with 1F20h also 5F0Ah, (5F0Bh). 1016h belongs to the device.
void add_manager_objects(od::DescriptionBuilder& builder, const ManagerObjects& objects = {});

class DictionaryManager final : private od::Hook,
                                private manager::FlyingMaster::Owner,
                                private manager::NodeIdSource::User {
 public:
  /// All must stay. `apply`: applies an NMT command to the device.
  DictionaryManager(can::Dispatcher& dispatcher, od::Values& values, std::function<void(co::NmtCommand)> apply,
                    const NetworkTiming& timing = {});
  ~DictionaryManager() { assign_by(nullptr); }

  /// The NMT state that the device has entered, and its node-ID. Initialising ends the network's boot-up, the state
  /// after it starts it.
  void own_state(NmtState state, NodeId own) noexcept;
  /// A device that is switched off has no state. The next state is a cold start.
  void power_off() noexcept;

  /// Devices get their node-IDs before the network is booted, and while a slave is missing. `source` must stay as long
  /// as this object, or until another one replaces it. Null: assigns none and stops a running assignment. Not for a
  /// flying master.
  void assign_by(manager::NodeIdSource* source) noexcept;

  [[nodiscard]] NetworkBoot& network() noexcept { return network_; }
  [[nodiscard]] ManagedBus& bus() noexcept { return bus_; }
  /// State of the flying master; off without bit 5 of 1F80h.
  [[nodiscard]] const manager::FlyingMaster& flying() const noexcept { return flying_; }
  /// Null: its dictionary has no 1F00h.
  [[nodiscard]] const manager::SdoRequests* sdo_requests() const noexcept { return sdo_requests_.get(); }
  /// Called when the role has changed.
  void on_role(std::function<void()> callback) { on_role_ = std::move(callback); }
  [[nodiscard]] ConfigurationRequests& configurations() noexcept { return configurations_; }
  [[nodiscard]] ConfigurationUploads& uploads() noexcept { return uploads_; }
  /// Why a device with bit 0 of 1F80h has not started.
  [[nodiscard]] const std::optional<Error>& refused() const noexcept { return refused_; }

 private:
  od::AbortCode reading(const od::Values& values, ObjectRef ref,
                        std::span<const std::uint8_t>& value) noexcept override;
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  Result<void> begin(NodeId own);
  Result<void> lead(NodeId own, bool taken_over);
  rt::Task<void> assign_and_lead();
  void reset_unheard(std::bitset<128> answered);
  void source_gone() noexcept override { assign_by(nullptr); }
  void role_changed() noexcept override;
  void reset_all() noexcept override;
  void overheard(const co::NmtRequest& request) noexcept override { network_.error_control().overheard(request); }

  od::Values* values_;
  std::function<void()> on_role_;
  ManagedBus bus_;
  NetworkBoot network_;
  manager::FlyingMaster flying_;
  manager::ProgramTransfers transfers_;
  NetworkRequests requests_{network_};
  ConfigurationRequests configurations_;
  ConfigurationUploads uploads_;
  std::array<std::unique_ptr<DictionarySource>, 128> sources_;
  std::unique_ptr<manager::SdoRequests> sdo_requests_;  // only with object 1F00h
  manager::NodeIdSource* node_ids_ = nullptr;
  std::optional<Error> refused_;
  NodeId own_;
  NmtState state_ = NmtState::initialising;
  bool leads_ = false;                   // is the active flying master
  std::array<std::uint8_t, 4> shown_{};  // returned by `reading`
  rt::Scope assigning_;
};

}  // namespace berth::network
