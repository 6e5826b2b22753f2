// The set of PDOs: what there is, how it begins and ends, and its one timer. Records: pdo_objects.cpp; frames:
// tpdo.cpp, rpdo.cpp, mpdo.cpp.
#include "berth/co/pdo.hpp"

#include <algorithm>

#include "berth/co/emcy.hpp"
#include "berth/co/pdo_parts.hpp"

namespace berth::co {
namespace {

constexpr std::uint16_t first_record = 0x1400;
constexpr std::uint16_t last_record = 0x1BFF;
constexpr std::uint16_t first_scanner = 0x1FA0;
constexpr std::uint16_t last_scanner = 0x1FCF;

bool any_object(const od::Description& description, std::uint16_t first, std::uint16_t last) noexcept {
  return std::ranges::any_of(description.objects(),
                             [=](const od::Object& o) { return o.index >= first && o.index <= last; });
}

}  // namespace

template <class Visit>
void Pdos::for_each_described(const od::Description& description, PdoKind kind, const Visit& visit) {
  for (const od::Object& object : description.objects()) {
    const unsigned number = object.index - communication_index(kind, 0U);
    if (number < 1 || number > most_pdos) continue;
    const od::Object* const mapping = description.find(mapping_index(kind, number));
    if (mapping == nullptr) continue;
    const auto room = std::min<std::size_t>(mapping->count > 0 ? mapping->count - 1U : 0U, PdoMapping::most_entries);
    visit(static_cast<std::uint16_t>(number), static_cast<std::uint32_t>(room));
  }
}

Pdos::Pdos(can::Dispatcher& dispatcher, od::Values& values, ServiceOwner& owner, Options options)
    : dispatcher_(&dispatcher),
      values_(&values),
      owner_(&owner),
      base_(PdoMapping::base_of(values)),
      options_(options) {
  const od::Description& d = values.description();
  for_each_described(d, PdoKind::rpdo, [&](std::uint16_t, std::uint32_t room) {
    ++rpdo_count_;
    field_count_ += room;
  });
  for_each_described(d, PdoKind::tpdo, [&](std::uint16_t, std::uint32_t room) {
    ++tpdo_count_;
    field_count_ += room;
  });
  if (!any()) return;
  fields_ = std::make_unique<PdoField[]>(field_count_);
  rpdos_ = std::make_unique<Rpdo[]>(rpdo_count_);
  tpdos_ = std::make_unique<Tpdo[]>(tpdo_count_);
  std::span<PdoField> left(fields_.get(), field_count_);
  const auto set_up = [&](auto& pdo, std::uint16_t number, std::uint32_t room) {
    pdo.set = this;
    pdo.number = number;
    pdo.mapping = PdoMapping(left.first(room));
    left = left.subspan(room);
  };
  Rpdo* rpdo = rpdos_.get();
  for_each_described(d, PdoKind::rpdo, [&](auto number, auto room) { set_up(*rpdo++, number, room); });
  Tpdo* tpdo = tpdos_.get();
  for_each_described(d, PdoKind::tpdo, [&](auto number, auto room) { set_up(*tpdo++, number, room); });
  if (any_object(d, first_scanner, last_scanner)) sam_ = std::make_unique<SamQueue>();
  values.attach(*this, first_record, last_record);
}

Pdos::~Pdos() { stop(); }

std::size_t Pdos::memory() const noexcept {
  return sizeof *this + field_count_ * sizeof(PdoField) + rpdo_count_ * sizeof(Rpdo) + tpdo_count_ * sizeof(Tpdo) +
         (sam_ ? sizeof(SamQueue) : 0);
}

void Pdos::start(NodeId node) noexcept {
  if (!any()) return;
  stop();
  node_ = node;
  running_ = true;
  for (Rpdo& pdo : rpdos()) configure(pdo);
  for (Tpdo& pdo : tpdos()) configure(pdo);
  listen();
  if (!options_.send_at_start) return;
  for (Tpdo& pdo : tpdos()) {
    if (event_driven(pdo.type)) fire(pdo);
  }
}

void Pdos::stop() noexcept {
  if (!running_) return;
  running_ = false;
  collided_ = false;
  window_end_ = rt::never;
  if (sam_) sam_->count = 0;
  for (Rpdo& pdo : rpdos()) end(pdo);
  for (Tpdo& pdo : tpdos()) end(pdo);
  dispatcher_->remove(*this);
  cancel();
}

void Pdos::refresh() noexcept {
  if (!running_) return;
  for (Rpdo& pdo : rpdos()) configure(pdo);
  for (Tpdo& pdo : tpdos()) configure(pdo);
  listen();
}

void Pdos::end(Rpdo& pdo) noexcept {
  for (std::size_t i = 0; i < faults; ++i) fault(pdo, static_cast<Fault>(i), false);
  if (pdo.active) dispatcher_->remove(pdo);
  pdo.active = pdo.waiting = false;
  pdo.choose_way();
  pdo.due = rt::never;
}

void Pdos::end(Tpdo& pdo) noexcept {
  if (pdo.pending()) {
    dispatcher_->withdraw(pdo);
    pdo.free_at = now();
  }
  pdo.active = pdo.event = pdo.sampled = pdo.waiting = pdo.quick = false;
  pdo.due = rt::never;
}

void Pdos::configure(Rpdo& pdo) noexcept {
  end(pdo);
  const CobId cob = cob_id(PdoKind::rpdo, pdo.number);
  const std::uint8_t count = mapped(PdoKind::rpdo, pdo.number);
  pdo.type = type(PdoKind::rpdo, pdo.number);
  pdo.deadline = values_->get_or<std::uint16_t>({communication_index(PdoKind::rpdo, pdo.number), 5}, 0);
  if (!cob.valid() || !cob.allowed() || !usable_type(PdoKind::rpdo, pdo.type, count)) return;
  pdo.mode = mode_of(count);
  if (pdo.mode == PdoMode::mapped) {
    const od::AbortCode code = resolve(PdoKind::rpdo, pdo.number, count, pdo.mapping);
    if (code != od::AbortCode::none || pdo.mapping.empty()) return;
  }
  pdo.active = true;
  pdo.choose_way();
  dispatcher_->add(can::only(cob.key()), pdo);
}

void Pdos::configure(Tpdo& pdo) noexcept {
  end(pdo);
  const std::uint16_t record = communication_index(PdoKind::tpdo, pdo.number);
  const CobId cob = cob_id(PdoKind::tpdo, pdo.number);
  const std::uint8_t count = mapped(PdoKind::tpdo, pdo.number);
  pdo.key = cob.key();
  pdo.answers = (cob.raw() & CobId::second_bit) == 0;
  pdo.type = type(PdoKind::tpdo, pdo.number);
  pdo.start_at = values_->get_or<std::uint8_t>({record, 6}, 0);
  pdo.syncs = 0;
  const bool events = event_driven(pdo.type);
  pdo.inhibit = events ? values_->get_or<std::uint16_t>({record, 3}, 0) : std::uint16_t{0};
  pdo.event_time = events ? values_->get_or<std::uint16_t>({record, 5}, 0) : std::uint16_t{0};
  if (!cob.valid() || !cob.allowed() || !usable_type(PdoKind::tpdo, pdo.type, count)) return;
  pdo.mode = mode_of(count);
  if (pdo.mode == PdoMode::mapped) {
    const od::AbortCode code = resolve(PdoKind::tpdo, pdo.number, count, pdo.mapping);
    if (code != od::AbortCode::none || pdo.mapping.empty()) return;
    const auto* const stamp = values_->description().find(ObjectRef{0x1013, 0});
    pdo.stamped = stamp != nullptr && pdo.mapping.contains(stamp->offset);
  } else if (other_producer(pdo.number)) {
    return;
  }
  pdo.active = true;
  pdo.choose_way();
  restart_event_timer(pdo);
}

// Hears the identifiers of its own TPDOs: for remote frames, and for others that send with them.
void Pdos::listen() noexcept {
  dispatcher_->remove(*this);
  const auto wanted = [&](const Tpdo& pdo) { return pdo.active && (options_.detect_collision || pdo.answers); };
  const auto all = tpdos();
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto same = [&](const Tpdo& pdo) { return wanted(pdo) && pdo.key == all[i].key; };
    if (wanted(all[i]) && std::ranges::none_of(all.first(i), same)) dispatcher_->add(can::only(all[i].key), *this);
  }
}

