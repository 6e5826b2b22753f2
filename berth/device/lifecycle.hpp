/// Power, resets and NMT states of a device: the order in which its parts start and stop.
///
///     power_on             -> booting (hears nothing, `Timing::boot`) -> run
///     NMT or LSS resets    -> booting (`Timing::reset`)               -> run
///     run                  -> node-ID and bit rate, values, then boot-up; without a node-ID: initialising, where only
///                             LSS and the other schemes hear
///     a scheme gives one   -> values of 1000h..1FFFh, boot-up
///
/// The NMT state decides which services run (`co::services_in`); error control follows each state.
#pragma once

#include "berth/co/nmt_slave.hpp"
#include "berth/device/parts.hpp"

namespace berth::device {

class Lifecycle final : private co::NmtSlave::Owner,
                        private LssSlave::Owner,
                        private NodeIdSchemes::Owner,
                        private rt::Job {
 public:
  class Owner {
   public:
    /// The ground truth changed: power, NMT state, one of the node-IDs. Must only read.
    virtual void device_changed() noexcept = 0;

   protected:
    ~Owner() = default;
  };
  /// Off until `power_on`. All must outlive it.
  Lifecycle(const Surroundings& on, const Options& options, od::Values& values, Owner& owner);
  /// Sends nothing on the bus, and calls nothing.
  ~Lifecycle();

  /// See `Device::power_on` and `Device::power_off`.
  void power_on() noexcept;
  void power_off() noexcept;
  [[nodiscard]] bool powered() const noexcept { return parts_.lss.powered(); }
  /// Powered but not receiving yet: after power-on or during a reset.
  [[nodiscard]] bool booting() const noexcept { return begins_.has_value(); }
  /// Status of the controller.
  [[nodiscard]] can::Status status() const noexcept { return dispatcher_->port().status(); }
  [[nodiscard]] co::NmtSlave& nmt() noexcept { return nmt_; }
  [[nodiscard]] const co::NmtSlave& nmt() const noexcept { return nmt_; }
  [[nodiscard]] DeviceParts& parts() noexcept { return parts_; }
  [[nodiscard]] const DeviceParts& parts() const noexcept { return parts_; }

 private:
  void reset(co::NmtReset what, rt::Time at) noexcept override;
  void state_changed(NmtState from, NmtState to, rt::Time at) noexcept override;
  void run() noexcept override;
  void begin(Reset what, rt::Duration own_time) noexcept;
  void reset_values(od::Area area) noexcept;
  void start_services() noexcept;
  void stop_services() noexcept;
  void set_services(const co::Services& was, const co::Services& now) noexcept;
  void self_start() noexcept;
  void check_memory(Reset what) noexcept;
  void reset_by_lss(co::NmtCommand command) noexcept override { nmt_.apply(command); }
  void hush(bool on) noexcept override;
  void lss_heard(bool answered) noexcept override { parts_.schemes.master_heard(answered); }
  void node_id_given(NodeId id) noexcept override;
  void node_id_lost() noexcept override { nmt_.apply(co::NmtCommand::reset_communication); }
  void changed() noexcept override {
    if (owner_ != nullptr) owner_->device_changed();
  }

  can::Dispatcher* dispatcher_;
  od::Values* values_;
  Owner* owner_;
  co::NmtSlave nmt_;
  DeviceParts parts_;
  std::optional<Reset> begins_;
  bool unsaved_ = false;  // `Timing::needs_first_save`: as found when the firmware started
};

}  // namespace berth::device
