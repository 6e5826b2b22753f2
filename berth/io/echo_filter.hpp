/// The keys that the kernel's filter of a SocketCAN port passes: those of the listener, and the echoes of frames sent
/// with a tag. Internal to room `io`.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "berth/can/ranges.hpp"

namespace berth::io {

class EchoFilter {
 public:
  static constexpr std::size_t most_echoed = 256;      ///< identifiers sent with a tag; beyond that every echo is read
  static constexpr std::uint32_t much_unwanted = 256;  ///< unwanted frames that passed; then the filter is narrowed

  /// A frame with this key is sent, and its echo is wanted. True: call `install` next.
  [[nodiscard]] bool expect(std::uint32_t key) {
    if (passes(key)) return false;
    if (echoed_.size() >= most_echoed) {
      echoed_ = {can::all_base, can::all_extended};
    } else {
      echoed_.push_back(can::only(key));
    }
    return true;
  }
  /// Sets the filter: `accept`, and the echoes. Sorted, without overlaps.
  [[nodiscard]] const std::vector<can::IdRange>& install(std::span<const can::IdRange> accept) {
    auto all = echoed_;
    all.insert(all.end(), accept.begin(), accept.end());
    installed_ = can::normalised(all);
    unwanted_ = 0;
    return installed_;
  }
  /// True if everything in `accept` passes already.
  [[nodiscard]] bool covers(std::span<const can::IdRange> accept) const { return can::covers(installed_, accept); }
  [[nodiscard]] bool passes(std::uint32_t key) const { return can::contains(installed_, key); }
  /// A frame with this key passed. True: many unwanted frames passed; call `install` next.
  [[nodiscard]] bool much(std::uint32_t key, std::span<const can::IdRange> accept) {
    return !can::contains(accept, key) && ++unwanted_ >= much_unwanted;
  }

 private:
  std::vector<can::IdRange> echoed_;     // keys that are or were sent with a tag
  std::vector<can::IdRange> installed_;  // keys that pass
  std::uint32_t unwanted_ = 0;
};

}  // namespace berth::io
