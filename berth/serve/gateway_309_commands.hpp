/// The commands of CiA 309-3 on one net, without LSS's: SDO, PDO, NMT, supervision, bit rate. Inside of room `serve`.
#pragma once

#include <cstdint>
#include <string>

#include "berth/rt/task.hpp"
#include "berth/serve/gateway_309_permits.hpp"

namespace berth::serve {

class NetCommands309 {
 public:
  static constexpr std::size_t longest_value = std::size_t{1} << 20U;  ///< bytes of an object

  /// `permits` must stay.
  explicit NetCommands309(const Permits309& permits) noexcept : permits_(&permits) {}
  /// A command that needs no waiting. It and `perform` take requests that are `allowed`.
  Outcome309 settle(const Request309& request, Net309& net);
  /// SDO, NMT, `read pdo`.
  rt::Task<Outcome309> perform(const Request309& request, Net309& net);

 private:
  Outcome309 init(Net309& net, std::uint32_t index);
  Outcome309 set_pdo(const Request309& request, Net309& net);
  Outcome309 write_pdo(const Request309& request, Net309& net);
  rt::Task<Outcome309> read_pdo(std::uint16_t number, Net309& net);
  rt::Task<Outcome309> read(const Request309& request, Net309& net);
  rt::Task<Outcome309> write(const Request309& request, Net309& net);
  rt::Task<Outcome309> command(const Request309& request, Net309& net);

  const Permits309* permits_;
};

}  // namespace berth::serve