void Pdos::received(const can::Frame& frame, rt::Time) noexcept {
  if (frame.remote) return requested(frame.key());
  if (options_.detect_collision && !std::exchange(collided_, true)) {
    owner_->raise_error(emcy_code::id_collision, error_register::communication, {});
  }
}

// The timer stands at or before the earliest deadline; what moves a deadline later leaves it alone.
void Pdos::arm(rt::Time when) noexcept {
  if (when == rt::never || (timed() && due() <= when)) return;
  dispatcher_->executor().at(when, *this);
}

void Pdos::run() noexcept {
  const rt::Time time = now();
  if (window_end_ <= time) close_window();
  for (Tpdo& pdo : tpdos()) {
    if (pdo.waiting && pdo.free_at <= time) retry(pdo);
    if (pdo.due > time) continue;
    pdo.due = rt::never;
    fire(pdo);
  }
  for (Rpdo& pdo : rpdos()) {
    if (pdo.due > time) continue;
    pdo.due = rt::never;
    fault(pdo, Fault::timeout, true);
  }
  rt::Time earliest = window_end_ > time ? window_end_ : rt::never;
  for (const Tpdo& pdo : tpdos()) earliest = std::min({earliest, pdo.due, pdo.waiting ? pdo.free_at : rt::never});
  for (const Rpdo& pdo : rpdos()) earliest = std::min(earliest, pdo.due);
  arm(earliest);
}

bool Pdos::active(PdoKind kind, unsigned number) const noexcept {
  if (kind == PdoKind::rpdo) {
    const Rpdo* const pdo = find(rpdos(), number);
    return pdo != nullptr && pdo->active;
  }
  const Tpdo* const pdo = find(tpdos(), number);
  return pdo != nullptr && pdo->active;
}

}  // namespace berth::co
