/// What the parts of a device are tried on by themselves: a bus, a dictionary, an NMT slave, and no device around them.
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "berth/co/nmt_slave.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/device/errors.hpp"
#include "berth/od/values.hpp"
#include "rig.hpp"

namespace berth::device::test {

/// `Rig` and, on its bus, the surroundings of one part of the device with node-ID 9.
struct PartRig : Rig, private co::NmtSlave::Owner, private Errors::Owner {
  explicit PartRig(const Timing& timing = {}, std::shared_ptr<const od::Description> d = minimal_description())
      : controller(bus.attach()),
        port(world.executor(), *controller, how, Random(1)),
        dispatcher(world.executor(), port),
        values(std::move(d), NodeId(9)),
        nmt(dispatcher, static_cast<co::NmtSlave::Owner&>(*this)),
        host(&port, timing),
        errors(dispatcher, values, nmt, host, static_cast<Errors::Owner&>(*this)) {}

  /// Pre-operational with node-ID 9; EMCYs go out.
  void boot() {
    nmt.power_on();
    errors.start();
    errors.enable(true);
    run(milliseconds(1));
    record.clear();
  }

  const Timing how{};  // of the port: at once
  std::unique_ptr<sim::Controller> controller;
  TimedPort port;
  can::Dispatcher dispatcher;
  od::Values values;
  co::NmtSlave nmt;
  Host host;
  Errors errors;
  std::vector<ObjectRef> changed;  // told by the errors

 private:
  void reset(co::NmtReset, rt::Time) noexcept override { nmt.initialised(NodeId(9)); }
  void state_changed(NmtState, NmtState, rt::Time) noexcept override {}
  void value_changed(ObjectRef object) noexcept override { changed.push_back(object); }
};

}  // namespace berth::device::test
