/// Berth's role among the masters of a bus (`[bus.NAME.flying_master]`; docs/flying-master.md). Opens the port to the
/// main job while Berth is the active master, and maintains `BusServices::master`.
///
/// Berth starts warm: it never resets all nodes, so that running devices are not touched.
#pragma once

#include "berth/manager/flying_master.hpp"
#include "berth/operate/role_port.hpp"
#include "berth/operate/slot_table.hpp"

namespace berth::operate {

class Mastership final : private manager::FlyingMaster::Owner {
 public:
  /// All must outlive this. The services use `port`.
  Mastership(BusServices& services, SlotTable& slots, RolePort& port);
  ~Mastership();

  /// Takes part while the port takes frames. The port is closed until Berth is the active master.
  void start();
  /// Stops taking part. The port stays as it is, so that a leaving active master's frames are sent.
  void stop() noexcept;

 private:
  void port_changed();
  void begin();
  void role_changed() noexcept override;
  void reset_all() noexcept override {}
  void overheard(const co::NmtRequest&) noexcept override {}
  void note();
  void tell();

  BusServices& s_;
  SlotTable& slots_;
  RolePort& port_;
  manager::FlyingMaster flying_;
  std::string told_;
  bool started_ = false;
  bool takes_part_ = false;
};

}  // namespace berth::operate
