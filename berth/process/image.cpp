#include "berth/process/image.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

static_assert(std::endian::native == std::endian::little, "an image is little-endian, as CANopen is");

namespace berth::process {

bool Layout::refuse(std::string why) {
  problems_.push_back(std::move(why));
  return false;
}

const Variable* Layout::find(std::string_view name) const noexcept {
  const auto it = std::ranges::find(variables_, name, &Variable::name);
  return it == variables_.end() ? nullptr : &*it;
}

std::size_t Layout::size(Direction direction) const noexcept {
  std::size_t end = 0;
  for (const auto& v : variables_) {
    if (v.direction == direction) end = std::max(end, v.offset + od::byte_size(v.type));
  }
  return end;
}

bool Layout::declare(std::string_view name, od::DataType type, Direction direction) {
  const auto unit = std::max<std::size_t>(std::bit_ceil(od::byte_size(type)), 1);
  const auto offset = (size(direction) + unit - 1) / unit * unit;
  return declare_at(name, type, direction, static_cast<std::uint32_t>(offset));
}

bool Layout::declare_at(std::string_view name, od::DataType type, Direction direction, std::uint32_t offset) {
  const auto bytes = od::byte_size(type);
  if (name.empty()) return refuse("a variable has no name; give it one");
  if (bytes == 0) return refuse(fmt::format("\"{}\": a variable of the image is a number or BOOLEAN", name));
  if (find(name) != nullptr) return refuse(fmt::format("\"{}\" is declared already; declare it once", name));
  if (offset > largest_part - bytes) return refuse(fmt::format("\"{}\": offset {} is beyond 1 MiB", name, offset));
  for (const auto& v : variables_) {
    if (v.direction != direction || v.offset >= offset + bytes || offset >= v.offset + od::byte_size(v.type)) continue;
    return refuse(fmt::format("\"{}\" at offset {} has bytes of \"{}\" at {}", name, offset, v.name, v.offset));
  }
  variables_.push_back({std::string(name), type, direction, offset});
  return true;
}

}  // namespace berth::process
