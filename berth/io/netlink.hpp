/// Data and requests about network interfaces: messages of rtnetlink(7) as bytes, without the socket
/// (netlink_socket.hpp). Host byte order, as in the kernel; linux/can/netlink.h names the fields.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace berth::io {

/// The kernel's `enum can_state`.
enum class CanState : std::uint8_t { active, warning, passive, bus_off, stopped, sleeping };
[[nodiscard]] std::string_view to_string(CanState state) noexcept;

/// One network interface, as RTM_NEWLINK describes it.
struct Link {
  int index = 0;
  std::string name;
  std::string kind;       ///< "can": a controller; "vcan", "vxcan"; empty if the kernel does not report it
  bool can = false;       ///< a CAN interface at all (ARPHRD_CAN)
  bool up = false;        ///< IFF_UP: it was brought up
  bool running = false;   ///< IFF_RUNNING: ... and it sends and receives
  bool echo = false;      ///< IFF_ECHO: own frames come back at their end on the wire, else when the kernel sends them
  std::uint32_t mtu = 0;  ///< 16: classic frames, 72: FD frames too
  std::uint32_t queue = 0;  ///< frames that the kernel's transmit queue holds (txqueuelen)
  // Of a controller (`kind` "can"):
  std::uint32_t bit_rate = 0;  ///< bit/s; 0 = none set yet
  std::uint32_t data_bit_rate = 0;
  std::optional<CanState> state{};
  bool listen_only = false;
  bool reports_errors = false;   ///< berr-reporting: an error frame for every error on the bus
  std::uint32_t restart_ms = 0;  ///< the kernel restarts it this long after bus-off; 0 = never
  bool counts = false;           ///< `tec` and `rec` are known
  std::uint16_t tec = 0;
  std::uint16_t rec = 0;

  [[nodiscard]] bool controller() const noexcept { return kind == "can"; }
  friend bool operator==(const Link&, const Link&) = default;
};

/// One message of the kernel.
struct LinkNotice {
  enum class Kind : std::uint8_t {
    link,   ///< the state of `link`
    gone,   ///< `link` (index and name) has been removed
    reply,  ///< the end of a request: `error` 0 = done, else an errno, with the kernel's `text` if it has any
    other,  ///< none of these
  };
  Kind kind = Kind::other;
  std::uint32_t sequence = 0;  ///< of the answered request; 0 = unsolicited
  int error = 0;
  std::string text{};
  Link link{};
};

/// The messages of one packet. Reading ends at a truncated or inconsistent message; the ones before it count.
[[nodiscard]] std::vector<LinkNotice> decode_links(std::span<const std::uint8_t> packet);

/// RTM_GETLINK for one interface by name: answered by a `link`, or a `reply` with ENODEV. Names of 16 characters or
/// more are invalid and give no bytes.
[[nodiscard]] std::vector<std::uint8_t> ask_link(std::uint32_t sequence, std::string_view name);

/// A change of an interface; for another bit rate or mode the kernel requires a controller to be down.
struct LinkChange {
  std::optional<bool> up{};
  std::optional<std::uint32_t> bit_rate{};  ///< bit/s; the kernel chooses the sample point (CiA 301: 87.5 %)
  std::optional<bool> listen_only{};
  bool restart = false;  ///< leave bus-off, if the kernel does not restart it by itself
};
/// RTM_NEWLINK for the interface of this index; requests a `reply`. Settings take effect before `up` does.
[[nodiscard]] std::vector<std::uint8_t> change_link(std::uint32_t sequence, int index, const LinkChange& change);

/// Room for a whole packet from the kernel.
inline constexpr std::size_t longest_packet = 32768;

}  // namespace berth::io
