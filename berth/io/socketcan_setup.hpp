/// Brings a CAN interface into the state that a port needs, or names the command for it. Internal to room `io`.
#pragma once

#include <cstdint>
#include <string>
#include <tl/expected.hpp>

#include "berth/io/netlink.hpp"
#include "berth/io/netlink_socket.hpp"
#include "berth/rt/executor.hpp"

namespace berth::io {

struct Wanted {
  std::uint32_t bit_rate = 0;  ///< 0 = any, and then nothing is changed
  bool listen_only = false;
};

/// The command for a user with the necessary rights: "ip link set can0 up type can bitrate 250000".
[[nodiscard]] std::string ip_command(const Link& link, const Wanted& wanted);

/// The changes that an interface needs; empty if it is as wanted.
struct Steps {
  bool first_down = false;
  LinkChange change{};
  [[nodiscard]] bool none() const noexcept {
    return !first_down && !change.up && !change.bit_rate && !change.listen_only && !change.restart;
  }
};
/// Pure. A listen-only port sets a controller's listen-only mode only if it must be set up anyway, or with `strictly`.
[[nodiscard]] Steps steps_to(const Link& link, const Wanted& wanted, bool strictly);

/// Executes them, and restores the former state if the kernel refuses one. `patience`: how long to wait until a started
/// controller is running. Returns the resulting interface.
[[nodiscard]] tl::expected<Link, std::string> set_up(const Link& link, const Steps& steps, const Wanted& wanted,
                                                     rt::Duration patience);

/// Finds an interface by name and sets it up: returns its new state, or what the user must do.
[[nodiscard]] tl::expected<Link, std::string> find_interface(const std::string& name);

/// Restores the rate, mode and state in `before`.
void put_back(const Link& now, const Link& before);

}  // namespace berth::io
