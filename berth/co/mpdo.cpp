#include "berth/co/mpdo.hpp"

#include <algorithm>

#include "berth/base/bytes.hpp"

namespace berth::co {
namespace {

constexpr std::uint8_t dam_flag = 0x80;
constexpr std::uint16_t first_scanner = 0x1FA0, last_scanner = 0x1FCF;
constexpr std::uint16_t first_dispatcher = 0x1FD0, last_dispatcher = 0x1FFF;

can::Frame make(std::uint32_t key, std::uint8_t address, ObjectRef object,
                std::span<const std::uint8_t> data) noexcept {
  can::Frame frame;
  frame.id = key & ~can::extended_flag;
  frame.extended = (key & can::extended_flag) != 0;
  frame.size = mpdo::size;
  frame.data[0] = address;
  store_le(&frame.data[1], object.index);
  frame.data[3] = object.sub;
  std::copy(data.begin(), data.end(), frame.data.begin() + 4);
  return frame;
}

/// A block of consecutive sub-indices, as both lists contain it.
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

/// Calls `visit(value)` for the entries of the list objects `first`..`last` until it returns true.
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

/// The object of this device, if an MPDO may write it.
const od::SubObject* destination(const od::Description& description, ObjectRef object) noexcept {
  const od::SubObject* const sub = description.find(object);
  if (sub == nullptr || object.index < 0x1000 || od::byte_size(sub->type) > mpdo::most_data) return nullptr;
  const PdoEntry entry{object, static_cast<std::uint8_t>(od::bit_length(sub->type))};
  return check_entry(description, entry, PdoKind::rpdo) == od::AbortCode::none ? sub : nullptr;
}

bool scanned(const od::Values& values, ObjectRef object) noexcept {
  return any_entry<std::uint32_t>(values, first_scanner, last_scanner,
                                  [&](std::uint32_t raw) { return scanner_entry(raw).contains(object); });
}

}  // namespace

// --- Producer --------------------------------------------------------------------------------------------------------

can::Frame mpdo::make_dam(std::uint32_t key, std::uint8_t node, ObjectRef object,
                          std::span<const std::uint8_t> data) noexcept {
  return make(key, dam_flag | node, object, data);
}

can::Frame mpdo::make_sam(std::uint32_t key, NodeId producer, ObjectRef object,
                          std::span<const std::uint8_t> data) noexcept {
  return make(key, producer.value(), object, data);
}

bool SamProducer::wanted(const od::Description& description) noexcept {
  return std::ranges::any_of(description.objects(), [](const od::Object& object) {
    return object.index >= first_scanner && object.index <= last_scanner;
  });
}

bool SamProducer::put(const od::Values& values, ObjectRef object) noexcept {
  if (!scanned(values, object)) return false;
  const od::SubObject* const sub = values.description().find(object);
  if (sub->variable_length() || od::byte_size(sub->type) > mpdo::most_data) return false;
  const std::span waiting(objects_.data(), count_);
  if (std::ranges::find(waiting, object) != waiting.end()) return true;
  if (count_ == room) return false;
  objects_[count_++] = object;
  return true;
}

void SamProducer::pop() noexcept {
  std::copy(objects_.begin() + 1, objects_.begin() + static_cast<std::ptrdiff_t>(count_), objects_.begin());
  --count_;
}

// --- Consumer --------------------------------------------------------------------------------------------------------

mpdo::Heard mpdo::Heard::of(const can::Frame& frame) noexcept {
  Heard heard{(frame.data[0] & dam_flag) != 0,
              static_cast<std::uint8_t>(frame.data[0] & 0x7FU),
              {load_le<std::uint16_t>(&frame.data[1]), frame.data[3]}};
  std::copy_n(frame.data.begin() + 4, most_data, heard.data.begin());
  return heard;
}

bool mpdo::write(od::Values& values, const Heard& heard) noexcept {
  const od::SubObject* const sub = destination(values.description(), heard.object);
  if (sub == nullptr) return false;
  return values.write(heard.object, std::span(heard.data).first(od::byte_size(sub->type))) == od::AbortCode::none;
}

// An entry: block size, local index and sub-index, producer's index and sub-index, producer's node-ID.
void mpdo::dispatch(od::Values& values, const Heard& heard, PdoObserver* observer, rt::Time at) noexcept {
  any_entry<std::uint64_t>(values, first_dispatcher, last_dispatcher, [&](std::uint64_t raw) {
    const Block remote{{static_cast<std::uint16_t>(raw >> 16), static_cast<std::uint8_t>(raw >> 8)},
                       static_cast<std::uint8_t>(raw >> 56)};
    if (static_cast<std::uint8_t>(raw) != heard.node || !remote.contains(heard.object)) return false;
    const unsigned local_sub = static_cast<std::uint8_t>(raw >> 32) + (heard.object.sub - remote.first.sub);
    if (local_sub > 0xFF) return false;
    const ObjectRef local{static_cast<std::uint16_t>(raw >> 40), static_cast<std::uint8_t>(local_sub)};
    const od::SubObject* const sub = destination(values.description(), local);
    if (sub == nullptr) return false;
    auto value = heard.data;
    if (sub->type == od::DataType::boolean) value[0] &= 1U;
    (void)values.set_bytes(local, std::span(value).first(od::byte_size(sub->type)));
    if (observer != nullptr) observer->received_mpdo(local, at);
    return false;  // one object may have several destinations
  });
}

}  // namespace berth::co
