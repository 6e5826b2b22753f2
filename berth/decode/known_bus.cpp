#include "berth/decode/known_bus.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/co/cob_id.hpp"
#include "berth/decode/say_parts.hpp"
#include "berth/od/cia301.hpp"
#include "berth/od/notation.hpp"

namespace berth::decode {
namespace {

// The COB-ID that the object holds; invalid if its value is none.
co::CobId cob_id(const od::Values& values, ObjectRef ref) noexcept {
  const co::CobId id(values.get_or<std::uint32_t>(ref, co::CobId::invalid_bit));
  return id.well_formed() ? id : co::CobId();
}

}  // namespace

std::string object_name(const od::Description& description, ObjectRef ref) {
  const auto* const object = description.find(ref.index);
  if (object == nullptr) return {};
  std::string name(description.name(*object));
  const auto* const sub = description.find(*object, ref.sub);
  if (sub == nullptr || object->code == od::ObjectCode::var) return name;
  const auto own = description.name(*sub);
  if (!own.empty() && own != name) say(name, ".{}", own);
  return name;
}

KnownBus::KnownBus() {
  for (std::uint8_t node = 1; node <= 127; ++node) {
    const auto own = channel(node, 1);
    base_[0x600U + node] = {Route::Kind::request, node, own};
    base_[0x580U + node] = {Route::Kind::response, node, own};
  }
}

std::uint16_t KnownBus::channel(std::uint8_t node, unsigned which) {
  const auto found = std::find_if(channels.begin(), channels.end(),
                                  [&](const auto& c) { return c->node == node && c->number == which; });
  if (found != channels.end()) return static_cast<std::uint16_t>(found - channels.begin());
  channels.push_back(std::make_unique<Channel>());
  channels.back()->node = node;
  channels.back()->number = which;
  return static_cast<std::uint16_t>(channels.size() - 1);
}

Route KnownBus::route(std::uint32_t key) const noexcept {
  if (key <= can::base_mask) return base_[key];
  if (extended_.empty()) return {};
  const auto found = extended_.find(key);
  return found == extended_.end() ? Route{} : found->second;
}

void KnownBus::set_route(std::uint32_t key, Route route) {
  if (key <= can::base_mask) {
    base_[key] = route;
  } else if (route.kind == Route::Kind::none) {
    extended_.erase(key);
  } else {
    extended_[key] = route;
  }
}

void KnownBus::know(NodeId node, Profile profile) {
  disconnect(node.value());
  auto& known = nodes[node.value()];
  known = std::make_unique<KnownNode>();
  known->name = std::move(profile.name);
  known->words = std::move(profile.words);
  known->named = std::move(profile.named);
  if (!profile.description) return;
  known->values = std::make_unique<od::Values>(std::move(profile.description), node);
  for (const auto& [object, bytes] : profile.settings) (void)known->values->set_bytes(object, bytes);
  for (const auto& object : known->values->description().objects()) {
    const bool gives = od::within(object.index, od::cia301::first_server, od::cia301::last_server) ||
                       od::is_pdo_communication(object.index);
    if (gives) known->givers.push_back(object.index);
  }
  connect(node.value());
}

void KnownBus::disconnect(std::uint8_t id) {
  if (!nodes[id]) return;
  for (const auto key : nodes[id]->keys) {
    const bool own =
        key <= can::base_mask ? base_[key].node == id : extended_.contains(key) && extended_[key].node == id;
    if (own) set_route(key, {});
  }
  nodes[id]->keys.clear();
  for (auto& pdo : pdos) {
    if (pdo.node == id) pdo = KnownPdo{};
  }
}

// Enters every identifier that the node's objects give.
void KnownBus::connect(std::uint8_t id) {
  KnownNode& node = *nodes[id];
  const od::Values& values = *node.values;
  const auto own = [&](co::CobId cob, Route route) {
    if (!cob.valid() || taken(cob.key())) return;
    set_route(cob.key(), route);
    node.keys.push_back(cob.key());
  };
  const auto emcy = cob_id(values, {0x1014, 0});
  if (emcy.key() != 0x80U + id) own(emcy, {Route::Kind::emcy, id, 0});
  if (values.get<std::uint32_t>({0x1005, 0})) {
    const co::CobId sync(values.get_or<std::uint32_t>({0x1005, 0}, 0x80) & ~co::CobId::invalid_bit);
    if (sync.key() != co::sync_id) own(sync, {Route::Kind::sync, 0, 0});
  }
  for (const auto index : node.givers) {
    if (od::is_pdo_record(index)) {
      const auto record = od::PdoRecord::of(index);
      add_pdo(node, id, record.kind, record.number);
    } else {
      const auto channel = this->channel(id, index - unsigned{od::cia301::default_server} + 1);
      own(cob_id(values, {index, 1}), {Route::Kind::request, id, channel});
      own(cob_id(values, {index, 2}), {Route::Kind::response, id, channel});
    }
  }
}

Signal KnownNode::signal(const od::PdoEntry& entry, unsigned at) const {
  const auto& description = values->description();
  Signal signal;
  signal.at = static_cast<std::uint8_t>(at);
  signal.bits = entry.bits;
  signal.dummy = entry.dummy();
  const NamedObject* const variable = named_of(entry.object);
  signal.label = variable != nullptr ? variable->name : object_name(description, entry.object);
  if (signal.label.empty()) signal.label = od::write_object(entry.object);
  signal.name_size = signal.label.size();
  signal.label += " = ";
  const auto* const described = description.find(entry.object);
  if (described != nullptr) signal.type = described->type;
  if (variable != nullptr) signal.type = variable->type;
  signal.object = entry.object;
  if (words && words->knows(entry.object)) signal.words = words.get();
  return signal;
}

void KnownBus::add_pdo(KnownNode& node, std::uint8_t id, od::PdoKind kind, unsigned number) {
  const od::Values& values = *node.values;
  const bool transmit = kind == od::PdoKind::tpdo;
  const auto parameters = od::read_pdo(values, kind, number);
  const co::CobId cob = parameters.cob_id;
  if (!cob.valid() || !cob.well_formed()) return;
  const Route before = cob.key() <= can::base_mask     ? base_[cob.key()]
                       : extended_.contains(cob.key()) ? extended_[cob.key()]
                                                       : Route{};
  // The sender names the signals; a receiver names them only if no sender is known.
  if (before.kind != Route::Kind::none && (before.kind != Route::Kind::pdo || !transmit || pdos[before.index].transmit))
    return;
  KnownPdo pdo{.head = fmt::format("{} {} of node {}", transmit ? "TPDO" : "RPDO", number, id),
               .node = id,
               .transmit = transmit,
               .number = number,
               .signals = {}};
  if (!node.name.empty()) say(pdo.head, " [{}]", node.name);
  pdo.is_mpdo = parameters.is_mpdo();
  for (const auto& entry : parameters.entries) {
    if (entry.bits == 0 || pdo.bits + entry.bits > od::most_pdo_bits) break;
    pdo.signals.push_back(node.signal(entry, pdo.bits));
    pdo.bits += entry.bits;
  }
  auto free = std::find_if(pdos.begin(), pdos.end(), [](const KnownPdo& p) { return p.node == 0; });
  const auto index = static_cast<std::uint16_t>(free - pdos.begin());
  if (free == pdos.end()) {
    pdos.push_back(std::move(pdo));
  } else {
    *free = std::move(pdo);
  }
  set_route(cob.key(), {Route::Kind::pdo, id, index});
  node.keys.push_back(cob.key());
}

bool KnownBus::taken(std::uint32_t key) const {
  if (key <= can::base_mask) return base_[key].kind != Route::Kind::none;
  return extended_.contains(key);
}

// A transfer has shown the value of an object that decides what frames mean.
void KnownBus::learn(std::uint8_t id, ObjectRef object, std::span<const std::uint8_t> bytes) {
  const bool decides = object.index == 0x1000 || object.index == 0x1005 || object.index == 0x1014 ||
                       od::cia301::is_server(object.index) || od::is_pdo_record(object.index);
  if (!decides || !nodes[id] || !nodes[id]->values) return;
  od::Values& values = *nodes[id]->values;
  const auto before = values.bytes(object);
  if (std::equal(before.begin(), before.end(), bytes.begin(), bytes.end())) return;
  if (values.set_bytes(object, bytes) != od::AbortCode::none) return;
  // All nodes are connected anew: objects of other nodes decide which nodes receive what this one sends.
  for (std::uint8_t each = 1; each < nodes.size(); ++each) disconnect(each);
  for (std::uint8_t each = 1; each < nodes.size(); ++each) {
    if (nodes[each] && nodes[each]->values) connect(each);
  }
}

}  // namespace berth::decode
