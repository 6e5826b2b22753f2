/// What a device knows of itself, of its bus and of the nodes that it supervises (1016h) and whose emergencies it
/// takes (1028h), as the diagnosis and error interface of paper 5 §4 tells an application.
#pragma once

#include "berth/can/port.hpp"
#include "berth/device/device.hpp"
#include "berth/process/process.h"

namespace berth::process {

/// Nothing is known yet: no node's state, nor the own one.
void forget_all(berth_diagnosis& told) noexcept;
/// The bus, as its port has it.
void tell_bus(const can::Status& bus, berth_diagnosis& told) noexcept;

class DeviceDiagnosis {
 public:
  /// Adds to the device's callbacks: those that are set already are called, too. All must outlive the device's running.
  /// `port`: null = nothing is known of the bus.
  DeviceDiagnosis(device::Device& device, berth_diagnosis& told, const can::Port* port);
  DeviceDiagnosis(const DeviceDiagnosis&) = delete;
  DeviceDiagnosis& operator=(const DeviceDiagnosis&) = delete;

  /// What is not told by callbacks: the device's own state, and its bus.
  void refresh() noexcept;

 private:
  void heartbeat(const co::HeartbeatEvent& event) noexcept;
  void emergency(NodeId node, const co::Emcy& message) noexcept;
  const device::Device* device_;
  berth_diagnosis* told_;
  const can::Port* port_;
};

}  // namespace berth::process
