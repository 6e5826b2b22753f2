/// What is known of one bus of a trace: its nodes, and which node and service an identifier belongs to. It learns from
/// the transfers of the trace. Internal to room `decode`.
#pragma once

#include <algorithm>
#include <array>
#include <bitset>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/decode/profile.hpp"
#include "berth/decode/sdo_transfer.hpp"
#include "berth/decode/words.hpp"
#include "berth/od/pdo_objects.hpp"
#include "berth/od/values.hpp"
#include "berth/trace/trace.hpp"

namespace berth::decode {

/// "Identity object.Vendor-ID"; the object alone when it is a VAR; empty when it is not described.
[[nodiscard]] std::string object_name(const od::Description& description, ObjectRef ref);

struct Signal {
  std::string label;  ///< its name and " = "
  std::size_t name_size = 0;
  od::DataType type = od::DataType::none;
  std::uint8_t at = 0;  ///< position in bits
  std::uint8_t bits = 0;
  bool dummy = false;
  ObjectRef object{};
  const ValueWords* words = nullptr;  ///< of the node; null: they have no words for this object
};

struct KnownPdo {
  std::string head;  ///< "TPDO 1 of node 5 [left sensor]"
  std::uint8_t node = 0;
  bool transmit = false;
  unsigned number = 1;
  bool is_mpdo = false;
  unsigned bits = 0;
  std::vector<Signal> signals;
};

struct Channel {
  std::uint8_t node = 0;
  unsigned number = 1;  ///< which of the server's channels
  SdoTransfer transfer;
  trace::Entry last;  ///< last frame of the transfer that is under way
};

struct KnownNode {
  std::string name;
  std::unique_ptr<od::Values> values;  ///< null: no description
  std::shared_ptr<const ValueWords> words;
  std::vector<NamedObject> named;
  [[nodiscard]] const NamedObject* named_of(ObjectRef object) const noexcept {
    const auto it = std::ranges::find(named, object, &NamedObject::object);
    return it == named.end() ? nullptr : &*it;
  }
  [[nodiscard]] Signal signal(const od::PdoEntry& entry, unsigned at) const;
  std::vector<std::uint16_t> givers;  ///< objects that give the identifiers of further SDO channels and PDOs
  std::vector<std::uint32_t> keys;    ///< identifiers whose routes belong to this node
};

struct Route {
  enum class Kind : std::uint8_t { none, pdo, request, response, emcy, sync };
  Kind kind = Kind::none;
  std::uint8_t node = 0;
  std::uint16_t index = 0;  ///< pdo: index in `KnownBus::pdos`; request, response: index in `KnownBus::channels`
};

class KnownBus {
 public:
  KnownBus();

  /// Replaces what is known of this node, which must have a node-ID.
  void know(NodeId node, Profile profile);
  /// A transfer has shown the value of an object. If it decides what frames mean, later frames follow it.
  void learn(std::uint8_t node, ObjectRef object, std::span<const std::uint8_t> bytes);
  /// `key`: `can::Frame::key`.
  [[nodiscard]] Route route(std::uint32_t key) const noexcept;

  Interpreter interpreter;
  std::array<std::unique_ptr<KnownNode>, 128> nodes;
  std::vector<KnownPdo> pdos;  ///< PDOs of disconnected nodes have node 0 and are reused
  std::vector<std::unique_ptr<Channel>> channels;
  std::bitset<128> guarded;  ///< asked by a remote frame and not answered yet

 private:
  [[nodiscard]] std::uint16_t channel(std::uint8_t node, unsigned which);
  void connect(std::uint8_t node);
  void disconnect(std::uint8_t node);
  void set_route(std::uint32_t key, Route route);
  void add_pdo(KnownNode& node, std::uint8_t id, od::PdoKind kind, unsigned number);
  [[nodiscard]] bool taken(std::uint32_t key) const;

  std::vector<Route> base_ = std::vector<Route>(can::base_mask + 1);
  std::unordered_map<std::uint32_t, Route> extended_;
};

}  // namespace berth::decode
