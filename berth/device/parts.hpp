/// The parts of a device, each of which owns its state. Each gets references to those above it in this list (services
/// and errors know each other); `tests/device` tests each alone. `Lifecycle` orders their start and stop.
#pragma once

#include <memory>

#include "berth/device/application.hpp"
#include "berth/device/bus_off.hpp"
#include "berth/device/error_control.hpp"
#include "berth/device/errors.hpp"
#include "berth/device/host.hpp"
#include "berth/device/lss_slave.hpp"
#include "berth/device/node_id_object.hpp"
#include "berth/device/node_id_schemes.hpp"
#include "berth/device/object_services.hpp"
#include "berth/device/own_identifiers.hpp"
#include "berth/device/programming.hpp"
#include "berth/device/stored_objects.hpp"

namespace berth::device {

/// The surroundings of a device. All must outlive it.
struct Surroundings {
  can::Dispatcher* dispatcher;
  NvMemory* memory;  ///< null: nothing is stored
  TimedPort* port;   ///< beneath the dispatcher, if it is this device's own; else null
  Timing timing;
  ProgramOptions programs;
};

struct DeviceParts {
  DeviceParts(const Surroundings& on, const Options& options, od::Values& values, co::NmtSlave& nmt,
              LssSlave::Owner& lss_owner, NodeIdSchemes::Owner& schemes_owner);

  Host host;
  Application application;
  Errors errors;
  ErrorControl error_control;
  BusOffRecovery bus_off;
  ObjectServices services;
  LssSlave lss;
  NodeIdSchemes schemes;
  OwnIdentifiers own_identifiers;
  StoredObjects stored;
  std::unique_ptr<NodeIdObject> node_id_object;  ///< only with Options::node_id_object
  std::unique_ptr<Programming> programming;      ///< only with a memory for programs

  /// Bytes held outside the object.
  [[nodiscard]] std::size_t memory() const noexcept;
};

}  // namespace berth::device
