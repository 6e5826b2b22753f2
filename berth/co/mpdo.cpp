// Multiplex PDOs (CiA 301 §7.2.2.5): the object's address travels in the PDO.
#include <algorithm>

#include "berth/base/bytes.hpp"
#include "berth/co/emcy.hpp"
#include "berth/co/pdo.hpp"
#include "berth/co/pdo_parts.hpp"

namespace berth::co {
namespace {

constexpr std::uint8_t dam_flag = 0x80;
constexpr std::size_t mpdo_size = 8;
constexpr std::size_t most_data = 4;

can::Frame mpdo(std::uint32_t key, std::uint8_t address, ObjectRef object,
                std::span<const std::uint8_t> data) noexcept {
  can::Frame frame;
  frame.id = key & ~can::extended_flag;
  frame.extended = (key & can::extended_flag) != 0;
  frame.size = mpdo_size;
  frame.data[0] = address;
  store_le(&frame.data[1], object.index);
  frame.data[3] = object.sub;
  std::copy(data.begin(), data.end(), frame.data.begin() + 4);
  return frame;
}

/// A block of consecutive sub-indices, as both lists have it.
struct Block {
  ObjectRef first;
  std::uint8_t size = 0;
  [[nodiscard]] bool contains(ObjectRef object) const noexcept {
    return object.index == first.index && object.sub >= first.sub && object.sub - first.sub < size;
  }
};

Block scanner_entry(std::uint32_t raw) noexcept {
  return {{static_cast<std::uint16_t>(raw >> 8), static_cast<std::uint8_t>(raw)}, static_cast<std::uint8_t>(raw >> 24)};
}

/// Calls `visit(value)` for the entries of the lists `first`..`last` until it returns true.
template <class T, class Visit>
bool any_entry(const od::Values& values, std::uint16_t first, std::uint16_t last, const Visit& visit) noexcept {
  const auto objects = values.description().objects();
  auto object = std::ranges::lower_bound(objects, first, {}, &od::Object::index);
  for (; object != objects.end() && object->index <= last; ++object) {
    for (const od::SubObject& sub : values.description().subs(*object)) {
      if (sub.sub != 0 && visit(values.get_or<T>({object->index, sub.sub}, 0))) return true;
    }
  }
  return false;
}

/// An object of this device that an MPDO may write.
const od::SubObject* destination(const od::Description& description, ObjectRef object) noexcept {
  const od::SubObject* const sub = description.find(object);
  if (sub == nullptr || object.index < 0x1000 || od::byte_size(sub->type) > most_data) return nullptr;
  const PdoEntry entry{object, static_cast<std::uint8_t>(od::bit_length(sub->type))};
  return check_entry(description, entry, PdoKind::rpdo) == od::AbortCode::none ? sub : nullptr;
}

}  // namespace

// --- Producer --------------------------------------------------------------------------------------------------------

can::Queued Pdos::send_dam(std::uint8_t node, ObjectRef object, std::span<const std::uint8_t> data) noexcept {
  const auto it = std::ranges::find_if(tpdos(), [](const Tpdo& t) { return t.active && t.mode == PdoMode::dam; });
  if (it == tpdos().end() || node > 127 || data.size() > most_data) return can::Queued::closed;
  if (it->inhibit != 0 && it->free_at > now()) return can::Queued::full;
  return submit(*it, mpdo(it->key, dam_flag | node, object, data));
}

bool Pdos::scanned(ObjectRef object) const noexcept {
  return any_entry<std::uint32_t>(*values_, 0x1FA0, 0x1FCF,
                                  [&](std::uint32_t raw) { return scanner_entry(raw).contains(object); });
}

bool Pdos::scan(Tpdo& pdo, ObjectRef object) noexcept {
  if (!sam_ || !scanned(object)) return false;
  const od::SubObject* const sub = values_->description().find(object);
  if (sub->variable_length() || od::byte_size(sub->type) > most_data) return false;
  const std::span waiting(sam_->objects.data(), sam_->count);
  if (std::ranges::find(waiting, object) != waiting.end()) return true;
  if (sam_->count == SamQueue::size) return false;
  sam_->objects[sam_->count++] = object;
  if (!pdo.waiting) send_scanned(pdo);
  return true;
}

void Pdos::send_scanned(Tpdo& pdo) noexcept {
  while (sam_->count > 0) {
    if (pdo.inhibit != 0 && !may_go(pdo)) return;
    const ObjectRef object = sam_->objects[0];
    const can::Queued queued = submit(pdo, mpdo(pdo.key, node_.value(), object, values_->bytes(object)));
    if (queued != can::Queued::yes) return failed(pdo, queued);
    std::copy(sam_->objects.begin() + 1, sam_->objects.begin() + static_cast<std::ptrdiff_t>(sam_->count),
              sam_->objects.begin());
    --sam_->count;
  }
  pdo.waiting = false;
}

// --- Consumer --------------------------------------------------------------------------------------------------------

void Pdos::received_mpdo(Rpdo& pdo, const can::Frame& frame, rt::Time at) noexcept {
  const bool dam = (frame.data[0] & dam_flag) != 0;
  if (frame.size < mpdo_size) return fault(pdo, Fault::too_short, true, frame.size);
  fault(pdo, Fault::too_short, false);
  fault(pdo, Fault::timeout, false);
  if (pdo.deadline != 0) supervise(pdo, at);
  if (dam != (pdo.mode == PdoMode::dam)) return;
  const std::uint8_t node = frame.data[0] & 0x7FU;
  const ObjectRef object{load_le<std::uint16_t>(&frame.data[1]), frame.data[3]};
  if (!dam) return dispatch(node, object, &frame.data[4], at);
  if (node != 0 && node != node_.value()) return;
  const bool stored = write_dam(object, &frame.data[4]);
  set_fault(pdo, Fault::unavailable, !stored,
            {static_cast<std::uint8_t>(pdo.number), static_cast<std::uint8_t>(pdo.number >> 8), frame.data[1],
             frame.data[2], frame.data[3]});
  if (stored && observer_ != nullptr) observer_->received_mpdo(object, at);
}

bool Pdos::write_dam(ObjectRef object, const std::uint8_t* data) noexcept {
  const od::SubObject* const sub = destination(values_->description(), object);
  if (sub == nullptr) return false;
  return values_->write(object, {data, od::byte_size(sub->type)}) == od::AbortCode::none;
}

// An entry: block size, local index and sub-index, producer's index and sub-index, producer's node-ID.
void Pdos::dispatch(std::uint8_t node, ObjectRef object, const std::uint8_t* data, rt::Time at) noexcept {
  any_entry<std::uint64_t>(*values_, 0x1FD0, 0x1FFF, [&](std::uint64_t raw) {
    const Block remote{{static_cast<std::uint16_t>(raw >> 16), static_cast<std::uint8_t>(raw >> 8)},
                       static_cast<std::uint8_t>(raw >> 56)};
    if (static_cast<std::uint8_t>(raw) != node || !remote.contains(object)) return false;
    const unsigned local_sub = static_cast<std::uint8_t>(raw >> 32) + (object.sub - remote.first.sub);
    if (local_sub > 0xFF) return false;
    const ObjectRef local{static_cast<std::uint16_t>(raw >> 40), static_cast<std::uint8_t>(local_sub)};
    const od::SubObject* const sub = destination(values_->description(), local);
    if (sub == nullptr) return false;
    std::uint8_t value[most_data];
    std::copy_n(data, od::byte_size(sub->type), value);
    if (sub->type == od::DataType::boolean) value[0] &= 1U;
    (void)values_->set_bytes(local, {value, od::byte_size(sub->type)});
    if (observer_ != nullptr) observer_->received_mpdo(local, at);
    return false;  // one object may have several destinations
  });
}

}  // namespace berth::co
