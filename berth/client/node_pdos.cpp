#include "berth/client/node_pdos.hpp"

#include "berth/client/remote_node.hpp"

namespace berth::client {

namespace {

constexpr unsigned most_pdos = 512;
constexpr std::uint16_t to_mapping = 0x200;  // from 1400h to 1600h, from 1800h to 1A00h
constexpr std::uint8_t most_entries = 64;    // more: FEh and FFh are MPDOs
constexpr unsigned most_bits = 64;
constexpr std::uint16_t last_dummy = 0x1F;

}  // namespace

Outcome<ObjectRef> NodePdos::record_of(co::PdoKind kind, unsigned number) const {
  const std::uint16_t first = kind == co::PdoKind::tpdo ? 0x1800 : 0x1400;
  if (node_.network_ == nullptr) return tl::unexpected(node_.failure(Errc::cancelled, "the network is gone"));
  if (number < 1 || number > most_pdos) {
    return tl::unexpected(node_.failure(Errc::invalid, "a PDO has a number from 1 to 512"));
  }
  return ObjectRef{static_cast<std::uint16_t>(first + number - 1), 1};
}

rt::Task<Outcome<NodePdos::Record>> NodePdos::read_record(co::PdoKind kind, unsigned number) {
  // An access that succeeds shows that the node's object is still there (`Access::abandon`).
  const auto record = record_of(kind, number);
  if (!record) co_return tl::unexpected(record.error());
  Record pdo;
  const auto cob_id = co_await raw<std::uint32_t>(*record);
  if (!cob_id) co_return tl::unexpected(cob_id.error());
  pdo.cob_id = co::CobId(*cob_id);
  ObjectRef mapping{static_cast<std::uint16_t>(record->index + to_mapping), 0};
  const auto count = co_await raw<std::uint8_t>(mapping);
  if (!count) co_return tl::unexpected(count.error());
  if (*count > most_entries) co_return tl::unexpected(node_.failure(Errc::unsupported, "it is an MPDO", mapping));
  while (mapping.sub < *count) {
    ++mapping.sub;
    const auto entry = co_await raw<std::uint32_t>(mapping);
    if (!entry) co_return tl::unexpected(entry.error());
    pdo.entries.push_back(co::PdoEntry::of(*entry));
  }
  co_return pdo;
}

Outcome<std::uint32_t> NodePdos::described_value(ObjectRef ref) const {
  const auto* sub = node_.description().find(ref);
  if (sub == nullptr) return tl::unexpected(node_.failure(Errc::not_found, "the description has no such object", ref));
  if (!sub->has_default) return tl::unexpected(node_.failure(Errc::not_found, "the description gives no value", ref));
  return static_cast<std::uint32_t>(node_.description().default_of(*sub).resolve(sub->type, node_.id_.value()));
}

Outcome<NodePdos::Record> NodePdos::described_record(co::PdoKind kind, unsigned number) const {
  const auto record = record_of(kind, number);
  if (!record) return tl::unexpected(record.error());
  const auto cob_id = described_value(*record);
  if (!cob_id) return tl::unexpected(cob_id.error());
  Record pdo{.cob_id = co::CobId(*cob_id), .entries = {}};
  ObjectRef mapping{static_cast<std::uint16_t>(record->index + to_mapping), 0};
  const auto count = described_value(mapping);
  if (!count) return tl::unexpected(count.error());
  if (*count > most_entries) return tl::unexpected(node_.failure(Errc::unsupported, "it is an MPDO", mapping));
  while (mapping.sub < *count) {
    ++mapping.sub;
    const auto entry = described_value(mapping);
    if (!entry) return tl::unexpected(entry.error());
    pdo.entries.push_back(co::PdoEntry::of(*entry));
  }
  return pdo;
}

Outcome<std::shared_ptr<const PdoLayout>> NodePdos::layout(ObjectRef at, const Record& record) const {
  if (!record.cob_id.valid()) {
    return tl::unexpected(node_.failure(Errc::invalid, "the PDO is not valid: bit 31 of its COB-ID is set", at));
  }
  if (!record.cob_id.allowed()) {
    return tl::unexpected(node_.failure(Errc::mismatch, "the COB-ID is one that no PDO may have", at));
  }
  const ObjectRef mapping{static_cast<std::uint16_t>(at.index + to_mapping), 0};
  const auto made = std::make_shared<PdoLayout>();
  made->names = node_.names_;
  made->node = node_.id_;
  for (const auto& entry : record.entries) {
    const bool dummy = entry.object.index <= last_dummy && entry.object.sub == 0;
    if (!dummy && entry.bits != 0) {
      const auto* sub = node_.description().find(entry.object);
      const auto type = sub == nullptr ? od::DataType::none : sub->type;
      made->fields.push_back({.object = entry.object, .type = type, .at = made->bits, .bits = entry.bits});
    }
    made->bits += entry.bits;
  }
  if (made->bits > most_bits) {
    return tl::unexpected(node_.failure(Errc::mismatch, "the mapping has more than 64 bits", mapping));
  }
  return made;
}

Outcome<std::shared_ptr<Tpdo>> NodePdos::make_tpdo(unsigned number, const Outcome<Record>& pdo) {
  if (!pdo) return tl::unexpected(pdo.error());
  const auto known = layout(*record_of(co::PdoKind::tpdo, number), *pdo);
  if (!known) return tl::unexpected(known.error());
  unsubscribe(number);
  const std::shared_ptr<Tpdo> made(new Tpdo(node_, number, pdo->cob_id, *known));
  tpdos_[number] = made;
  return made;
}

Outcome<std::shared_ptr<Rpdo>> NodePdos::make_rpdo(unsigned number, const Outcome<Record>& pdo) {
  if (!pdo) return tl::unexpected(pdo.error());
  const auto known = layout(*record_of(co::PdoKind::rpdo, number), *pdo);
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
  auto pdo = co_await read_record(co::PdoKind::tpdo, tpdo);
  if (alive.expired()) co_return tl::unexpected(node_gone(id));
  co_return make_tpdo(tpdo, pdo);
}

rt::Task<Outcome<std::shared_ptr<Rpdo>>> NodePdos::open(unsigned rpdo) {
  const std::weak_ptr<const bool> alive = alive_;
  const NodeId id = node_.id_;
  auto pdo = co_await read_record(co::PdoKind::rpdo, rpdo);
  if (alive.expired()) co_return tl::unexpected(node_gone(id));
  co_return make_rpdo(rpdo, pdo);
}

Outcome<std::shared_ptr<Tpdo>> NodePdos::subscribe_as_described(unsigned tpdo) {
  return make_tpdo(tpdo, described_record(co::PdoKind::tpdo, tpdo));
}

Outcome<std::shared_ptr<Rpdo>> NodePdos::open_as_described(unsigned rpdo) {
  return make_rpdo(rpdo, described_record(co::PdoKind::rpdo, rpdo));
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
