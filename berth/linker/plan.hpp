/// The object linker: links in, PDOs out (paper 5 §3.1, fig. 5, by Etschberger and Schlegel). Pure and without a
/// clock; the same network gives the same plan whatever the order of its links.
///
///     const auto made = linker::make_plan(network, earlier);
///     for (const auto& finding : made.findings) ...         // which link is impossible, why, and what would help
///     if (made.good()) for (const auto& pdo : made.plan.pdos) ...
///
/// What it does, in this order (docs/linking.md):
/// 1. ends become objects; network variables get index and sub-index in a segment of [DynamicChannels];
/// 2. what goes to another bus becomes a signal on each bus of its way and a route in each gateway;
/// 3. objects of one producer with equal consumers, transmission and deadlines of one size share PDOs;
/// 4. where a device has too few PDOs for that, PDOs are joined, and consumers skip by dummies what they do not want;
///    where that is not enough, an SAM-MPDO carries what is left over (CiA 301 §7.2.2.5);
/// 5. PDOs get numbers and CAN-IDs: 180h, 280h, 380h, 480h + node-ID for TPDO 1 to 4 as in the predefined connection
///    set;
/// 6. inhibit and event times come from the deadlines, and `analysis` says whether these are kept.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/co/pdo_mapping.hpp"
#include "berth/linker/network.hpp"

