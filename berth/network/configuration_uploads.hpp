/// 5F0Ah, upload configuration: any SDO client writes "upld" to the sub-index of a slave, or to 80h for all. The
/// manager then stores the slave's current configuration in its 1F20h, and uses it for the slave and for a device that
/// replaces it. CiA 302-3 has no object for this; the index is Berth's.
///
/// The slave's EDS describes it: 1F23h of the manager (1F24h: its format), else 1021h of the slave (1022h). The
/// configuration is stored as 1F21h says, and compressed if it would not fit otherwise. 1F26h and 1F27h are set to its
/// date (1020h; 0 if it has none), and 1F22h of the slave is emptied, because a concise DCF has priority over 1F20h.
///
/// Reading 5F0Ah gives the state of the last upload: 0 none, 1 under way, 2 done, 3 failed.
#pragma once

#include <array>
#include <functional>

#include "berth/network/network_boot.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/od/values.hpp"
#include "berth/rt/scope.hpp"

namespace berth::network {

class ConfigurationUploads {
 public:
  static constexpr std::uint16_t object = 0x5F0A;
  static constexpr std::uint32_t signature = 0x646C'7075;  ///< "upld"
  enum class State : std::uint8_t { none, under_way, done, failed };

  /// Both must stay.
  ConfigurationUploads(rt::Executor& executor, NetworkBoot& network, od::Values& values) noexcept
      : network_(&network), values_(&values), scope_(executor, most_at_once) {}

  /// Called when an upload has ended. Errors: those of SDO and `upload_configuration`; those of `read_own_eds`;
  /// Errc::invalid an EDS that cannot be read; Errc::mismatch 1F20h has no room for the DCF. May be empty.
  void observe(std::function<void(NodeId, const Result<void>&)> callback) { callback_ = std::move(callback); }

  /// Returns the answer to the SDO client; the upload begins after it. 0800 0020: not the signature. 0800 0022: this
  /// device is not the master, or the slave boots or is being read. 0609 0030: not assigned. For all: reads those that
  /// it can; 0800 0022 if there is none.
  od::AbortCode request(std::uint8_t sub, std::uint32_t value);
  [[nodiscard]] State state(NodeId node) const noexcept { return states_[node.value()]; }
  /// Ends all uploads; unfinished ones have failed.
  void end() noexcept;

 private:
  static constexpr std::size_t most_at_once = 8;
  [[nodiscard]] bool begin(const NetworkSlave& slave);
  rt::Task<void> upload(NodeId node, co::SdoAccess& device);
  rt::Task<Result<void>> upload_into(NodeId node, co::SdoAccess& device);
  rt::Task<Result<std::string>> eds_of(NodeId node, co::SdoAccess& device);
  Result<void> store(NodeId node, const std::string& dcf);

  NetworkBoot* network_;
  od::Values* values_;
  std::function<void(NodeId, const Result<void>&)> callback_;
  std::array<State, 128> states_{};
  rt::Scope scope_;
};

}  // namespace berth::network
