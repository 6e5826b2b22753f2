/// The reaction of the master of a network list to a slave that fails or restarts (CiA 302-2, error control);
/// `NetworkBoot` describes it. `berth up` differs: it first checks which device is there (operate/supervision.hpp).
#pragma once

#include "berth/network/network_startup.hpp"
#include "berth/network/slave_boots.hpp"

namespace berth::network {

class ErrorEvents final : public ErrorControl {
 public:
  /// The network of these errors.
  class Network {
   public:
    /// Not started yet, or the slaves are about to be replaced.
    [[nodiscard]] virtual bool is_off() const noexcept = 0;
    /// All nodes are about to be stopped, or reset: end all boot-ups.
    virtual void end_for_all(bool stopped) noexcept = 0;
    virtual void command(co::NmtCommand command, co::NmtTarget target, bool with_master) = 0;
    virtual void tell(const NetworkEvent& event) const = 0;

   protected:
    ~Network() = default;
  };

  ErrorEvents(Network& network, const NetworkStartup& startup, SlaveBoots& boots) noexcept
      : network_(&network), startup_(&startup), boots_(&boots) {}
  void boot_up(NodeId node, bool expected) noexcept override;
  void lost(NodeId node) noexcept override;
  void back(NodeId node) noexcept override;
  void told(NodeId node, NmtState state) noexcept override;
  void overheard(const co::NmtRequest& request) noexcept override;
  /// The slave was asked and is not there. Without error control nothing else reports this: its last reported state
  /// (1F82h) becomes invalid.
  void silent(NodeId node) noexcept;

 private:
  void act(Slave& slave, bool rebooted) noexcept;

  Network* network_;
  const NetworkStartup* startup_;
  SlaveBoots* boots_;
};

}  // namespace berth::network
