#include "berth/od/values.hpp"

#include <algorithm>
#include <utility>

namespace berth::od {

AbortCode Hook::reading(const Values&, ObjectRef, std::span<const std::uint8_t>&) noexcept { return AbortCode::none; }
AbortCode Hook::writing(const Values&, ObjectRef, std::span<const std::uint8_t>) noexcept { return AbortCode::none; }
void Hook::written(Values&, ObjectRef) noexcept {}
void Hook::abandoned(Values&, ObjectRef) noexcept {}
Hook::~Hook() {
  if (values_ != nullptr) values_->detach(*this);
}

Values::Values(std::shared_ptr<const Description> description, NodeId node_id)
    : StoredValues(std::move(description), node_id) {}

Values::~Values() {
  for (const Binding& each : bindings_) each.hook->values_ = nullptr;
  for (const StreamBinding& each : streams_) each.stream->values_ = nullptr;
}

Answer<std::span<const std::uint8_t>> Values::view(ObjectRef ref) const noexcept {
  const auto found = find(ref);
  if (!found) return refuse(found.error());
  const SubObject& sub = *found->sub;
  if (!readable(sub.access)) return refuse(AbortCode::write_only);
  if (hooked(*found->object)) return view_hooked(ref, sub);
  if (!sub.variable_length()) return scalar(sub);
  if (stream(ref) != nullptr) return refuse(AbortCode::unsupported_access);
  if (absent(sub)) return refuse(AbortCode::no_data);
  return stored(sub);
}

Answer<std::span<const std::uint8_t>> Values::view_hooked(ObjectRef ref, const SubObject& sub) const noexcept {
  if (stream(ref) != nullptr) return refuse(AbortCode::unsupported_access);
  std::span<const std::uint8_t> value = stored(sub);
  const std::uint8_t* const before = value.data();
  for (std::size_t i = 0; i < bindings_.size(); ++i) {
    const Binding each = bindings_[i];
    if (ref.index < each.first || ref.index > each.last) continue;
    const AbortCode code = each.hook->reading(*this, ref, value);
    if (code != AbortCode::none) return refuse(code);
  }
  if (absent(sub) && value.data() == before) return refuse(AbortCode::no_data);
  return value;
}

Answer<std::size_t> Values::size(ObjectRef ref) const noexcept {
  return view(ref).map([](std::span<const std::uint8_t> value) { return value.size(); });
}

Answer<std::size_t> Values::read(ObjectRef ref, std::span<std::uint8_t> into) const noexcept {
  if (Stream* const from = stream(ref)) {
    if (const AbortCode code = check_read(ref); code != AbortCode::none) return refuse(code);
    return read_whole(*from, ref, into);
  }
  const auto value = view(ref);
  if (!value) return refuse(value.error());
  if (value->size() > into.size()) return refuse(AbortCode::out_of_memory);
  std::ranges::copy(*value, into.begin());
  return value->size();
}

AbortCode Values::check_value(const SubObject& sub, std::span<const std::uint8_t> value) const noexcept {
  if (sub.type == DataType::boolean && value[0] > 1) return AbortCode::invalid_value;
  const Limits* const limits = description().limits(sub);
  if (limits == nullptr || sub.variable_length()) return AbortCode::none;
  const std::uint64_t raw = load(sub.type, value.data());
  const std::uint64_t low = limits->low.resolve(sub.type, node_id().value());
  const std::uint64_t high = limits->high.resolve(sub.type, node_id().value());
  const bool has_low = limits->low.present();
  const bool has_high = limits->high.present();
  if (has_low && has_high && compare(sub.type, high, low) < 0) return AbortCode::max_less_than_min;
  if (has_high) {
    const int order = compare(sub.type, raw, high);
    if (order == 2) return AbortCode::invalid_value;
    if (order > 0) return AbortCode::value_too_high;
  }
  if (has_low) {
    const int order = compare(sub.type, raw, low);
    if (order == 2) return AbortCode::invalid_value;
    if (order < 0) return AbortCode::value_too_low;
  }
  return AbortCode::none;
}

AbortCode Values::check_read(ObjectRef ref) const noexcept {
  const auto found = find(ref);
  if (!found) return found.error();
  return readable(found->sub->access) ? AbortCode::none : AbortCode::write_only;
}

AbortCode Values::check_write(ObjectRef ref) const noexcept {
  const auto found = find(ref);
  if (!found) return found.error();
  return writable(found->sub->access) ? AbortCode::none : AbortCode::read_only;
}

AbortCode Values::check_write(ObjectRef ref, std::size_t length) const noexcept {
  const auto found = find(ref);
  if (!found) return found.error();
  if (!writable(found->sub->access)) return AbortCode::read_only;
  return stream(ref) != nullptr ? AbortCode::none : check_length(*found->sub, length);
}

Answer<std::size_t> Values::length_of_unsized(ObjectRef ref, std::size_t available) const noexcept {
  const auto found = find(ref);
  if (!found) return refuse(found.error());
  const SubObject& sub = *found->sub;
  if (sub.variable_length()) return available;
  if (sub.capacity > available) return refuse(AbortCode::length_too_low);
  return sub.capacity;
}

AbortCode Values::write(ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  const auto found = find(ref);
  if (!found) return found.error();
  const SubObject& sub = *found->sub;
  if (!writable(sub.access)) return AbortCode::read_only;
  if (Stream* const to = stream(ref)) return write_whole(*to, ref, value);
  if (const AbortCode code = check_length(sub, value.size()); code != AbortCode::none) return code;
  if (const AbortCode code = check_value(sub, value); code != AbortCode::none) return code;
  if (!hooked(*found->object)) {
    put(sub, value);
    return AbortCode::none;
  }
  for (std::size_t i = 0; i < bindings_.size(); ++i) {
    const Binding each = bindings_[i];
    if (ref.index < each.first || ref.index > each.last) continue;
    const AbortCode code = each.hook->writing(*this, ref, value);
    if (code != AbortCode::none) return code;
  }
  put(sub, value);
  for (std::size_t i = 0; i < bindings_.size(); ++i) {
    const Binding each = bindings_[i];
    if (ref.index >= each.first && ref.index <= each.last) each.hook->written(*this, ref);
  }
  return AbortCode::none;
}

void Values::abandon(ObjectRef ref) noexcept {
  for (std::size_t i = 0; i < bindings_.size(); ++i) {
    const Binding each = bindings_[i];
    if (ref.index >= each.first && ref.index <= each.last) each.hook->abandoned(*this, ref);
  }
}

void Values::mark_hooked() noexcept {
  std::ranges::fill(hooked_, 0);
  const auto objects = description().objects();
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const std::uint16_t index = objects[i].index;
    const bool any = std::ranges::any_of(
        bindings_, [index](const Binding& each) { return index >= each.first && index <= each.last; });
    if (any) hooked_[i / 64] |= 1ULL << (i % 64);
  }
}

