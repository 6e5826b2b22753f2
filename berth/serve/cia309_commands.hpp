/// The commands of CiA 309-3 on one net, except LSS: requests, and commands without a request in berth/command: PDO,
/// supervision, bit rate, settings of the conversation. Internal to room `serve`.
#pragma once

#include <cstdint>
#include <string>

#include "berth/rt/task.hpp"
#include "berth/serve/cia309_permits.hpp"
#include "berth/serve/cia309_requests.hpp"

namespace berth::serve::cia309 {

class NetCommands {
 public:
  /// `permits` must outlive this.
  explicit NetCommands(const Permits& permits) noexcept : permits_(&permits), requests_(permits) {}
  /// A command that does not wait. `settle` and `perform` take `allowed` requests.
  Outcome settle(const Request& request, Net& net);
  /// SDO, NMT, `read pdo`.
  rt::Task<Outcome> perform(const Request& request, Net& net);

 private:
  Outcome init(Net& net, std::uint32_t index);
  Outcome set_pdo(const Request& request, Net& net);
  Outcome write_pdo(const Request& request, Net& net);
  rt::Task<Outcome> read_pdo(std::uint16_t number, Net& net);

  const Permits* permits_;
  Requests requests_;
};

}  // namespace berth::serve::cia309
