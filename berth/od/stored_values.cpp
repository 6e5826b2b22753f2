#include "berth/od/stored_values.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "berth/base/bytes.hpp"

namespace berth::od {

StoredValues::StoredValues(std::shared_ptr<const Description> description, NodeId node_id)
    : description_(std::move(description)), data_(description_->image_) {
  reset(node_id);
}

bool StoredValues::absent(const SubObject& sub) const noexcept {
  return sub.variable_length() && load_le<std::uint32_t>(data_.data() + sub.offset) == no_value;
}

std::size_t StoredValues::slot_of(std::uint32_t index) const noexcept {
  const auto& objects = description_->objects_;
  auto at = std::ranges::lower_bound(objects, index, {}, &Object::index);
  // An object without sub-objects has no values: the search goes on.
  while (at != objects.end() && at->count == 0) ++at;
  return at == objects.end() ? data_.size() : description_->subs_[at->first].offset;
}

void StoredValues::reset(NodeId node_id, Area area) noexcept {
  node_id_ = node_id;
  const std::size_t begin = slot_of(0x1000);
  const std::size_t end = slot_of(0x2000);
  const std::uint8_t* const image = description_->image_.data();
  const auto restore = [&](std::size_t first, std::size_t last) {
    if (first < last) std::memcpy(data_.data() + first, image + first, last - first);
  };
  if (area != Area::communication) {
    restore(0, begin);
    restore(end, data_.size());
  }
  if (area != Area::application) restore(begin, end);
  for (const auto& each : description_->relatives_) {
    const SubObject& sub = description_->subs_[each.sub];
    const bool communication = sub.offset >= begin && sub.offset < end;
    if (area != Area::all && communication != (area == Area::communication)) continue;
    store(sub.type, Literal::node_id_plus(each.offset).resolve(sub.type, node_id.value()), data_.data() + sub.offset);
  }
}

AbortCode StoredValues::check_length(const SubObject& sub, std::size_t length) noexcept {
  if (length > sub.capacity) return sub.bounded ? AbortCode::length_too_high : AbortCode::out_of_memory;
  if (!sub.variable_length() && length < sub.capacity) return AbortCode::length_too_low;
  if (sub.type == DataType::unicode_string && length % 2 != 0) return AbortCode::length_mismatch;
  return AbortCode::none;
}

void StoredValues::put(const SubObject& sub, std::span<const std::uint8_t> value) noexcept {
  std::uint8_t* at = data_.data() + sub.offset;
  if (sub.variable_length()) {
    store_le(at, static_cast<std::uint32_t>(value.size()));
    at += 4;
  }
  // memmove: a caller may write back the bytes that `bytes` returned.
  if (!value.empty()) std::memmove(at, value.data(), value.size());
}

std::span<const std::uint8_t> StoredValues::stored(const SubObject& sub) const noexcept {
  const std::uint8_t* const at = data_.data() + sub.offset;
  if (!sub.variable_length()) return {at, sub.capacity};
  const auto length = load_le<std::uint32_t>(at);
  return {at + 4, length == no_value ? 0 : length};
}

std::span<const std::uint8_t> StoredValues::bytes(ObjectRef ref) const noexcept {
  const auto found = find(ref);
  return found ? stored(*found->sub) : std::span<const std::uint8_t>{};
}

AbortCode StoredValues::set_bytes(ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  const auto found = find(ref);
  if (!found) return found.error();
  const AbortCode code = check_length(*found->sub, value.size());
  if (code == AbortCode::none) put(*found->sub, value);
  return code;
}

AbortCode StoredValues::set_text(ObjectRef ref, std::string_view text) noexcept {
  return set_bytes(ref, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

std::string_view StoredValues::get_text(ObjectRef ref) const noexcept {
  const auto value = bytes(ref);
  return {reinterpret_cast<const char*>(value.data()), value.size()};
}

Answer<std::uint64_t> StoredValues::raw_for(ObjectRef ref, Class wanted, unsigned bits) const noexcept {
  const auto found = find(ref);
  if (!found) return refuse(found.error());
  const DataType type = found->sub->type;
  const unsigned length = bit_length(type);
  const bool fits = [&] {
    switch (wanted) {
      case Class::boolean: return type == DataType::boolean;
      case Class::real: return is_real(type) && length <= bits;
      case Class::unsigned_integer: return (is_unsigned(type) || is_time(type)) && length <= bits;
      case Class::signed_integer: return (is_signed(type) && length <= bits) || (is_unsigned(type) && length < bits);
    }
    return false;
  }();
  if (!fits) return refuse(AbortCode::length_mismatch);
  const std::uint64_t raw = load(type, data_.data() + found->sub->offset);
  return wanted == Class::real ? std::bit_cast<std::uint64_t>(real_of(type, raw)) : raw;
}

AbortCode StoredValues::set_integer(ObjectRef ref, std::uint64_t raw, bool negative) noexcept {
  const auto found = find(ref);
  if (!found) return found.error();
  const SubObject& sub = *found->sub;
  if (is_real(sub.type)) {
    return set_real(ref, negative ? static_cast<double>(static_cast<std::int64_t>(raw)) : static_cast<double>(raw));
  }
  if (sub.variable_length()) return AbortCode::length_mismatch;
  if (negative && !is_signed(sub.type)) return AbortCode::value_too_low;
  const bool same = wrap(sub.type, raw) == raw;
  // A positive value beyond INT64_MAX keeps its bits in INTEGER64, but not its meaning.
  const bool sign_kept = !is_signed(sub.type) || negative == ((raw >> 63U) != 0);
  if (!same || !sign_kept) return negative ? AbortCode::value_too_low : AbortCode::value_too_high;
  store(sub.type, raw, data_.data() + sub.offset);
  return AbortCode::none;
}

AbortCode StoredValues::set_real(ObjectRef ref, double value) noexcept {
  const auto found = find(ref);
  if (!found) return found.error();
  const SubObject& sub = *found->sub;
  if (!is_real(sub.type)) return AbortCode::length_mismatch;
  if (sub.type == DataType::real32 && std::isfinite(value) &&
      std::abs(value) > static_cast<double>(std::numeric_limits<float>::max())) {
    return value > 0 ? AbortCode::value_too_high : AbortCode::value_too_low;
  }
  store(sub.type, raw_of(sub.type, value), data_.data() + sub.offset);
  return AbortCode::none;
}

}  // namespace berth::od
