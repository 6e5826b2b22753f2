/// The diagnosis and error interface of paper 5 §4 for an application: the state of the device, of its bus, of the
/// nodes that it supervises (1016h) and whose emergencies it receives (1028h).
#pragma once

#include "berth/can/port.hpp"
#include "berth/device/device.hpp"
#include "berth/process/process.h"

namespace berth::process {

/// Makes everything unknown: the states of all nodes, and the own state.
void forget_all(berth_diagnosis& told) noexcept;
/// Sets the state of the bus, from its port.
void tell_bus(const can::Status& bus, berth_diagnosis& told) noexcept;

class DeviceDiagnosis {
 public:
  /// Adds to the device's callbacks: existing ones are still called. All must outlive the device's running. `port`:
  /// null = nothing is known of the bus.
  DeviceDiagnosis(device::Device& device, berth_diagnosis& told, const can::Port* port);
  DeviceDiagnosis(const DeviceDiagnosis&) = delete;
  DeviceDiagnosis& operator=(const DeviceDiagnosis&) = delete;

  /// Updates what no callback reports: the device's own state, and its bus.
  void refresh() noexcept;

 private:
  void heartbeat(const co::HeartbeatEvent& event) noexcept;
  void emergency(NodeId node, const co::Emcy& message) noexcept;
  const device::Device* device_;
  berth_diagnosis* told_;
  const can::Port* port_;
};

}  // namespace berth::process
