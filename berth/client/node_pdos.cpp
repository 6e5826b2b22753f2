#include "berth/client/node_pdos.hpp"

#include "berth/client/remote_node.hpp"

namespace berth::client {

Outcome<void> NodePdos::readable(unsigned number) const {
  if (node_.network_ == nullptr) return tl::unexpected(node_.failure(Errc::cancelled, "the network is gone"));
  if (number < 1 || number > od::most_pdos) {
    return tl::unexpected(node_.failure(Errc::invalid, "a PDO has a number from 1 to 512"));
  }
  return {};
}

rt::Task<Outcome<od::PdoParameters>> NodePdos::ask(od::PdoKind kind, unsigned number) {
  // An access that succeeds shows that the node's object is still there (`Access::abandon`).
  if (const auto can = readable(number); !can) co_return tl::unexpected(can.error());
  od::PdoReader reader(kind, number, od::PdoReader::Scope::layout);
  while (const auto ref = reader.next()) {
    if (ref->sub == 0) {
      const auto count = co_await raw<std::uint8_t>(*ref);
      if (!count) co_return tl::unexpected(count.error());
      reader.give(*count);
    } else {
      const auto value = co_await raw<std::uint32_t>(*ref);
      if (!value) co_return tl::unexpected(value.error());
      reader.give(*value);
    }
  }
  co_return reader.parameters();
}

Outcome<std::uint32_t> NodePdos::described_value(ObjectRef ref) const {
  const auto* sub = node_.description().find(ref);
  if (sub == nullptr) return tl::unexpected(node_.failure(Errc::not_found, "the description has no such object", ref));
  if (!sub->has_default) return tl::unexpected(node_.failure(Errc::not_found, "the description gives no value", ref));
  return static_cast<std::uint32_t>(node_.description().default_of(*sub).resolve(sub->type, node_.id_.value()));
}

Outcome<od::PdoParameters> NodePdos::described(od::PdoKind kind, unsigned number) const {
  if (const auto can = readable(number); !can) return tl::unexpected(can.error());
  od::PdoReader reader(kind, number, od::PdoReader::Scope::layout);
  while (const auto ref = reader.next()) {
    const auto value = described_value(*ref);
    if (!value) return tl::unexpected(value.error());
    reader.give(*value);
  }
  return reader.parameters();
}

Outcome<std::shared_ptr<const PdoLayout>> NodePdos::layout(od::PdoKind kind, unsigned number,
                                                           const od::PdoParameters& pdo) const {
  const ObjectRef at{od::communication_index(kind, number), od::pdo_sub::cob_id};
  const ObjectRef mapping{od::mapping_index(kind, number), 0};
  if (pdo.count > od::most_pdo_entries) {
    return tl::unexpected(node_.failure(Errc::unsupported, "it is an MPDO", mapping));
  }
  if (!pdo.cob_id.valid()) {
    return tl::unexpected(node_.failure(Errc::invalid, "the PDO is not valid: bit 31 of its COB-ID is set", at));
  }
  if (!pdo.cob_id.allowed()) {
    return tl::unexpected(node_.failure(Errc::mismatch, "the COB-ID is one that no PDO may have", at));
  }
  const auto made = std::make_shared<PdoLayout>();
  made->names = node_.names_;
  made->node = node_.id_;
  for (const auto& entry : pdo.entries) {
    const bool dummy = entry.dummy() && entry.object.sub == 0;
    if (!dummy && entry.bits != 0) {
      const auto* sub = node_.description().find(entry.object);
      const auto type = sub == nullptr ? od::DataType::none : sub->type;
      made->fields.push_back({.object = entry.object, .type = type, .at = made->bits, .bits = entry.bits});
    }
    made->bits += entry.bits;
  }
  if (made->bits > od::most_pdo_bits) {
    return tl::unexpected(node_.failure(Errc::mismatch, "the mapping has more than 64 bits", mapping));
  }
  return made;
}

Outcome<std::shared_ptr<Tpdo>> NodePdos::make_tpdo(unsigned number, const Outcome<od::PdoParameters>& pdo) {
  if (!pdo) return tl::unexpected(pdo.error());
  const auto known = layout(od::PdoKind::tpdo, number, *pdo);
  if (!known) return tl::unexpected(known.error());
  unsubscribe(number);
  const std::shared_ptr<Tpdo> made(new Tpdo(node_, number, pdo->cob_id, *known));
  tpdos_[number] = made;
  return made;
}

Outcome<std::shared_ptr<Rpdo>> NodePdos::make_rpdo(unsigned number, const Outcome<od::PdoParameters>& pdo) {
  if (!pdo) return tl::unexpected(pdo.error());
  const auto known = layout(od::PdoKind::rpdo, number, *pdo);
  if (!known) return tl::unexpected(known.error());
  const std::shared_ptr<Rpdo> made(new Rpdo(node_, number, pdo->cob_id, *known));
  auto& place = rpdos_[number];
  if (place != nullptr) place->node_ = nullptr;
  place = made;
  return made;
}

rt::Task<Outcome<std::shared_ptr<Tpdo>>> NodePdos::subscribe(unsigned tpdo) {
  const std::weak_ptr<const bool> alive = alive_;
  const NodeId id = node_.id_;
  auto pdo = co_await ask(od::PdoKind::tpdo, tpdo);
  if (alive.expired()) co_return tl::unexpected(node_gone(id));
  co_return make_tpdo(tpdo, pdo);
}

rt::Task<Outcome<std::shared_ptr<Rpdo>>> NodePdos::open(unsigned rpdo) {
  const std::weak_ptr<const bool> alive = alive_;
  const NodeId id = node_.id_;
  auto pdo = co_await ask(od::PdoKind::rpdo, rpdo);
  if (alive.expired()) co_return tl::unexpected(node_gone(id));
  co_return make_rpdo(rpdo, pdo);
}

Outcome<std::shared_ptr<Tpdo>> NodePdos::subscribe_as_described(unsigned tpdo) {
  return make_tpdo(tpdo, described(od::PdoKind::tpdo, tpdo));
}

Outcome<std::shared_ptr<Rpdo>> NodePdos::open_as_described(unsigned rpdo) {
  return make_rpdo(rpdo, described(od::PdoKind::rpdo, rpdo));
}

void NodePdos::subscribe(unsigned tpdo, std::function<void(Outcome<std::shared_ptr<Tpdo>>)> then) {
  node_.call([&] { return detail::TaskOperation(subscribe(tpdo)); }, std::move(then));
}

void NodePdos::open(unsigned rpdo, std::function<void(Outcome<std::shared_ptr<Rpdo>>)> then) {
  node_.call([&] { return detail::TaskOperation(open(rpdo)); }, std::move(then));
}

void NodePdos::unsubscribe(unsigned tpdo) noexcept {
  const auto it = tpdos_.find(tpdo);
  if (it == tpdos_.end()) return;
  it->second->end();
  tpdos_.erase(it);
}

void NodePdos::end_pdos() noexcept {
  for (const auto& [number, pdo] : tpdos_) pdo->end();
  for (const auto& [number, pdo] : rpdos_) pdo->node_ = nullptr;
  tpdos_.clear();
  rpdos_.clear();
}

}  // namespace berth::client
