#include "berth/od/pdo_objects.hpp"

#include <algorithm>
#include <array>
#include <limits>

namespace berth::od {
namespace {

constexpr std::array<std::uint8_t, 4> communication_subs{pdo_sub::cob_id, pdo_sub::type, pdo_sub::inhibit,
                                                         pdo_sub::timer};

template <class T>
void put(std::uint32_t value, T& into) noexcept {
  if (value <= std::numeric_limits<T>::max()) into = static_cast<T>(value);
}

}  // namespace

unsigned PdoParameters::bits() const noexcept {
  unsigned sum = 0;
  for (const auto& entry : entries) sum += entry.bits;
  return sum;
}

bool PdoParameters::maps(ObjectRef object) const noexcept {
  return std::ranges::find(entries, object, &PdoEntry::object) != entries.end();
}

std::optional<ObjectRef> PdoReader::next() const noexcept {
  if (step_ < mapping_step) return ObjectRef{communication_index(kind_, number_), communication_subs[step_]};
  const auto sub = static_cast<std::uint8_t>(step_ - mapping_step);
  if (sub > 0 && (parameters_.count > most_pdo_entries || sub > parameters_.count)) return {};
  return ObjectRef{mapping_index(kind_, number_), sub};
}

void PdoReader::give(std::optional<std::uint32_t> value) {
  const std::uint8_t step = step_;
  step_ = step == 0 && scope_ == Scope::layout ? mapping_step : static_cast<std::uint8_t>(step + 1);
  if (step > mapping_step) {
    parameters_.entries.push_back(PdoEntry::of(value.value_or(0)));
    return;
  }
  if (!value) return;
  switch (step) {
    case 0: parameters_.cob_id = CobId(*value); break;
    case 1: put(*value, parameters_.type); break;
    case 2: put(*value, parameters_.inhibit); break;
    case 3: put(*value, parameters_.timer); break;
    default: put(*value, parameters_.count); break;
  }
}

PdoParameters read_pdo(const StoredValues& values, PdoKind kind, unsigned number) {
  PdoReader reader(kind, number);
  while (const auto ref = reader.next()) {
    const auto value = values.get<std::uint32_t>(*ref);
    reader.give(value ? std::optional(*value) : std::nullopt);
  }
  return reader.parameters();
}

}  // namespace berth::od
