/// A finding of the doctor: its kind, node, evidence, certainty and advice (S4.1, S4.21, SX.7).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/places/slot.hpp"
#include "berth/rt/executor.hpp"

namespace berth::doctor {

enum class Kind : std::uint8_t {
  silent_bus,            ///< not one frame from any node
  duplicate_node_id,     ///< two devices hold one node-ID
  identifier_collision,  ///< a node sends with an identifier that belongs to another
  blank_node,            ///< a device without a node-ID
  wrong_bit_rate,        ///< frames are destroyed as by a node at another bit rate
  missing_heartbeat,     ///< a slot's node is silent, or without heartbeat
  error_passive,         ///< a node, or this port, is error-passive or was bus-off
  overload,              ///< more is sent than the bus, or a node, can handle
  short_lss_answer,      ///< an LSS answer has fewer than 8 bytes
  disturbance,           ///< frames are destroyed, without an explanation above
};
inline constexpr std::size_t kinds = 10;
/// "duplicate-node-id", "identifier-collision", ...: as in `--json`.
[[nodiscard]] const char* name(Kind kind) noexcept;

/// `certain`: reported by the device concerned, proven by questions, or without alternative. `likely`: anything else
/// would need a coincidence. `possible`: one of several explanations.
enum class Certainty : std::uint8_t { possible, likely, certain };
[[nodiscard]] const char* name(Certainty certainty) noexcept;

struct Diagnosis {
  Kind kind = Kind::disturbance;
  Certainty certainty = Certainty::possible;
  NodeId node{};                          ///< unconfigured: not known, or none in particular
  std::string slot{};                     ///< of the machine file, if the node has one
  std::optional<std::uint32_t> cob_id{};  ///< identifier_collision: the identifier (`can::Frame::key`)
  std::vector<LssAddress> devices{};      ///< the devices, as far as answers identified them
  std::string what{};                     ///< one sentence
  std::vector<std::string> evidence{};    ///< what was heard, how often, when
  std::string advice{};                   ///< what to do
  std::uint64_t count = 0;                ///< how often it was heard
  rt::Time first{};                       ///< when first and last, if it was heard at all
  rt::Time last{};
};

/// The expected bus. Without a machine file only `bit_rate` is set, and only contradictions are found.
struct Expected {
  std::vector<places::SlotSpec> slots{};
  NodeId master{};                    ///< the node with the master's heartbeat
  rt::Duration heartbeat_period{0};   ///< 1017h of slots' devices and master; 0 = not known
  rt::Duration heartbeat_timeout{0};  ///< shortest relevant silence
  std::uint32_t bit_rate = 125'000;   ///< bit/s, for the load
  /// TPDOs have the identifiers of the predefined connection set (CiA 301 §7.3.5). False if links or configuration
  /// files move them: then an identifier does not show its sender.
  bool predefined_pdos = true;

  [[nodiscard]] const places::SlotSpec* slot(NodeId node) const noexcept;
  /// A slot's node, or the master's.
  [[nodiscard]] bool known(NodeId node) const noexcept { return node == master || slot(node) != nullptr; }
};

}  // namespace berth::doctor
