#include "berth/co/pdo.hpp"

#include <algorithm>

#include "berth/co/emcy.hpp"
#include "berth/co/mpdo.hpp"
#include "berth/co/rpdo.hpp"
#include "berth/co/tpdo.hpp"

namespace berth::co {
namespace {

template <class Pdo>
[[gnu::noinline]] Pdo* search(std::span<Pdo> pdos, unsigned number) noexcept {
  const auto found = std::ranges::lower_bound(pdos, number, {}, &Pdo::number);
  return found != pdos.end() && found->number() == number ? &*found : nullptr;
}

// Most devices number their PDOs without gaps; otherwise the numbers still ascend. `search` is a function of its own,
// so that the compiler inlines this one.
template <class Pdo>
Pdo* find(std::span<Pdo> pdos, unsigned number) noexcept {
  if (number - 1 < pdos.size() && pdos[number - 1].number() == number) return &pdos[number - 1];
  return search(pdos, number);
}

}  // namespace

inline std::span<Rpdo> Pdos::rpdos() const noexcept { return {rpdos_.get(), rpdo_count_}; }
inline std::span<Tpdo> Pdos::tpdos() const noexcept { return {tpdos_.get(), context_.tpdo_count}; }

Pdos::Pdos(can::Dispatcher& dispatcher, od::Values& values, ServiceOwner& owner, Options options)
    : context_{.dispatcher = &dispatcher,
               .values = &values,
               .owner = &owner,
               .timer = this,
               .base = PdoMapping::base_of(values),
               .faults = PdoFaults(owner)},
      options_(options) {
  const od::Description& d = values.description();
  const auto counted = [&](auto& pdos) {
    return [&](std::uint16_t, std::uint32_t room) {
      ++pdos;
      field_count_ += room;
    };
  };
  for_each_pdo(d, PdoKind::rpdo, counted(rpdo_count_));
  for_each_pdo(d, PdoKind::tpdo, counted(context_.tpdo_count));
  if (!any()) return;
  fields_ = std::make_unique<PdoField[]>(field_count_);
  rpdos_ = std::make_unique<Rpdo[]>(rpdo_count_);
  tpdos_ = std::make_unique<Tpdo[]>(context_.tpdo_count);
  context_.tpdos = tpdos_.get();
  std::span<PdoField> left(fields_.get(), field_count_);
  const auto set_up = [&](auto* pdo) {
    return [&, pdo](std::uint16_t number, std::uint32_t room) mutable {
      (pdo++)->set_up(context_, number, left.first(room));
      left = left.subspan(room);
    };
  };
  for_each_pdo(d, PdoKind::rpdo, set_up(rpdos_.get()));
  for_each_pdo(d, PdoKind::tpdo, set_up(tpdos_.get()));
  if (SamProducer::wanted(d)) sam_ = std::make_unique<SamProducer>();
  context_.sam = sam_.get();
  values.attach(*this, od::first_pdo_record, od::last_pdo_record);
}

Pdos::~Pdos() { stop(); }

std::size_t Pdos::memory() const noexcept {
  return sizeof *this + field_count_ * sizeof(PdoField) + rpdo_count_ * sizeof(Rpdo) +
         context_.tpdo_count * sizeof(Tpdo) + (sam_ ? sizeof(SamProducer) : 0);
}

// --- Life ------------------------------------------------------------------------------------------------------------

void Pdos::configure() noexcept {
  for (Rpdo& pdo : rpdos()) pdo.configure();
  for (Tpdo& pdo : tpdos()) pdo.configure();
  listen();
}

void Pdos::start(NodeId node) noexcept {
  if (!any()) return;
  stop();
  context_.node = node;
  running_ = true;
  configure();
  if (!options_.send_at_start) return;
  for (Tpdo& pdo : tpdos()) {
    if (event_driven(PdoRecords(*context_.values, PdoKind::tpdo, pdo.number()).type())) pdo.event();
  }
}

void Pdos::stop() noexcept {
  if (!running_) return;
  running_ = false;
  collided_ = false;
  context_.window_end = rt::never;
  if (sam_) sam_->clear();
  for (Rpdo& pdo : rpdos()) pdo.end();
  for (Tpdo& pdo : tpdos()) pdo.end();
  context_.dispatcher->remove(*this);
  cancel();
}

void Pdos::refresh() noexcept {
  if (running_) configure();
}

// Hears the identifiers of the own TPDOs: for remote frames, and for other devices that send with them.
void Pdos::listen() noexcept {
  context_.dispatcher->remove(*this);
  const auto all = tpdos();
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto key = all[i].heard_key(options_.detect_collision);
    const auto same = [&](const Tpdo& pdo) { return pdo.heard_key(options_.detect_collision) == key; };
    if (key && std::ranges::none_of(all.first(i), same)) context_.dispatcher->add(can::only(*key), *this);
  }
}

