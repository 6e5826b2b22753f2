#include "berth/process/process.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "berth/process/shared_image.hpp"

using berth::od::DataType;
using berth::process::Direction;
namespace od = berth::od;

struct berth_process {
  std::unique_ptr<berth::process::SharedApplication> shared;
};

namespace {

/// The place of the variable's value. Null: it belongs to another image.
const std::uint8_t* place(const berth_process* image, const berth_variable* variable) noexcept {
  auto& side = image->shared->side();
  const bool input = variable->direction == BERTH_INPUT;
  const std::span<const std::uint8_t> part = input ? side.inputs() : side.outputs();
  const auto size = od::byte_size(static_cast<DataType>(variable->type));
  return size == 0 || size > part.size() || variable->offset > part.size() - size ? nullptr
                                                                                  : part.data() + variable->offset;
}

std::uint8_t* input_place(const berth_process* image, const berth_variable* variable) noexcept {
  if (variable->direction != BERTH_INPUT || place(image, variable) == nullptr) return nullptr;
  return image->shared->side().inputs().data() + variable->offset;
}

/// The value of an integer type. Empty: the type cannot hold it.
std::optional<std::uint64_t> whole_of(DataType type, std::int64_t value) noexcept {
  if (type == DataType::boolean && value != 0 && value != 1) return std::nullopt;
  if (!od::is_signed(type) && value < 0) return std::nullopt;
  const auto raw = static_cast<std::uint64_t>(value);
  if (od::wrap(type, raw) != raw) return std::nullopt;
  return raw;
}

/// The same for a number that is rounded. UNSIGNED64 holds more than std::int64_t.
std::optional<std::uint64_t> nearest_of(DataType type, double value) noexcept {
  const double whole = std::nearbyint(value);
  constexpr double signed_end = 9223372036854775808.0;
  constexpr double unsigned_end = 18446744073709551616.0;
  if (whole >= -signed_end && whole < signed_end) return whole_of(type, static_cast<std::int64_t>(whole));
  if (type == DataType::unsigned64 && whole >= signed_end && whole < unsigned_end) {
    return static_cast<std::uint64_t>(whole);
  }
  return std::nullopt;
}

void fill(const berth::process::Variable& from, berth_variable& to) noexcept {
  to = {from.name.c_str(),
        from.offset,
        from.number,
        static_cast<std::uint16_t>(from.type),
        static_cast<std::uint8_t>(od::byte_size(from.type)),
        static_cast<std::uint8_t>(from.direction == Direction::input ? BERTH_INPUT : BERTH_OUTPUT)};
}

}  // namespace

extern "C" {

berth_process* berth_process_open(const char* name, char* why, size_t why_size) {
  auto opened = berth::process::SharedApplication::open(name == nullptr ? "" : name);
  if (opened) return new berth_process{std::move(*opened)};
  if (why != nullptr && why_size > 0) std::snprintf(why, why_size, "%s", opened.error().c_str());
  return nullptr;
}

void berth_process_close(berth_process* image) { delete image; }

int berth_process_connected(const berth_process* image) { return image->shared->connected() ? 1 : 0; }

size_t berth_process_count(const berth_process* image) { return image->shared->layout().variables().size(); }

int berth_process_at(const berth_process* image, size_t at, berth_variable* variable) {
  const auto variables = image->shared->layout().variables();
  if (at >= variables.size()) return 0;
  fill(variables[at], *variable);
  return 1;
}

int berth_process_find(const berth_process* image, const char* name, berth_variable* variable) {
  const auto* const found = name == nullptr ? nullptr : image->shared->layout().find(name);
  if (found == nullptr) return 0;
  fill(*found, *variable);
  return 1;
}

int berth_process_refresh(berth_process* image) { return image->shared->side().refresh() ? 1 : 0; }

int64_t berth_process_integer(const berth_process* image, const berth_variable* variable) {
  const auto* const from = place(image, variable);
  if (from == nullptr) return 0;
  const auto type = static_cast<DataType>(variable->type);
  const auto raw = od::load(type, from);
  if (!od::is_real(type)) return static_cast<std::int64_t>(raw);
  const double value = od::real_of(type, raw);
  constexpr double end = 9223372036854775808.0;
  if (std::isnan(value)) return 0;
  if (value >= end) return INT64_MAX;
  return value < -end ? INT64_MIN : static_cast<std::int64_t>(value);
}

double berth_process_real(const berth_process* image, const berth_variable* variable) {
  const auto* const from = place(image, variable);
  if (from == nullptr) return 0;
  const auto type = static_cast<DataType>(variable->type);
  const auto raw = od::load(type, from);
  if (od::is_real(type)) return od::real_of(type, raw);
  return od::is_signed(type) ? static_cast<double>(static_cast<std::int64_t>(raw)) : static_cast<double>(raw);
}

berth_validity berth_process_validity(const berth_process* image, const berth_variable* variable) {
  if (variable->direction != BERTH_OUTPUT) return BERTH_WAITING;
  return image->shared->side().validity_of(variable->number);
}

int64_t berth_process_age_ns(const berth_process* image, const berth_variable* variable) {
  if (variable->direction != BERTH_OUTPUT) return -1;
  const auto age = image->shared->age_now(variable->number);
  return age ? std::max<std::int64_t>(age->count(), 0) : -1;
}

const berth_diagnosis* berth_process_diagnosis(const berth_process* image) {
  return &image->shared->side().diagnosis();
}

int berth_process_set_integer(berth_process* image, const berth_variable* variable, int64_t value) {
  auto* const to = input_place(image, variable);
  if (to == nullptr) return 0;
  const auto type = static_cast<DataType>(variable->type);
  if (od::is_real(type)) return berth_process_set_real(image, variable, static_cast<double>(value));
  const auto raw = whole_of(type, value);
  if (raw) od::store(type, *raw, to);
  return raw ? 1 : 0;
}

int berth_process_set_real(berth_process* image, const berth_variable* variable, double value) {
  auto* const to = input_place(image, variable);
  if (to == nullptr) return 0;
  const auto type = static_cast<DataType>(variable->type);
  const auto raw = od::is_real(type) ? std::optional(od::raw_of(type, value)) : nearest_of(type, value);
  if (raw) od::store(type, *raw, to);
  return raw ? 1 : 0;
}

void berth_process_set_error(berth_process* image, uint16_t code, uint8_t error_register) {
  image->shared->side().set_error(code, error_register);
}

void berth_process_commit(berth_process* image) { image->shared->side().commit(); }

const uint8_t* berth_process_outputs(const berth_process* image, size_t* size) {
  const auto part = image->shared->side().outputs();
  if (size != nullptr) *size = part.size();
  return part.data();
}

uint8_t* berth_process_inputs(berth_process* image, size_t* size) {
  const auto part = image->shared->side().inputs();
  if (size != nullptr) *size = part.size();
  return part.data();
}

}  // extern "C"
