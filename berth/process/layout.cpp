#include "berth/process/layout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

static_assert(std::endian::native == std::endian::little, "an image is little-endian, as CANopen is");

namespace berth::process {

bool Layout::refuse(std::string why) {
  problems_.push_back(std::move(why));
  return false;
}

void Layout::refuse_type(std::string_view name, od::DataType type) {
  refuse(fmt::format("\"{}\": its C++ type does not hold {}; take one that does", name, od::name(type)));
}

const Variable* Layout::find(std::string_view name) const noexcept {
  const auto it = by_name_.find(name);
  return it == by_name_.end() ? nullptr : &variables_[it->second];
}

bool Layout::declare(std::string_view name, od::DataType type, Direction direction) {
  const auto unit = std::max<std::size_t>(std::bit_ceil(od::byte_size(type)), 1);
  const auto offset = (size(direction) + unit - 1) / unit * unit;
  return declare_at(name, type, direction, static_cast<std::uint32_t>(offset));
}

bool Layout::declare_at(std::string_view name, od::DataType type, Direction direction, std::uint32_t offset) {
  const auto bytes = static_cast<std::uint32_t>(od::byte_size(type));
  if (name.empty()) return refuse("a variable has no name; give it one");
  if (name.size() > longest_name) {
    return refuse(fmt::format("\"{}…\": a name has {} bytes at most", name.substr(0, 20), longest_name));
  }
  if (bytes == 0) return refuse(fmt::format("\"{}\": a variable of the image is a number or BOOLEAN", name));
  if (find(name) != nullptr) return refuse(fmt::format("\"{}\" is declared already; declare it once", name));
  if (offset > largest_part - bytes) return refuse(fmt::format("\"{}\": offset {} is beyond 1 MiB", name, offset));
  auto& taken = by_offset_[place(direction)];
  auto near = taken.lower_bound(offset + bytes);
  if (near != taken.begin()) {
    const auto& before = variables_[std::prev(near)->second];
    if (before.offset + od::byte_size(before.type) > offset) {
      return refuse(
          fmt::format("\"{}\" at offset {} has bytes of \"{}\" at {}", name, offset, before.name, before.offset));
    }
  }
  const auto at = variables_.size();
  taken.emplace(offset, at);
  by_name_.emplace(name, at);
  variables_.push_back({std::string(name), type, direction, offset, counts_[place(direction)]++});
  auto& end = sizes_[place(direction)];
  end = std::max(end, offset + bytes);
  return true;
}

}  // namespace berth::process