void Pdos::received(const can::Frame& frame, rt::Time) noexcept {
  if (frame.remote) {
    for (Tpdo& pdo : tpdos()) pdo.requested(frame.key());
  } else if (options_.detect_collision && !std::exchange(collided_, true)) {
    context_.owner->raise_error(emcy_code::id_collision, error_register::communication, {});
  }
}

void Pdos::run() noexcept {
  const rt::Time time = context_.now();
  rt::Time& window_end = context_.window_end;
  if (window_end <= time) {
    for (Tpdo& pdo : tpdos()) pdo.close_window();
  }
  for (Tpdo& pdo : tpdos()) pdo.run(time);
  for (Rpdo& pdo : rpdos()) pdo.run(time);
  rt::Time earliest = window_end > time ? window_end : rt::never;
  for (const Tpdo& pdo : tpdos()) earliest = std::min(earliest, pdo.due());
  for (const Rpdo& pdo : rpdos()) earliest = std::min(earliest, pdo.due());
  context_.arm(earliest);
}

// --- What comes ------------------------------------------------------------------------------------------------------

void Pdos::sync(std::uint8_t counter, rt::Time at, rt::Duration window) noexcept {
  if (!running_) return;
  context_.window_end = window > rt::Duration::zero() ? at + window : rt::never;
  for (Rpdo& pdo : rpdos()) pdo.sync(at);
  for (Tpdo& pdo : tpdos()) pdo.sync(counter);
  context_.arm(context_.window_end);
}

bool Pdos::event(unsigned number) noexcept {
  Tpdo* const pdo = find(tpdos(), number);
  return pdo != nullptr && pdo->event();
}

bool Pdos::changed(ObjectRef object) noexcept {
  if (!running_) return false;
  const od::SubObject* const sub = context_.values->description().find(object);
  if (sub == nullptr) return false;
  bool any = false;
  for (Tpdo& pdo : tpdos()) any |= pdo.changed(object, sub->offset);
  return any;
}

can::Queued Pdos::send_dam(std::uint8_t node, ObjectRef object, std::span<const std::uint8_t> data) noexcept {
  if (node > 127 || data.size() > mpdo::most_data) return can::Queued::closed;
  for (Tpdo& pdo : tpdos()) {
    if (const auto queued = pdo.send_dam(node, object, data); queued != can::Queued::closed) return queued;
  }
  return can::Queued::closed;
}

bool Pdos::active(PdoKind kind, unsigned number) const noexcept {
  const auto is_active = [number](auto pdos) {
    const auto* const pdo = find(pdos, number);
    return pdo != nullptr && pdo->active();
  };
  return kind == PdoKind::rpdo ? is_active(rpdos()) : is_active(tpdos());
}

// --- Objects ---------------------------------------------------------------------------------------------------------

od::AbortCode Pdos::problem(PdoKind kind, unsigned number) const noexcept {
  if (number < 1 || number > most_pdos) return od::AbortCode::no_object;
  return PdoRecords(*context_.values, kind, number).problem();
}

od::AbortCode Pdos::reading(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>&) noexcept {
  const bool reserved = !PdoRecord::of(ref.index).mapping && ref.sub == pdo_sub::reserved;
  return reserved ? od::AbortCode::no_sub_index : od::AbortCode::none;
}

od::AbortCode Pdos::writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  const PdoRecord record = PdoRecord::of(ref.index);
  std::uint64_t raw = 0;
  for (std::size_t i = 0; i < value.size() && i < 8; ++i) raw |= std::uint64_t{value[i]} << (8 * i);
  if (raw > 0xFFFF'FFFFU) return od::AbortCode::invalid_value;  // the description has another type than CiA 301
  const auto number = static_cast<std::uint32_t>(raw);
  const PdoRecords records(values, record.kind, record.number);
  return record.mapping ? records.writing_mapping(ref.sub, number) : records.writing_communication(ref.sub, number);
}

// Only what may change while a PDO is valid, or makes it valid or invalid, takes effect now.
void Pdos::written(od::Values& values, ObjectRef ref) noexcept {
  const PdoRecord record = PdoRecord::of(ref.index);
  const bool configures = ref.sub == pdo_sub::cob_id || ref.sub == pdo_sub::type;
  if (!running_ || record.mapping || (!configures && ref.sub != pdo_sub::timer)) return;
  if (record.kind == PdoKind::rpdo) {
    Rpdo* const pdo = find(rpdos(), record.number);
    if (pdo == nullptr) return;
    if (configures) return pdo->configure();
    return pdo->set_deadline(values.get_or<std::uint16_t>(ref, 0));
  }
  Tpdo* const pdo = find(tpdos(), record.number);
  if (pdo == nullptr) return;
  if (!configures) return pdo->set_event_time(values.get_or<std::uint16_t>(ref, 0));
  pdo->configure();
  listen();
}

}  // namespace berth::co
