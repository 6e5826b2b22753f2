#include "listening.hpp"

#include <fmt/format.h>

#include "options.hpp"

namespace berth::cli {

tl::expected<io::Endpoint, Failure> may_listen(const Listening& wanted) {
  const std::string name = wanted.option + " " + wanted.where;
  const auto endpoint = io::parse_endpoint(wanted.where, wanted.default_port);
  if (!endpoint) {
    return tl::unexpected(
        failure(Exit::usage, fmt::format("{}: write HOST:PORT, such as 127.0.0.1:{}", name, wanted.default_port)));
  }
  if (wanted.anywhere) return *endpoint;
  const auto own = io::is_loopback(*endpoint);
  if (!own) return tl::unexpected(failure(Exit::failed, fmt::format("{}: {}", name, own.error())));
  if (*own) return *endpoint;
  return tl::unexpected(failure(
      Exit::usage, fmt::format("{}: other computers may reach this address, and there is no password: anybody who "
                               "reaches the port can {}. Use 127.0.0.1 (and an ssh tunnel from elsewhere), or add "
                               "--listen-anywhere if everybody on that network may do so",
                               name, wanted.may)));
}

}  // namespace berth::cli