void Values::attach(Hook& hook, std::uint16_t first, std::uint16_t last) {
  if (hook.values_ != nullptr && hook.values_ != this) hook.values_->detach(hook);
  if (!bindings_.empty() && bindings_.back().hook == &hook && first == bindings_.back().last + 1) {
    bindings_.back().last = last;
  } else {
    bindings_.push_back({first, last, &hook});
  }
  hooked_.resize((description().objects().size() + 63) / 64);
  hook.values_ = this;
  mark_hooked();
}

void Values::detach(Hook& hook) noexcept {
  std::erase_if(bindings_, [&hook](const Binding& each) { return each.hook == &hook; });
  hook.values_ = nullptr;
  mark_hooked();
}

bool Values::attach(Stream& stream, ObjectRef ref) {
  const auto found = find(ref);
  if (!found || found->sub->type != DataType::domain) return false;
  if (stream.values_ != nullptr && stream.values_ != this) stream.values_->detach(stream);
  stream.values_ = this;
  const auto at = std::ranges::find(streams_, ref, &StreamBinding::ref);
  if (at == streams_.end()) {
    streams_.push_back({ref, &stream});
    return true;
  }
  Stream* const before = std::exchange(at->stream, &stream);
  const bool still_used = std::ranges::find(streams_, before, &StreamBinding::stream) != streams_.end();
  if (!still_used) before->values_ = nullptr;
  return true;
}

void Values::detach(Stream& stream) noexcept {
  std::erase_if(streams_, [&stream](const StreamBinding& each) { return each.stream == &stream; });
  stream.values_ = nullptr;
}

Stream* Values::find_stream(ObjectRef ref) const noexcept {
  const auto at = std::ranges::find(streams_, ref, &StreamBinding::ref);
  return at == streams_.end() ? nullptr : &at->stream->of(channels_.now());
}

AbortCode Values::write_whole(Stream& stream, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  StreamUse use;
  const AbortCode opened = use.open_write(stream, ref, value.size());
  // A stream that must wait before the first byte cannot be served in one call.
  if (opened == AbortCode::pending) return AbortCode::device_state;
  if (opened != AbortCode::none) return opened;
  if (!value.empty()) {
    const AbortCode code = use.write(value);  // these are all the bytes: nothing has to wait
    if (code != AbortCode::none && code != AbortCode::pending) return code;
  }
  return use.close(true);
}

Answer<std::size_t> Values::read_whole(Stream& stream, ObjectRef ref, std::span<std::uint8_t> into) noexcept {
  StreamUse use;
  const auto size = use.open_read(stream, ref);
  if (!size) return refuse(size.error());
  if (*size && **size > into.size()) return refuse(AbortCode::out_of_memory);
  if (use.ready() < into.size()) return refuse(AbortCode::device_state);  // the read would have to wait
  const auto count = use.read(into);
  if (!count) return refuse(count.error());
  if (*size && **size != *count) return refuse(AbortCode::device_state);
  std::uint8_t more = 0;
  if (!*size && *count == into.size()) {
    const auto rest = use.read({&more, 1});
    if (!rest) return refuse(rest.error());
    if (*rest != 0) return refuse(AbortCode::out_of_memory);
  }
  static_cast<void>(use.close(true));
  return *count;
}

std::size_t Values::memory() const noexcept {
  return sizeof *this + stored_memory() + bindings_.capacity() * sizeof(Binding) +
         streams_.capacity() * sizeof(StreamBinding) + hooked_.capacity() * sizeof(std::uint64_t);
}

}  // namespace berth::od
