#include "berth/od/description.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <iterator>
#include <map>

#include "berth/base/bytes.hpp"

namespace berth::od {
namespace {

// For values whose description gives no length; an EDS never gives one.
constexpr std::uint32_t usual_capacity = 64;
constexpr std::uint32_t roomy_string = 250;  // the longest that 1010h can store
constexpr std::uint32_t roomy_domain = 16U << 10U;
constexpr std::size_t most_room = 1U << 20U;
constexpr std::uint8_t structure_sub = 0xFF;  ///< sub-index FFh describes the structure (CiA 301 §7.4.5)

constexpr bool has_count(ObjectCode code) noexcept {
  return code == ObjectCode::array || code == ObjectCode::record || code == ObjectCode::defstruct;
}

}  // namespace

std::string_view name(ObjectCode code) noexcept {
  switch (code) {
    case ObjectCode::null: return "NULL";
    case ObjectCode::domain: return "DOMAIN";
    case ObjectCode::deftype: return "DEFTYPE";
    case ObjectCode::defstruct: return "DEFSTRUCT";
    case ObjectCode::var: return "VAR";
    case ObjectCode::array: return "ARRAY";
    case ObjectCode::record: return "RECORD";
  }
  return "unknown";
}

std::string_view name(Access access) noexcept {
  switch (access) {
    case Access::ro: return "ro";
    case Access::wo: return "wo";
    case Access::rw: return "rw";
    case Access::rwr: return "rwr";
    case Access::rww: return "rww";
    case Access::constant: return "const";
  }
  return "unknown";
}

// At most half full, so that every search ends, and ends soon.
void Description::index_objects() {
  const auto size = std::bit_ceil(std::max<std::size_t>(2, objects_.size() * 2));
  places_.assign(size, 0);
  place_mask_ = static_cast<std::uint32_t>(size - 1);
  place_shift_ = 32U - static_cast<std::uint32_t>(std::countr_zero(size));
  for (std::uint32_t i = 0; i < objects_.size(); ++i) {
    auto at = place_of(objects_[i].index);
    while (places_[at & place_mask_] != 0) ++at;
    places_[at & place_mask_] = i + 1;
  }
}

// For objects with gaps among their sub-indices.
const SubObject* Description::search(const Object& object, std::uint8_t sub) const noexcept {
  const auto all = subs(object);
  const auto found = std::ranges::lower_bound(all, sub, {}, &SubObject::sub);
  return found != all.end() && found->sub == sub ? &*found : nullptr;
}

const SubObject* Description::find(ObjectRef ref) const noexcept {
  const Object* const object = find(ref.index);
  return object == nullptr ? nullptr : find(*object, ref.sub);
}

std::string_view Description::name(const Object& object) const noexcept {
  return text(object.name_at, object.name_length);
}

std::string_view Description::name(const SubObject& sub) const noexcept { return text(sub.name_at, sub.name_length); }

Literal Description::default_of(const SubObject& sub) const {
  if (!sub.has_default) return {};
  if (sub.relative) return Literal::node_id_plus(relatives_[sub.default_at].offset);
  const std::uint8_t* const at = image_.data() + sub.offset;
  if (!sub.variable_length()) return Literal::number(load(sub.type, at));
  return Literal::octets({at + 4, load_le<std::uint32_t>(at)});
}

const Meaning* Description::meaning(ObjectRef ref) const noexcept {
  const auto found = std::ranges::lower_bound(meanings_, ref, {}, &std::pair<ObjectRef, Meaning>::first);
  return found == meanings_.end() || found->first != ref ? nullptr : &found->second;
}

std::size_t Description::memory() const noexcept {
  std::size_t meant = meanings_.capacity() * sizeof(meanings_[0]);
  for (const auto& [ref, meaning] : meanings_) {
    meant += meaning.unit.capacity() + meaning.values.capacity() * sizeof(NamedValue);
    for (const auto& value : meaning.values) meant += value.name.capacity();
  }
  return sizeof *this + places_.capacity() * sizeof(places_[0]) + objects_.capacity() * sizeof(Object) +
         subs_.capacity() * sizeof(SubObject) + limits_.capacity() * sizeof(Limits) +
         relatives_.capacity() * sizeof(Relative) + image_.capacity() + names_.capacity() + meant;
}

// ---------------------------------------------------------------------------------------------------------------------

/// Small and trivial: a big description has tens of thousands of these. `sub.limits_at` is a position in
/// `State::limits` + 1.
struct PendingSub {
  std::uint16_t index = 0;
  Literal::Kind kind = Literal::Kind::none;
  std::uint32_t bytes_at = 0;  ///< kind bytes: position in `State::bytes`
  std::uint64_t raw = 0;       ///< default value; kind bytes: their number
  SubObject sub;
  [[nodiscard]] std::uint32_t key() const noexcept { return (static_cast<std::uint32_t>(index) << 8U) | sub.sub; }
};

struct PendingObject {
  Object object;
  std::array<std::uint64_t, 4> subs{};  ///< bit n = sub-index n is there
};

struct DescriptionBuilder::State {
  std::vector<PendingObject> objects;
  std::vector<PendingSub> subs;
  std::vector<Limits> limits;
  std::vector<std::uint8_t> bytes;  ///< of defaults of variable length
  /// Position in `objects` + 1 by index, in pages of 256. A page is made when the first of its indices comes.
  using Page = std::array<std::uint32_t, 256>;
  std::array<std::unique_ptr<Page>, 256> pages;
  std::string names;
  std::map<ObjectRef, Meaning> meanings;
  std::uint32_t dummies = 0;
  std::size_t room = 0;  ///< beyond the usual

