/// The master's port and its own device: recovery from bus-off, rest while the port takes no frame, and when the
/// master's own device may send.
#pragma once

#include "berth/operate/agenda.hpp"
#include "berth/operate/found_devices.hpp"
#include "berth/operate/master_device.hpp"
#include "berth/operate/slot_startup.hpp"
#include "berth/operate/slot_table.hpp"

namespace berth::operate {

class PortHealth final : public MasterState, private can::StatusHandler {
 public:
  class Owner {
   public:
    virtual void port_rests() noexcept = 0;
    virtual void port_goes_on() = 0;

   protected:
    ~Owner() = default;
  };
  PortHealth(BusServices& services, SlotTable& slots, Agenda& agenda, FoundDevices& found, Owner& owner);

  /// Watches from now on. False: the port does not take Berth's frames yet.
  bool begin();
  void end() noexcept;
  [[nodiscard]] bool resting() const noexcept { return resting_; }

  /// The master's own messages begin after no other device was found under its node-ID.
  void speak();
  void fall_silent() noexcept;
  void apply(co::NmtCommand command) noexcept override { device_.apply(command); }
  /// Of the master's own device.
  [[nodiscard]] od::Values& values() noexcept { return device_.values(); }

 private:
  class Restart final : public rt::Job {
   public:
    explicit Restart(PortHealth& health) noexcept : health_(health) {}
    void run() noexcept override { health_.restart(); }

   private:
    PortHealth& health_;
  };
  void changed(const can::Status& status, rt::Time at) noexcept override;
  [[nodiscard]] bool usable(const can::Status& status) const noexcept;
  void rest_or_go_on(const can::Status& status);
  void go_to_rest(const std::string& why);
  void count(const can::Status& status) noexcept;
  void way_out_of_bus_off();
  void restart();

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  FoundDevices& found_;
  Owner& owner_;
  MasterDevice device_;
  Restart job_;
  rt::Time restarted_{};        // last restart after bus-off
  std::uint32_t restarts_ = 0;  // in a row
  bool watches_ = false;
  bool resting_ = false;
  bool off_ = false;  // bus-off
};

}  // namespace berth::operate
