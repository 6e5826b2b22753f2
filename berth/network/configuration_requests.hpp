/// 1F25h, request configuration (CiA 302-3): any SDO client writes "conf" to the sub-index of a slave, or to 80h for
/// all. The configuration manager then downloads the slave's configuration at once, whatever its date. This is the
/// boot-up's step 8 (`BootSource::configure`), outside a boot-up; the slave's NMT state stays the same.
#pragma once

#include <functional>

#include "berth/network/network_boot.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/rt/scope.hpp"

namespace berth::network {

class ConfigurationRequests {
 public:
  static constexpr std::uint32_t signature = 0x666E'6F63;  ///< "conf"

  /// `network` must stay.
  ConfigurationRequests(rt::Executor& executor, NetworkBoot& network) noexcept
      : network_(&network), scope_(executor, most_at_once) {}

  /// Called when the configuration of a slave has ended. May be empty.
  void observe(std::function<void(NodeId, const Result<void>&)> callback) { callback_ = std::move(callback); }

  /// Returns the answer to the SDO client; the configuration begins after it. 0800 0020: not the signature. 0800 0022:
  /// this device is not the master, or the slave boots or is being configured. 0609 0030: not assigned. For all:
  /// configures those that it can; 0800 0022 if there is none.
  od::AbortCode request(std::uint8_t sub, std::uint32_t value);
  /// Ends all configurations.
  void end() noexcept;

 private:
  static constexpr std::size_t most_at_once = 8;
  [[nodiscard]] bool begin(const NetworkSlave& slave);
  rt::Task<void> configure(NodeId node, BootTarget& target, BootSource& source, manager::SlaveRules rules);

  NetworkBoot* network_;
  std::function<void(NodeId, const Result<void>&)> callback_;
  std::array<bool, 128> busy_{};
  rt::Scope scope_;
};

}  // namespace berth::network
