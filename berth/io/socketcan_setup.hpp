/// Brings a CAN interface into the state that a port needs, or says which command does it. Inside of room `io`.
#pragma once

#include <cstdint>
#include <string>
#include <tl/expected.hpp>

#include "berth/io/netlink.hpp"
#include "berth/io/netlink_socket.hpp"
#include "berth/rt/executor.hpp"

namespace berth::io {

struct Wanted {
  std::uint32_t bit_rate = 0;  ///< 0 = as it stands, and then nothing is changed
  bool listen_only = false;
};

/// The command that a person with the right types: "ip link set can0 up type can bitrate 250000".
[[nodiscard]] std::string ip_command(const Link& link, const Wanted& wanted);

/// What must be done to an interface; nothing when it is as wanted.
struct Steps {
  bool first_down = false;
  LinkChange change{};
  [[nodiscard]] bool none() const noexcept {
    return !first_down && !change.up && !change.bit_rate && !change.listen_only && !change.restart;
  }
};
/// Pure. A listen-only port wants a controller in listen-only mode only when it must be set up anyway, or `strictly`.
[[nodiscard]] Steps steps_to(const Link& link, const Wanted& wanted, bool strictly);

/// Does them, and puts back what was when the kernel refuses in the middle. `patience`: how long to wait for a
/// controller that was brought up to be running. Gives the interface as it is then.
[[nodiscard]] tl::expected<Link, std::string> set_up(const Link& link, const Steps& steps, const Wanted& wanted,
                                                     rt::Duration patience);

/// An interface by name, looked for and brought into state: what it is then, or what a person must do.
[[nodiscard]] tl::expected<Link, std::string> find_interface(const std::string& name);

/// Back to the rate, mode and state in `before`.
void put_back(const Link& now, const Link& before);

}  // namespace berth::io
