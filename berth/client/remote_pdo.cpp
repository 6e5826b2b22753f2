#include "berth/client/remote_node.hpp"

// How a node's PDOs come to be: their records, read from the device or taken from the description.

namespace berth::client {

namespace {

constexpr unsigned most_pdos = 512;
constexpr std::uint16_t to_mapping = 0x200;  // from 1400h to 1600h, from 1800h to 1A00h
constexpr std::uint8_t most_entries = 64;    // more: FEh and FFh are MPDOs
constexpr unsigned most_bits = 64;
constexpr std::uint16_t last_dummy = 0x1F;

}  // namespace

Outcome<ObjectRef> RemoteNode::pdo_record(co::PdoKind kind, unsigned number) const {
  const std::uint16_t first = kind == co::PdoKind::tpdo ? 0x1800 : 0x1400;
  if (network_ == nullptr) return tl::unexpected(failure(Errc::cancelled, "the network is gone"));
  if (number < 1 || number > most_pdos) {
    return tl::unexpected(failure(Errc::invalid, "a PDO has a number from 1 to 512"));
  }
  return ObjectRef{static_cast<std::uint16_t>(first + number - 1), 1};
}

rt::Task<Outcome<RemoteNode::PdoRecord>> RemoteNode::read_pdo(co::PdoKind kind, unsigned number) {
  // An access that succeeds shows that the node's object is still there (`Access::abandon`).
  const auto record = pdo_record(kind, number);
  if (!record) co_return tl::unexpected(record.error());
  PdoRecord pdo;
  const auto cob_id = co_await raw<std::uint32_t>(*record);
  if (!cob_id) co_return tl::unexpected(cob_id.error());
  pdo.cob_id = co::CobId(*cob_id);
  ObjectRef mapping{static_cast<std::uint16_t>(record->index + to_mapping), 0};
  const auto count = co_await raw<std::uint8_t>(mapping);
  if (!count) co_return tl::unexpected(count.error());
  if (*count > most_entries) co_return tl::unexpected(failure(Errc::unsupported, "it is an MPDO", mapping));
  while (mapping.sub < *count) {
    ++mapping.sub;
    const auto entry = co_await raw<std::uint32_t>(mapping);
    if (!entry) co_return tl::unexpected(entry.error());
    pdo.entries.push_back(co::PdoEntry::of(*entry));
  }
  co_return pdo;
}

Outcome<std::uint32_t> RemoteNode::described_value(ObjectRef ref) const {
  const auto* sub = description().find(ref);
  if (sub == nullptr) return tl::unexpected(failure(Errc::not_found, "the description has no such object", ref));
  if (!sub->has_default) return tl::unexpected(failure(Errc::not_found, "the description gives no value", ref));
  return static_cast<std::uint32_t>(description().default_of(*sub).resolve(sub->type, id_.value()));
}

Outcome<RemoteNode::PdoRecord> RemoteNode::described_pdo(co::PdoKind kind, unsigned number) const {
  const auto record = pdo_record(kind, number);
  if (!record) return tl::unexpected(record.error());
  const auto cob_id = described_value(*record);
  if (!cob_id) return tl::unexpected(cob_id.error());
  PdoRecord pdo{.cob_id = co::CobId(*cob_id), .entries = {}};
  ObjectRef mapping{static_cast<std::uint16_t>(record->index + to_mapping), 0};
  const auto count = described_value(mapping);
  if (!count) return tl::unexpected(count.error());
  if (*count > most_entries) return tl::unexpected(failure(Errc::unsupported, "it is an MPDO", mapping));
  while (mapping.sub < *count) {
    ++mapping.sub;
    const auto entry = described_value(mapping);
    if (!entry) return tl::unexpected(entry.error());
    pdo.entries.push_back(co::PdoEntry::of(*entry));
  }
  return pdo;
}

Outcome<std::shared_ptr<const PdoLayout>> RemoteNode::layout(ObjectRef record, const PdoRecord& pdo) const {
  if (!pdo.cob_id.valid()) {
    return tl::unexpected(failure(Errc::invalid, "the PDO is not valid: bit 31 of its COB-ID is set", record));
  }
  if (!pdo.cob_id.allowed()) {
    return tl::unexpected(failure(Errc::mismatch, "the COB-ID is one that no PDO may have", record));
  }
  const ObjectRef mapping{static_cast<std::uint16_t>(record.index + to_mapping), 0};
  const auto made = std::make_shared<PdoLayout>();
  made->names = names_;
  made->node = id_;
  for (const auto& entry : pdo.entries) {
    const bool dummy = entry.object.index <= last_dummy && entry.object.sub == 0;
    if (!dummy && entry.bits != 0) {
      const auto* sub = description().find(entry.object);
      const auto type = sub == nullptr ? od::DataType::none : sub->type;
      made->fields.push_back({.object = entry.object, .type = type, .at = made->bits, .bits = entry.bits});
    }
    made->bits += entry.bits;
  }
  if (made->bits > most_bits) {
    return tl::unexpected(failure(Errc::mismatch, "the mapping has more than 64 bits", mapping));
  }
  return made;
}

Outcome<std::shared_ptr<Tpdo>> RemoteNode::make_tpdo(unsigned number, const Outcome<PdoRecord>& pdo) {
  if (!pdo) return tl::unexpected(pdo.error());
  const auto known = layout(*pdo_record(co::PdoKind::tpdo, number), *pdo);
  if (!known) return tl::unexpected(known.error());
  unsubscribe(number);
  const std::shared_ptr<Tpdo> made(new Tpdo(*this, number, pdo->cob_id, *known));
  tpdos_[number] = made;
  return made;
}

Outcome<std::shared_ptr<Rpdo>> RemoteNode::make_rpdo(unsigned number, const Outcome<PdoRecord>& pdo) {
  if (!pdo) return tl::unexpected(pdo.error());
  const auto known = layout(*pdo_record(co::PdoKind::rpdo, number), *pdo);
  if (!known) return tl::unexpected(known.error());
  const std::shared_ptr<Rpdo> made(new Rpdo(*this, number, pdo->cob_id, *known));
  auto& place = rpdos_[number];
  if (place != nullptr) place->node_ = nullptr;
  place = made;
  return made;
}

rt::Task<Outcome<std::shared_ptr<Tpdo>>> RemoteNode::subscribe(unsigned tpdo) {
  const std::weak_ptr<const bool> alive = alive_;
  const NodeId id = id_;
  auto pdo = co_await read_pdo(co::PdoKind::tpdo, tpdo);
  if (alive.expired()) co_return tl::unexpected(gone(id));
  co_return make_tpdo(tpdo, pdo);
}

rt::Task<Outcome<std::shared_ptr<Rpdo>>> RemoteNode::open(unsigned rpdo) {
  const std::weak_ptr<const bool> alive = alive_;
  const NodeId id = id_;
  auto pdo = co_await read_pdo(co::PdoKind::rpdo, rpdo);
  if (alive.expired()) co_return tl::unexpected(gone(id));
  co_return make_rpdo(rpdo, pdo);
}

Failure RemoteNode::gone(NodeId id) {
  return make_failure(Error{.code = Errc::cancelled, .node = id.value(), .text = "the node's object was destroyed"});
}

Outcome<std::shared_ptr<Tpdo>> RemoteNode::subscribe_as_described(unsigned tpdo) {
  return make_tpdo(tpdo, described_pdo(co::PdoKind::tpdo, tpdo));
}

Outcome<std::shared_ptr<Rpdo>> RemoteNode::open_as_described(unsigned rpdo) {
  return make_rpdo(rpdo, described_pdo(co::PdoKind::rpdo, rpdo));
}

void RemoteNode::subscribe(unsigned tpdo, std::function<void(Outcome<std::shared_ptr<Tpdo>>)> then) {
  call([&] { return detail::TaskOperation(subscribe(tpdo)); }, std::move(then));
}

void RemoteNode::open(unsigned rpdo, std::function<void(Outcome<std::shared_ptr<Rpdo>>)> then) {
  call([&] { return detail::TaskOperation(open(rpdo)); }, std::move(then));
}

void RemoteNode::unsubscribe(unsigned tpdo) noexcept {
  const auto it = tpdos_.find(tpdo);
  if (it == tpdos_.end()) return;
  it->second->end();
  tpdos_.erase(it);
}

}  // namespace berth::client
