/// What the object linker works on: buses, their devices with their descriptions, and the user's links. Plain data.
///
/// A *link* leads from one object of one device to objects of others (paper 5 §3.2, "Visual Object Linker", by
/// Etschberger and Schlegel). An end is written as in the machine file: index and sub-index, the name of an object of
/// the device's description, or, on a device with [DynamicChannels], the name of a network variable, which the linker
/// makes.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/analysis/response.hpp"
#include "berth/base/ids.hpp"
#include "berth/eds/file.hpp"

namespace berth::linker {

/// A device in its slot.
struct Node {
  std::string name;     ///< the slot's
  std::size_t bus = 0;  ///< index in `LinkNetwork::buses`
  NodeId id;            ///< configured
  /// Its description, or its existing configuration (DCF, XDC): the configuration's values stay, and PDOs that it sets
  /// are left unchanged, unless `linked_before`. Null: unknown; no link can lead to the node, and its predefined
  /// CAN-IDs are not used.
  std::shared_ptr<const eds::File> file = {};
  /// `file` is a DCF written by the linker (`written_by_linker`): its PDOs and network variables are made anew.
  bool linked_before = false;
  /// Least time between two frames of a PDO that is sent at a change and has no inhibit time; 0: unknown.
  rt::Duration interval{0};
};

inline constexpr std::uint32_t default_sync_key = 0x80;

struct Bus {
  std::string name;
  NodeId master;                             ///< its predefined CAN-IDs are not used; may be unconfigured
  std::vector<std::uint32_t> channels = {};  ///< CAN-IDs of planned SDO channels: no PDO gets one
  /// Everything on the bus except the PDOs of nodes with a `file`; and the bit rate. Senders: nodes by name.
  analysis::Line others = {};
  /// Period of SYNC; 0: nothing produces it.
  rt::Duration sync{0};
  std::uint32_t sync_key = default_sync_key;  ///< `can::Frame::key` of SYNC
};

/// A gateway between two buses: one device with a node on each (paper 3; docs/multilevel.md). A link that crosses it
/// becomes a route in it.
struct Gateway {
  std::size_t above = 0;                 ///< its node on the bus above: index in `LinkNetwork::nodes`
  std::size_t bus = 0;                   ///< the bus beneath: index in `LinkNetwork::buses`
  std::optional<std::size_t> beneath{};  ///< its own node there; empty: unknown
  std::uint8_t port = 1;                 ///< which of its buses beneath, 1 to 8
  /// Longest time from the end of the frame that brings a value until the frame that forwards it is due.
  rt::Duration delay = std::chrono::milliseconds(1);
};

/// One object of one node, as written.
struct End {
  std::size_t node = 0;  ///< index in `LinkNetwork::nodes`
  std::string object;
  friend bool operator==(const End&, const End&) = default;
};

/// Position of a link in its file, from 1; 0: in none.
struct Place {
  int line = 0;
  int column = 0;
};

/// Transmission types (CiA 301 §7.5.2.35): 0 at the SYNC after a change, 1 to 240 every so many SYNCs, 254 and 255 at
/// a change. Links do not use 252 and 253 (on remote frames).
using TransmissionType = std::uint8_t;
inline constexpr TransmissionType at_change = 255;

struct Link {
  End from;
  std::vector<End> to;                     ///< at least one, none twice
  std::optional<rt::Duration> deadline{};  ///< from the change to its arrival, greater than 0
  TransmissionType transmission = at_change;
  std::optional<od::DataType> type{};  ///< of network variables at its ends; empty: the other end's
  /// Inhibit time of its PDO; for a device without inhibit times, the interval that it is said to keep. Empty: the
  /// linker chooses.
  std::optional<rt::Duration> inhibit{};
  Place place{};
};

struct LinkNetwork {
  std::string name;  ///< the machine's
  std::string file;  ///< as findings name it; may be empty
  std::vector<Bus> buses;
  std::vector<Node> nodes;
  std::vector<Gateway> gateways;  ///< one at most for each bus beneath
  std::vector<Link> links;
};

/// True for a DCF with [FileInfo] ModifiedBy as the linker writes it.
[[nodiscard]] bool written_by_linker(const eds::File& file) noexcept;
inline constexpr const char* linker_mark = "berth link";

}  // namespace berth::linker
