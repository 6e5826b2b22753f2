/// Berth's part among the masters of a bus (`[bus.NAME.flying_master]`; docs/flying-master.md): opens the port to the
/// main job while Berth is the active master, and keeps `BusServices::master`.
///
/// Berth starts warm: it never resets all nodes, because a device that runs is not touched.
#pragma once

#include "berth/manager/flying_master.hpp"
#include "berth/operate/role_port.hpp"
#include "berth/operate/slot_table.hpp"

namespace berth::operate {

class Mastership final : private manager::FlyingMaster::Owner {
 public:
  /// All must stay. The services are those over `port`.
  Mastership(BusServices& services, SlotTable& slots, RolePort& port);
  ~Mastership();

  /// Takes part as long as the port takes frames. Until Berth is the active master the port is closed.
  void start();
  /// Takes part no longer. What the port is stays: what an active master sends when it leaves goes out.
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
