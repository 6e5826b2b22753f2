/// The NMT slave state machine of a device (CiA 301 §7.3.2.2).
///
///     power_on / reset node  -> initialising -> owner.reset(node)           -> owner calls initialised(id)
///     reset communication    -> initialising -> owner.reset(communication)  -> owner calls initialised(id)
///     initialised(valid id)  -> boot-up message -> pre-operational <-> operational <-> stopped
///     initialised(unconfigured): stays in initialising and sends no boot-up, until LSS or RAND gave a node-ID and the
///                                owner calls `initialised` again (CiA 305)
///
/// The owner decides how long initialising takes. In initialising, commands on the bus are ignored.
#pragma once

#include "berth/can/dispatcher.hpp"
#include "berth/co/nmt.hpp"

namespace berth::co {

enum class NmtReset : std::uint8_t {
  node,           ///< power-on or reset node: the whole dictionary back to its power-on values
  communication,  ///< 1000h..1FFFh only
};

class NmtSlave final : private can::Handler, private rt::Job {
 public:
  /// The device. Called from `received`, from the executor or from the calls below; may call back.
  class Owner {
   public:
    /// Stop everything (`state_changed` to initialising came before, if the state was another). The owner restores the
    /// stored values and calls `initialised`, at once or later.
    virtual void reset(NmtReset what, rt::Time at) noexcept = 0;
    /// `services_in(to)` gives the services that may run. From initialising to pre-operational: the boot-up message is
    /// queued.
    virtual void state_changed(NmtState from, NmtState to, rt::Time at) noexcept = 0;

   protected:
    ~Owner() = default;
  };

  NmtSlave(can::Dispatcher& dispatcher, Owner& owner);

  /// Starts the device: `owner.reset(node)`.
  void power_on() noexcept;
  /// Forgets everything without a callback; `power_on` starts anew.
  void power_off() noexcept;
  /// Initialising is over. If `node_id` is configured, the boot-up message follows, then pre-operational. While the
  /// port cannot take the boot-up message, it is tried again every `boot_up_retry` and the state stays initialising. In
  /// other states the call does nothing.
  void initialised(NodeId node_id) noexcept;
  /// Does what a command for this node would do: for error behaviour, self-start, a master's own "start all". In
  /// initialising only the resets work.
  void apply(NmtCommand command) noexcept;
  /// Reacts to a communication error as object 1029h:01 says: 0 = pre-operational if operational, 1 = no change, 2 =
  /// stopped (from pre-operational too). Other values count as 0.
  void apply_error_behaviour(std::uint8_t value) noexcept;

  [[nodiscard]] NmtState state() const noexcept { return state_; }
  /// Unconfigured until `initialised` was called with an id.
  [[nodiscard]] NodeId node_id() const noexcept { return node_id_; }
  [[nodiscard]] Services services() const noexcept { return services_in(state_); }

  /// While held, it does not become operational, whatever the command: for a boot loader without a program.
  void hold(bool on) noexcept { held_ = on; }
  void set_boot_up_retry(rt::Duration interval) noexcept { boot_up_retry_ = interval; }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void run() noexcept override;
  void send_boot_up() noexcept;
  void enter(NmtState to) noexcept;
  void reset(NmtReset what) noexcept;

  can::Dispatcher* dispatcher_;
  Owner* owner_;
  rt::Duration boot_up_retry_ = std::chrono::milliseconds(1);
  NmtState state_ = NmtState::initialising;
  NodeId node_id_;
  bool held_ = false;
};

}  // namespace berth::co