  std::uint32_t room_for(const SubSpec& spec);
  std::uint32_t add_name(std::string_view name) {
    const auto where = static_cast<std::uint32_t>(names.size());
    names.append(name.substr(0, 0xFFFF));
    return where;
  }
  PendingObject* find(std::uint16_t index) {
    const Page* const page = pages[index >> 8U].get();
    const std::uint32_t at = page == nullptr ? 0 : (*page)[index & 0xFFU];
    return at == 0 ? nullptr : &objects[at - 1];
  }
  PendingObject& place(std::uint16_t index) {
    if (PendingObject* const found = find(index)) return *found;
    objects.emplace_back().object.index = index;
    auto& page = pages[index >> 8U];
    if (page == nullptr) page = std::make_unique<Page>();
    (*page)[index & 0xFFU] = static_cast<std::uint32_t>(objects.size());
    return objects.back();
  }
  void set_name(Object& object, std::string_view name) {
    object.name_at = add_name(name);
    object.name_length = static_cast<std::uint16_t>(std::min<std::size_t>(name.size(), 0xFFFF));
  }
  /// The newest definition; nullptr if there is none.
  PendingSub* find(ObjectRef ref) {
    const std::uint32_t key = (static_cast<std::uint32_t>(ref.index) << 8U) | ref.sub;
    const auto found = std::find_if(subs.rbegin(), subs.rend(), [key](const auto& each) { return each.key() == key; });
    return found == subs.rend() ? nullptr : &*found;
  }
  void set_initial(PendingSub& pending, const Literal& value);
  [[nodiscard]] std::span<const std::uint8_t> bytes_of(const PendingSub& pending) const {
    return pending.kind == Literal::Kind::bytes ? std::span(bytes).subspan(pending.bytes_at, pending.raw)
                                                : std::span<const std::uint8_t>();
  }
  void add_sub(PendingObject& parent, const SubSpec& spec);
  void add_counts();
  void sort_subs();
};

std::uint32_t DescriptionBuilder::State::room_for(const SubSpec& spec) {
  const std::uint32_t wanted = spec.type == DataType::domain ? roomy_domain : roomy_string;
  if (!writable(spec.access) || room + wanted > most_room) return usual_capacity;
  room += wanted;
  return wanted;
}

void DescriptionBuilder::State::add_sub(PendingObject& parent, const SubSpec& spec) {
  parent.subs[spec.sub / 64] |= 1ULL << (spec.sub % 64);
  PendingSub pending;
  pending.index = parent.object.index;
  SubObject& sub = pending.sub;
  if (spec.low.present() || spec.high.present()) {
    limits.push_back({spec.low, spec.high});
    sub.limits_at = static_cast<std::uint32_t>(limits.size());
  }
  sub.name_at = add_name(spec.name);
  sub.name_length = static_cast<std::uint16_t>(std::min<std::size_t>(spec.name.size(), 0xFFFF));
  sub.type = spec.type;
  sub.sub = spec.sub;
  sub.access = spec.access;
  sub.obj_flags = spec.obj_flags;
  sub.mappable = spec.mappable;
  const std::size_t fixed = byte_size(spec.type);
  sub.fixed = fixed != 0;
  sub.bounded = fixed != 0 || spec.capacity != 0;
  sub.capacity = fixed != 0 ? static_cast<std::uint32_t>(fixed) : sub.bounded ? spec.capacity : room_for(spec);
  set_initial(pending, spec.initial);
  subs.push_back(pending);
}

void DescriptionBuilder::State::set_initial(PendingSub& pending, const Literal& value) {
  pending.kind = value.kind;
  pending.raw = value.raw;
  if (value.kind == Literal::Kind::bytes) {
    pending.bytes_at = static_cast<std::uint32_t>(bytes.size());
    pending.raw = value.bytes.size();
    bytes.insert(bytes.end(), value.bytes.begin(), value.bytes.end());
  }
  SubObject& sub = pending.sub;
  sub.has_default = value.present();
  sub.relative = value.kind == Literal::Kind::node_id_plus;
  if (sub.variable_length()) sub.capacity = std::max(sub.capacity, static_cast<std::uint32_t>(value.bytes.size()));
}

void DescriptionBuilder::State::add_counts() {
  for (auto& each : objects) {
    if (!has_count(each.object.code) || (each.subs[0] & 1U) != 0) continue;
    add_sub(each,
            {.sub = 0, .name = "Highest sub-index supported", .type = DataType::unsigned8, .access = Access::constant});
  }
}

void DescriptionBuilder::State::sort_subs() {
  // Readers add in ascending order: then nothing has to move.
  if (std::ranges::is_sorted(subs, std::ranges::less_equal{}, &PendingSub::key)) return;
  std::ranges::stable_sort(subs, {}, &PendingSub::key);
  // Of several definitions the last one counts. After the reversal it is the first of its group.
  std::ranges::reverse(subs);
  const auto rest = std::ranges::unique(subs, {}, &PendingSub::key);
  subs.erase(rest.begin(), rest.end());
  std::ranges::reverse(subs);
}

DescriptionBuilder::DescriptionBuilder() : state_(std::make_unique<State>()) {}
DescriptionBuilder::~DescriptionBuilder() = default;

DescriptionBuilder& DescriptionBuilder::variable(std::uint16_t index, const SubSpec& spec) {
  const auto code = spec.type == DataType::domain ? ObjectCode::domain : ObjectCode::var;
  object(index, code, spec.name, spec.type, spec.obj_flags);
  SubSpec only = spec;
  only.sub = 0;
  return sub(index, only);
}

DescriptionBuilder& DescriptionBuilder::object(std::uint16_t index, ObjectCode code, std::string_view name,
                                               DataType type, std::uint8_t obj_flags) {
  Object& object = state_->place(index).object;
  object.code = code;
  object.type = type;
  object.obj_flags = obj_flags;
  state_->set_name(object, name);
  return *this;
}

DescriptionBuilder& DescriptionBuilder::sub(std::uint16_t index, const SubSpec& spec) {
  const bool fresh = state_->find(index) == nullptr;
  PendingObject& parent = state_->place(index);
  if (fresh) parent.object.code = ObjectCode::record;
  state_->add_sub(parent, spec);
  return *this;
}

DescriptionBuilder& DescriptionBuilder::meaning(ObjectRef ref, Meaning meaning) {
  std::ranges::sort(meaning.values, {}, &NamedValue::raw);
  state_->meanings.insert_or_assign(ref, std::move(meaning));
  return *this;
}

DescriptionBuilder& DescriptionBuilder::dummies(std::uint32_t mask) {
  state_->dummies = mask;
  return *this;
}

bool DescriptionBuilder::has(std::uint16_t index) const noexcept { return state_->find(index) != nullptr; }

bool DescriptionBuilder::has(ObjectRef ref) const noexcept {
  const PendingObject* const object = state_->find(ref.index);
  return object != nullptr && ((object->subs[ref.sub / 64] >> (ref.sub % 64)) & 1U) != 0;
}

std::optional<SubSpec> DescriptionBuilder::spec_of(ObjectRef ref) const {
  const PendingSub* const found = has(ref) ? state_->find(ref) : nullptr;
  if (found == nullptr) return std::nullopt;
  const bool limited = found->sub.limits_at != 0;
  const Limits limits = limited ? state_->limits[found->sub.limits_at - 1] : Limits{};
  const auto bytes = state_->bytes_of(*found);
  const bool number = found->kind != Literal::Kind::bytes;
  return SubSpec{.sub = ref.sub,
                 .type = found->sub.type,
                 .access = found->sub.access,
                 .mappable = found->sub.mappable,
                 .initial = {found->kind, number ? found->raw : 0, {bytes.begin(), bytes.end()}},
                 .low = limits.low,
                 .high = limits.high,
                 .obj_flags = found->sub.obj_flags,
                 .capacity = found->sub.described_length()};
}

DescriptionBuilder& DescriptionBuilder::initial(ObjectRef ref, const Literal& value) {
  if (!has(ref)) return *this;
  state_->set_initial(*state_->find(ref), value);
  return *this;
}

namespace {

std::uint8_t highest_sub(std::span<const SubObject> subs) noexcept {
  std::uint8_t highest = 0;
  for (const auto& each : subs) {
    if (each.sub != structure_sub) highest = each.sub;
  }
  return highest;
}

/// `raw`: a scalar for node-ID 0; `bytes`: a value of variable length.
void put_default(std::vector<std::uint8_t>& image, const SubObject& sub, std::uint64_t raw,
                 std::span<const std::uint8_t> bytes) {
  std::uint8_t* const at = image.data() + sub.offset;
  if (!sub.variable_length()) {
    store(sub.type, raw, at);
    return;
  }
  const bool absent = !sub.has_default && sub.type == DataType::domain;
  store_le(at, absent ? no_value : static_cast<std::uint32_t>(bytes.size()));
  std::ranges::copy(bytes, at + 4);
}

}  // namespace

std::shared_ptr<const Description> DescriptionBuilder::build() {
  State& state = *state_;
  state.add_counts();
  state.sort_subs();
  std::ranges::sort(state.objects, {}, [](const PendingObject& each) { return each.object.index; });

  const auto made = std::make_shared<Description>();
  made->dummies_ = state.dummies;
  made->names_ = std::move(state.names);
  made->objects_.reserve(state.objects.size());
  made->subs_.reserve(state.subs.size());
  auto next = state.subs.begin();
  std::uint32_t offset = 0;
  for (const auto& pending : state.objects) {
    Object object = pending.object;
    object.first = static_cast<std::uint32_t>(made->subs_.size());
    for (; next != state.subs.end() && next->index == object.index; ++next) {
      SubObject sub = next->sub;
      sub.offset = offset;
      offset += sub.capacity + (sub.variable_length() ? 4U : 0U);
      if (sub.relative) {
        sub.default_at = static_cast<std::uint32_t>(made->relatives_.size());
        made->relatives_.push_back({static_cast<std::uint32_t>(made->subs_.size()), next->raw});
      }
      if (sub.limits_at != 0) {
        made->limits_.push_back(std::move(state.limits[sub.limits_at - 1]));
        sub.limits_at = static_cast<std::uint32_t>(made->limits_.size());
      }
      made->subs_.push_back(sub);
    }
    object.count = static_cast<std::uint16_t>(made->subs_.size() - object.first);
    made->objects_.push_back(object);
  }
  made->meanings_.assign(std::make_move_iterator(state.meanings.begin()),
                         std::make_move_iterator(state.meanings.end()));
  made->names_.shrink_to_fit();
  made->limits_.shrink_to_fit();
  made->relatives_.shrink_to_fit();
  made->index_objects();
  made->image_.resize(offset);
  for (std::size_t i = 0; i < state.subs.size(); ++i) {
    const PendingSub& pending = state.subs[i];
    const std::uint64_t raw = pending.kind == Literal::Kind::bytes ? 0 : pending.raw;
    put_default(made->image_, made->subs_[i], raw, state.bytes_of(pending));
  }
  for (const Object& object : made->objects_) {
    const auto subs = made->subs(object);
    if (!has_count(object.code) || subs.empty()) continue;
    const SubObject& count = subs.front();
    const bool counts = is_integer(count.type) && count.type != DataType::boolean;
    if (count.has_default || writable(count.access) || !counts) continue;
    store(count.type, highest_sub(subs), made->image_.data() + count.offset);
  }
  state_ = std::make_unique<State>();
  return made;
}

}  // namespace berth::od
