/// Where a TCP server of Berth listens: at this computer's loopback address, unless the user lets other computers in.
#pragma once

#include <string>
#include <tl/expected.hpp>

#include "berth/io/stream.hpp"
#include "output.hpp"

namespace berth::cli {

/// What the user asked for.
struct Listening {
  std::string option;  ///< "--listen"
  std::string where;   ///< "HOST:PORT"
  std::uint16_t default_port = 0;
  bool anywhere = false;  ///< `--listen-anywhere`
  std::string may;        ///< what a client can do: "send every frame on the buses"
};

/// Refused: text that is not HOST:PORT; an unknown host; and, without `anywhere`, an address that is not loopback
/// (127.0.0.0/8, ::1), because Berth's servers have no password.
[[nodiscard]] tl::expected<io::Endpoint, Failure> may_listen(const Listening& wanted);

}  // namespace berth::cli
