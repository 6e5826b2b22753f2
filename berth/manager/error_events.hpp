/// What a network's manager does when a slave fails or restarts (CiA 302-2, error control): a part of `NetworkBoot`,
/// whose manual says it.
#pragma once

#include "berth/manager/boot_network.hpp"
#include "berth/manager/slave_boots.hpp"

namespace berth::manager {

class NetworkBoot;

class ErrorEvents final : public ErrorControl {
 public:
  explicit ErrorEvents(NetworkBoot& network) noexcept : network_(&network) {}
  void boot_up(NodeId node, bool expected) noexcept override;
  void lost(NodeId node) noexcept override;
  void back(NodeId node) noexcept override;
  void told(NodeId node, NmtState state) noexcept override;
  void overheard(const co::NmtRequest& request) noexcept override;

 private:
  [[nodiscard]] bool deaf() const noexcept;
  void act(SlaveBoots::Slave& slave, bool rebooted) noexcept;

  NetworkBoot* network_;
};

}  // namespace berth::manager
