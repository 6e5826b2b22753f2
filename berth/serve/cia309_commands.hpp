/// The commands of CiA 309-3 on one net, without LSS's: SDO, PDO, NMT, supervision, bit rate. Inside of room `serve`.
#pragma once

#include <cstdint>
#include <string>

#include "berth/rt/task.hpp"
#include "berth/serve/cia309_permits.hpp"

namespace berth::serve::cia309 {

class NetCommands {
 public:
  static constexpr std::size_t longest_value = std::size_t{1} << 20U;  ///< bytes of an object

  /// `permits` must stay.
  explicit NetCommands(const Permits& permits) noexcept : permits_(&permits) {}
  /// A command that needs no waiting. It and `perform` take requests that are `allowed`.
  Outcome settle(const Request& request, Net& net);
  /// SDO, NMT, `read pdo`.
  rt::Task<Outcome> perform(const Request& request, Net& net);

 private:
  Outcome init(Net& net, std::uint32_t index);
  Outcome set_pdo(const Request& request, Net& net);
  Outcome write_pdo(const Request& request, Net& net);
  rt::Task<Outcome> read_pdo(std::uint16_t number, Net& net);
  rt::Task<Outcome> read(const Request& request, Net& net);
  rt::Task<Outcome> write(const Request& request, Net& net);
  rt::Task<Outcome> command(const Request& request, Net& net);

  const Permits* permits_;
};

}  // namespace berth::serve::cia309
