#include "berth/device/parameter_store.hpp"

#include <algorithm>
#include <utility>

#include "berth/base/bytes.hpp"
#include "berth/base/crc.hpp"

namespace berth::device {
namespace {

bool within(std::uint16_t index, std::uint16_t first, std::uint16_t last) noexcept {
  return index >= first && index <= last;
}

/// Commands, measured values and histories: no device restores them at power-on.
bool is_passing(std::uint16_t index) noexcept {
  return within(index, 0x1001, 0x1003) || within(index, 0x1010, 0x1011) || index == 0x1013 ||
         within(index, 0x1023, 0x1026) || within(index, 0x1F50, 0x1F5F) || within(index, 0x1F82, 0x1F83);
}

bool in_limits(const od::Values& values, const od::SubObject& sub, std::span<const std::uint8_t> value) noexcept {
  const od::Limits* const limits = values.description().limits(sub);
  if (limits == nullptr || sub.variable_length()) return true;
  const auto raw = od::load(sub.type, value.data());
  const auto id = values.node_id().value();
  if (limits->low.present() && od::compare(sub.type, raw, limits->low.resolve(sub.type, id)) < 0) return false;
  return !limits->high.present() || od::compare(sub.type, raw, limits->high.resolve(sub.type, id)) <= 0;
}

}  // namespace

std::uint8_t default_parameter_group(const od::Description& description, const od::Object& object,
                                     const od::SubObject& sub) noexcept {
  const auto index = object.index;
  const bool rw = od::readable(sub.access) && od::writable(sub.access);
  const bool process_data = sub.access != od::Access::rw && sub.mappable && !within(index, 0x1000, 0x1FFF);
  const bool kept = rw && !process_data && sub.type != od::DataType::domain && sub.capacity <= ParameterStore::usual &&
                    ((sub.obj_flags | object.obj_flags) & od::refuse_write_on_download) == 0;
  if (!kept || index < 0x1000 || is_passing(index)) return parameter_group::none;
  if (within(index, 0x1000, 0x1FFF)) return parameter_group::communication;
  const bool separate = within(index, 0x2000, 0x5FFF) && description.find({0x1010, 4}) != nullptr;
  return separate ? parameter_group::manufacturer : parameter_group::application;
}

std::size_t ParameterStore::footprint(const od::Description& description, GroupOf group) noexcept {
  std::size_t entries = 0;
  for (const auto& object : description.objects()) {
    for (const auto& sub : description.subs(object)) {
      if (sub.capacity > longest || group(description, object, sub) == parameter_group::none) continue;
      entries += entry_overhead + sub.capacity;
    }
  }
  return 2 * (header_size + std::max(entries, header_size + 1));
}

std::size_t ParameterStore::room_for(const od::Description& description, GroupOf group) noexcept {
  std::size_t room = usual;
  for (const auto& object : description.objects()) {
    for (const auto& sub : description.subs(object)) {
      if (sub.capacity > longest || group(description, object, sub) == parameter_group::none) continue;
      room = std::max<std::size_t>(room, sub.capacity);
    }
  }
  return room;
}

ParameterStore::ParameterStore(NvMemory& memory, std::size_t at, std::span<const Preset> presets, Owner& owner,
                               GroupOf group, std::size_t room)
    : memory_(&memory),
      at_(at),
      slot_size_(memory.size() > at ? (memory.size() - at) / 2 : 0),
      presets_(presets),
      owner_(&owner),
      group_of_(group),
      old_(*this),
      chunk_(std::clamp(room, usual, longest) + entry_overhead),
      value_(room > usual ? this->room() : 0) {}

std::uint8_t ParameterStore::group_of(const od::Description& description, ObjectRef ref) const noexcept {
  const auto* const object = description.find(ref.index);
  const auto* const sub = object == nullptr ? nullptr : description.find(*object, ref.sub);
  if (sub == nullptr || sub->capacity > room()) return parameter_group::none;
  return group_of_(description, *object, *sub);
}

// --- Reading ---------------------------------------------------------------------------------------------------------

bool ParameterStore::read_slot(unsigned slot, std::uint32_t& sequence, std::uint32_t& length) const noexcept {
  std::array<std::uint8_t, header_size> header{};
  memory_->read(slot_at(slot), header);
  if (load_le<std::uint32_t>(header.data() + 12) != crc32(std::span(header).first(12))) return false;
  sequence = load_le<std::uint32_t>(header.data());
  length = load_le<std::uint32_t>(header.data() + 4);
  if (length > slot_size_ - header_size) return false;
  std::uint32_t crc = 0;
  std::array<std::uint8_t, 64> piece{};
  for (std::size_t done = 0; done < length; done += piece.size()) {
    const auto part = std::span(piece).first(std::min(piece.size(), length - done));
    memory_->read(slot_at(slot) + header_size + done, part);
    crc = crc32(part, crc);
  }
  return crc == load_le<std::uint32_t>(header.data() + 8);
}

bool ParameterStore::load() noexcept {
  image_ = {};
  if (!usable()) return false;
  std::array<std::uint32_t, 2> sequence{};
  std::array<std::uint32_t, 2> length{};
  const bool first = read_slot(0, sequence[0], length[0]);
  const bool second = read_slot(1, sequence[1], length[1]);
  image_.loaded = first || second;
  if (!image_.loaded) return false;
  // The difference shows which is newer, so that the number may wrap.
  image_.slot = second && (!first || static_cast<std::int32_t>(sequence[1] - sequence[0]) > 0) ? 1 : 0;
  image_.sequence = sequence[image_.slot];
  image_.length = length[image_.slot];
  return true;
}

ParameterStore::Walk::Walk(const ParameterStore& store) noexcept : store_(&store) { take(); }

void ParameterStore::Walk::take() noexcept {
  ended_ = !store_->image_.loaded || at_ + entry_overhead > store_->image_.length;
  if (ended_) return;
  std::array<std::uint8_t, entry_overhead> raw{};
  store_->memory_->read(store_->slot_at(store_->image_.slot) + header_size + at_, raw);
  entry_ = {.ref = {load_le<std::uint16_t>(raw.data()), raw[2]},
            .type = static_cast<od::DataType>(raw[3]),
            .length = load_le<std::uint16_t>(raw.data() + 4)};
  ended_ = at_ + entry_overhead + entry_.length > store_->image_.length;
}

void ParameterStore::Walk::next() noexcept {
  at_ += entry_overhead + entry_.length;
  take();
}

void ParameterStore::Walk::read_value(std::span<std::uint8_t> into) const noexcept {
  store_->memory_->read(store_->slot_at(store_->image_.slot) + header_size + at_ + entry_overhead, into);
}

bool ParameterStore::fits(const Entry& entry, const od::SubObject& sub) noexcept {
  if (entry.type != sub.type) return false;
  return sub.variable_length() ? entry.length <= sub.capacity : entry.length == sub.capacity;
}

void ParameterStore::apply(od::Values& values, od::Area area) const noexcept {
  const auto& description = values.description();
  std::array<std::uint8_t, usual> short_value{};
  const auto buffer = value_.empty() ? std::span<std::uint8_t>(short_value) : std::span(value_);
  for (Walk walk(*this); !walk.at_end(); walk.next()) {
    const Entry& entry = walk.entry();
    if (area != od::Area::all && od::area_of(entry.ref.index) != area) continue;
    if (group_of(description, entry.ref) == parameter_group::none) continue;
    const auto& sub = *description.find(entry.ref);
    if (!fits(entry, sub)) continue;
    const auto value = buffer.first(entry.length);
    walk.read_value(value);
    if (in_limits(values, sub, value)) values.set_bytes(entry.ref, value);
  }
}

// --- Writing ---------------------------------------------------------------------------------------------------------

bool ParameterStore::begin(const od::Values& values, std::uint8_t group, bool saves) noexcept {
  if (busy() || !usable()) return false;
  values_ = &values;
  group_ = group;
  saves_ = saves;
  header_ = false;
  old_ = Walk(*this);
  object_ = sub_ = 0;
  put_ = crc_ = 0;
  if (write_next()) return true;
  values_ = nullptr;
  return false;
}

bool ParameterStore::write_next() noexcept {
  const auto count = fill();
  if (count == 0) return write_header();
  if (header_size + put_ + count > slot_size_) return false;
  const auto bytes = std::span<const std::uint8_t>(chunk_).first(count);
  const auto at = slot_at(1 - image_.slot) + header_size + put_;
  crc_ = crc32(bytes, crc_);
  put_ += static_cast<std::uint32_t>(count);
  return memory_->write(at, bytes, *this);
}

bool ParameterStore::write_header() noexcept {
  header_ = true;
  store_le<std::uint32_t>(chunk_.data(), image_.sequence + 1);
  store_le<std::uint32_t>(chunk_.data() + 4, put_);
  store_le<std::uint32_t>(chunk_.data() + 8, crc_);
  store_le<std::uint32_t>(chunk_.data() + 12, crc32(std::span(chunk_).first(12)));
  return memory_->write(slot_at(1 - image_.slot), std::span(chunk_).first(header_size), *this);
}

/// Only whole entries: the application may change a value between two writes.
std::size_t ParameterStore::fill() noexcept {
  const auto& description = values_->description();
  const auto objects = description.objects();
  std::size_t used = 0;
  for (; object_ < objects.size(); ++object_, sub_ = 0) {
    const auto subs = description.subs(objects[object_]);
    for (; sub_ < subs.size(); ++sub_) {
      if (!put(objects[object_], subs[sub_], used)) return used;
    }
  }
  return used;
}

/// False: the chunk is full, and this entry is the first of the next one.
bool ParameterStore::put(const od::Object& object, const od::SubObject& sub, std::size_t& used) noexcept {
  const ObjectRef ref{object.index, sub.sub};
  if (sub.capacity > room()) return true;
  const auto group = group_of_(values_->description(), object, sub);
  if (group == parameter_group::none) return true;
  const bool concerned = group_ == parameter_group::all || group == group_;
  std::size_t length = 0;
  if (concerned) {
    if (!saves_ || at_default(ref, sub)) return true;
    length = values_->stored(sub).size();
  } else {
    while (!old_.at_end() && old_.entry().ref < ref) old_.next();
    if (old_.at_end() || old_.entry().ref != ref || !fits(old_.entry(), sub)) return true;
    length = old_.entry().length;
  }
  if (used + entry_overhead + length > chunk_.size()) return false;
  std::uint8_t* const to = chunk_.data() + used;
  store_le(to, ref.index);
  to[2] = ref.sub;
  to[3] = static_cast<std::uint8_t>(sub.type);
  store_le(to + 4, static_cast<std::uint16_t>(length));
  if (concerned) {
    std::ranges::copy(values_->stored(sub), to + entry_overhead);
  } else {
    old_.read_value({to + entry_overhead, length});
  }
  used += entry_overhead + length;
  return true;
}

bool ParameterStore::at_default(ObjectRef ref, const od::SubObject& sub) const noexcept {
  if (sub.relative || sub.variable_length()) return false;
  const auto raw = od::load(sub.type, values_->stored(sub).data());
  const auto preset = std::ranges::find(presets_, ref, &Preset::object);
  if (preset != presets_.end()) return od::wrap(sub.type, preset->value) == raw;
  return raw == (sub.has_default ? values_->description().default_of(sub).raw : 0);
}

void ParameterStore::written(bool ok) noexcept {
  if (ok && header_) {
    image_.slot = 1 - image_.slot;
    ++image_.sequence;
    image_.length = put_;
    image_.loaded = true;
  }
  if (std::exchange(ending_, false)) return;
  if (!ok || header_) return end(ok);
  if (!write_next()) end(false);
}

void ParameterStore::end(bool ok) noexcept {
  values_ = nullptr;
  owner_->parameters_written(ok);
}

void ParameterStore::abandon() noexcept {
  if (values_ == nullptr) return;
  values_ = nullptr;
  ending_ = true;  // a header that is being written may still make the new image valid: that image is whole
}

void ParameterStore::forget() noexcept {
  values_ = nullptr;
  ending_ = false;
}

}  // namespace berth::device
