/// Options of a device.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "berth/device/lss_habits.hpp"
#include "berth/device/negotiation.hpp"
#include "berth/device/node_id_methods.hpp"
#include "berth/device/parameter_store.hpp"

namespace berth::device {

/// Where the node-ID comes from at power-on (S4.2).
enum class NodeIdSource : std::uint8_t {
  nonvolatile,  ///< from memory, `Options::node_id` while memory is blank; LSS changes it
  fixed,        ///< firmware, switches or plug: LSS configure node-ID is answered "out of range"
};

/// The value without which a write of this object is refused: "save", a password.
struct Signature {
  ObjectRef object;
  std::uint64_t value = 0;  ///< little-endian on the wire
};

/// This object is the node-ID too (1 byte or more; the dictionary must have it): a write is stored at once, or with the
/// signature's, and used after the next reset.
struct NodeIdAsObject {
  ObjectRef object;
  std::optional<Signature> signature = {};
};

/// How a device behaves as an LSS slave.
struct LssOptions {
  bool on = true;                                            ///< it is an LSS slave
  bool fastscan = true;                                      ///< answers LSS Fastscan (51h)
  lss::Feedback feedback = lss::Feedback::none;              ///< with `fastscan`
  std::uint16_t feedback_base = lss::default_feedback_base;  ///< `Feedback::base`: first of the sixteen identifiers
  LssHabit habit = LssHabit::none;                           ///< behave like a known stack's slave
  std::uint64_t habit_seed = 0;                              ///< for the random behaviour of such a slave
  lss::LackSet without{};                                    ///< never answers these services
  bool stores = true;               ///< false: LSS store (17h) is answered 01, and nothing is stored
  bool short_answers = false;       ///< leaves out the zeros at the end of an answer
  bool changes_at_waiting = false;  ///< a configured device uses a new node-ID already at `04 00`
};

struct Options {
  LssAddress address{};  ///< identity, 1018h:01..04
  NodeIdSource source = NodeIdSource::nonvolatile;
  NodeId node_id{};            ///< fixed, or the value for blank memory
  std::uint32_t bit_rate = 0;  ///< value for blank memory, bit/s; 0 or not in CiA's table: the port's own is kept
  LssOptions lss{};
  RandMode rand = RandMode::on;
  bool rand_resume = false;   ///< RAND's extension: answers for any prefix of its address (docs/rand.md)
  bool and_protocol = false;  ///< answers AND
  bool claim = false;         ///< claims a node-ID as SAE J1939-81 does when it has none
  NegotiationMode negotiation = NegotiationMode::off;
  research::NegotiatorOptions negotiator{};  ///< with `negotiation`; its address and `literal` are the device's
  bool detect_collision = true;      ///< reports another node that sends with its identifiers (EMCY 8150h; SX.7)
  rt::Duration never_seen{0};        ///< reports a node in 1016h that has had no heartbeat for so long (`Callbacks`); 0
                                     ///< = no
  rt::Duration bus_off_recovery{0};  ///< restarts its controller this long after bus-off; 0 = never
  std::optional<NodeIdAsObject> node_id_object{};
  std::string name{};                   ///< 1008h; empty: as described
  std::span<const std::uint8_t> eds{};  ///< uploaded from 1021h; must outlive the device; empty: as described (no data)
  std::vector<Preset> presets{};
  GroupOf parameter_group = default_parameter_group;  ///< which values 1010h stores, by sub-index
  bool send_tpdos_at_start = true;                    ///< types FEh and FFh: once when operational is entered
};

}  // namespace berth::device