namespace berth::linker {

/// A network variable: an object that the linker makes on a programmable device.
struct Variable {
  std::size_t node = 0;
  std::string name;
  od::DataType type = od::DataType::none;
  /// Direction as the network sees it (paper 5 §2.1): an input variable is an output of the device's program, and goes
  /// into a TPDO.
  bool input = false;
  ObjectRef object{};
  std::uint32_t offset = 0;  ///< byte in the process image, from the image's base
  friend bool operator==(const Variable&, const Variable&) = default;
};

/// One object in a PDO.
struct Carried {
  ObjectRef object{};  ///< of the producer
  std::uint8_t bits = 0;
  std::uint8_t at = 0;  ///< its first bit in the PDO; of an MPDO 32
  friend bool operator==(const Carried&, const Carried&) = default;
};

/// Where a consumer puts an object that it receives.
struct Received {
  std::size_t carried = 0;  ///< index in `Pdo::carried`
  ObjectRef object{};       ///< of the consumer
  friend bool operator==(const Received&, const Received&) = default;
};

struct Receiver {
  std::size_t node = 0;
  std::uint16_t rpdo = 0;  ///< 1 to 512
  TransmissionType transmission = at_change;
  std::uint16_t event_ms = 0;  ///< a missing RPDO is an error after this time (EMCY 8250h); 0: not monitored
  std::vector<co::PdoEntry> mapping = {};  ///< with dummies; empty for an MPDO
  std::vector<Received> received = {};
  friend bool operator==(const Receiver&, const Receiver&) = default;
};

struct Pdo {
  std::size_t bus = 0;
  std::size_t producer = 0;
  std::uint16_t tpdo = 0;  ///< 1 to 512
  std::uint16_t can_id = 0;
  bool mpdo = false;  ///< SAM-MPDO: `carried` is the scanner list
  TransmissionType transmission = at_change;
  std::uint16_t inhibit = 0;   ///< in 100 us; 0: none
  std::uint16_t event_ms = 0;  ///< 0: none
  std::vector<Carried> carried = {};
  std::vector<Receiver> receivers = {};    ///< ascending by node
  std::optional<rt::Duration> deadline{};  ///< the shortest of the links that it carries
  std::optional<rt::Duration> worst{};     ///< from the change to the end of the frame; empty: no bound
  std::vector<std::size_t> links = {};     ///< that it carries, ascending
  [[nodiscard]] unsigned bytes() const noexcept;
  friend bool operator==(const Pdo&, const Pdo&) = default;
};

/// The load of a bus.
struct BusLoad {
  double load = 0;             ///< maximum share of the bus used by everything on it
  double pdos = 0;             ///< of that, used by the links' PDOs
  double one_object_each = 0;  ///< what these would use if each object had its own PDO
  std::size_t objects = 0;     ///< that links carry
  friend bool operator==(const BusLoad&, const BusLoad&) = default;
};

/// A signal that a gateway forwards: one row of its routing objects (multilevel/routing_objects.hpp).
struct Route {
  std::size_t gateway = 0;  ///< index in `LinkNetwork::gateways`
  std::size_t node = 0;     ///< its node above, which has the objects
  std::uint8_t row = 0;     ///< sub-index
  std::uint8_t from = 0;    ///< side: 0 the bus above, else the port
  std::uint8_t to = 0;
  ObjectRef source{};
  ObjectRef target{};
  std::size_t producer = 0;        ///< the source node, and
  ObjectRef object{};              ///< its object there
  rt::Duration budget{};           ///< from the frame that brings it to the end of the frame that forwards it; 0: none
  std::uint16_t freshness_ms = 0;  ///< not forwarded after this time without reception; 0: not monitored
  std::vector<std::size_t> links = {};  ///< ascending
  friend bool operator==(const Route&, const Route&) = default;
};

/// One end of a link that crosses gateways.
struct CrossingLink {
  std::size_t from = 0;
  ObjectRef source{};
  std::size_t to = 0;
  ObjectRef target{};
  std::vector<std::size_t> gateways = {};  ///< in the order of the way
  std::vector<std::size_t> pdos = {};      ///< index in `Plan::pdos` for each bus, one more than gateways
  std::optional<rt::Duration> worst{};     ///< from the change to its arrival: on all buses, plus the gateways' delays
  std::optional<rt::Duration> deadline{};
  friend bool operator==(const CrossingLink&, const CrossingLink&) = default;
};

struct Plan {
  std::vector<Variable> variables;  ///< ascending by node, direction and object
  std::vector<Pdo> pdos;            ///< ascending by bus, producer and TPDO
  std::vector<bool> linked;         ///< by node: a link begins or ends there, or goes through it
  std::vector<Route> routes = {};   ///< ascending by node and row
  std::vector<CrossingLink> crossings = {};
  std::vector<BusLoad> buses;  ///< by bus
  friend bool operator==(const Plan&, const Plan&) = default;
};

/// The earlier plan's assignment of objects to PDOs, by the slots' names, so that they keep their places. Read from the
/// file that `write` (plan_file.hpp) made; entries that no longer fit the network are ignored.
struct EarlierPdo {
  std::string producer;
  std::uint16_t tpdo = 0;
  std::uint16_t can_id = 0;
  bool mpdo = false;
  TransmissionType transmission = at_change;
  std::vector<ObjectRef> objects = {};
  std::vector<std::pair<std::string, std::uint16_t>> receivers = {};  ///< slot and RPDO
  friend bool operator==(const EarlierPdo&, const EarlierPdo&) = default;
};
struct EarlierVariable {
  std::string node;
  std::string name;
  od::DataType type = od::DataType::none;
  bool input = false;
  ObjectRef object{};
  friend bool operator==(const EarlierVariable&, const EarlierVariable&) = default;
};
struct EarlierRoute {
  std::string gateway;  ///< its slot above
  std::uint8_t row = 0;
  std::uint8_t from = 0;
  std::uint8_t to = 0;
  ObjectRef source{};
  ObjectRef target{};
  std::string producer;
  ObjectRef object{};
  friend bool operator==(const EarlierRoute&, const EarlierRoute&) = default;
};
struct Earlier {
  std::vector<EarlierVariable> variables;
  std::vector<EarlierPdo> pdos;
  std::vector<EarlierRoute> routes = {};
  friend bool operator==(const Earlier&, const Earlier&) = default;
};
[[nodiscard]] Earlier earlier_of(const LinkNetwork& network, const Plan& plan);

struct Planned {
  Plan plan;          ///< of the possible links; files are made only from a plan without errors
  Findings findings;  ///< errors: impossible links. Ascending by line
  [[nodiscard]] bool good() const noexcept { return !has_errors(findings); }
};

/// Links with unchanged objects, transmission and consumers keep PDO, RPDOs and CAN-ID of `earlier`.
[[nodiscard]] Planned make_plan(const LinkNetwork& network, const Earlier& earlier = {});

/// "link[3]: conveyor/speed".
[[nodiscard]] std::string name_of(const LinkNetwork& network, std::size_t link);

}  // namespace berth::linker
