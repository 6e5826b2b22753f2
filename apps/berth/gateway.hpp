/// `berth gateway`, and `berth up --gateway`: access to a machine's buses by CiA 309-3 (ASCII) over TCP.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "berth/serve/cia309_server.hpp"
#include "machine_run.hpp"

namespace berth::cli {

/// What the user permits clients on real buses.
struct GatewayRights {
  bool commands = false;   ///< NMT, SDO download, PDO, LSS
  bool confirmed = false;  ///< may disturb operational devices
  bool anywhere = false;   ///< clients on other computers too
};

/// The rights of `berth up --gateway`.
[[nodiscard]] GatewayRights gateway_rights(const Options& options) noexcept;
/// Where clients may connect. `option`: the option by which the user gave `where`. Refused as in `may_listen`.
[[nodiscard]] tl::expected<io::Endpoint, Failure> gateway_endpoint(const std::string& option, const std::string& where,
                                                                   GatewayRights rights);

/// A gateway to the session of a machine run in real time.
class GatewayHost {
 public:
  /// `say` gets messages for the user. The machine run must outlive it and have a loop.
  [[nodiscard]] static tl::expected<std::unique_ptr<GatewayHost>, Failure> listen(
      MachineRun& run, const io::Endpoint& where, GatewayRights rights, std::function<void(const std::string&)> say);
  /// "127.0.0.1:7000".
  [[nodiscard]] std::string where() const { return io::to_string(server_->where()); }
  [[nodiscard]] const serve::cia309::Counters& counters() const noexcept { return server_->counters(); }

 private:
  GatewayHost() = default;
  std::unique_ptr<serve::cia309::Server> server_;
};

}  // namespace berth::cli
