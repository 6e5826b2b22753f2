/// Compares the object lists of a file ([MandatoryObjects], [OptionalObjects], [ManufacturerObjects]) with the objects
/// that it describes. Internal to room `eds`.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "berth/eds/keys.hpp"

namespace berth::eds {

class ObjectLists {
 public:
  explicit ObjectLists(Context& context) noexcept : context_(context) {}
  void read(bool any_object);
  /// An object that the file describes.
  void described(const ObjectGroup& group);
  /// Reports each object that is listed but not described.
  void missing_sections();

 private:
  /// One bit for each index.
  using Indices = std::array<std::uint64_t, 0x10000 / 64>;
  static std::uint64_t bit(std::uint64_t index) noexcept { return 1ULL << (index % 64); }
  struct Listed {
    const Section* section;
    const Entry* entry;
    std::uint16_t index;
  };
  void read_list(const Section& section, std::uint16_t first, std::uint16_t last);

  Context& context_;
  std::unique_ptr<Indices> listed_ = std::make_unique<Indices>();
  std::unique_ptr<Indices> described_ = std::make_unique<Indices>();
  std::vector<Listed> lists_;  // the listed objects, in the order of the file
  bool any_list_ = false;
};

}  // namespace berth::eds
