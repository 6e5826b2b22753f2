/// Where a TCP server of Berth listens: on this computer's own address, unless a person lets others reach it.
#pragma once

#include <string>
#include <tl/expected.hpp>

#include "berth/io/stream.hpp"
#include "output.hpp"

namespace berth::cli {

/// What a person asked for.
struct Listening {
  std::string option;  ///< "--listen"
  std::string where;   ///< "HOST:PORT"
  std::uint16_t default_port = 0;
  bool anywhere = false;  ///< `--listen-anywhere`
  std::string may;        ///< what whoever connects can do: "send every frame on the buses"
};

/// Refused: what is no HOST:PORT, no host, and, without `anywhere`, an address that is not loopback (127.0.0.0/8, ::1),
/// because Berth's servers have no password.
[[nodiscard]] tl::expected<io::Endpoint, Failure> may_listen(const Listening& wanted);

}  // namespace berth::cli
