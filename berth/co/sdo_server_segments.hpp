/// The segmented part of an SDO server's transfer (CiA 301 §7.2.4.3.4, §7.2.4.3.6): each segment and its answer.
#pragma once

#include "berth/co/sdo_server_data.hpp"

namespace berth::co {

class SdoServerSegments {
 public:
  void begin() noexcept { toggle_ = false; }
  /// Takes a segment of a download; `answer` confirms it. `pending`: the stream, or with the last segment the
  /// dictionary, decides later.
  [[nodiscard]] AbortCode download(const can::Frame& request, can::Frame& answer, SdoServerData& data) noexcept;
  /// Answers with the requested segment. `pending`: the stream does not have it yet; repeat the request when it has.
  [[nodiscard]] AbortCode upload(const can::Frame& request, can::Frame& answer, SdoServerData& data) noexcept;

  /// Fast paths, each way, for a segment of seven bytes that is not the last. False: nothing happened, use `download`
  /// and `upload`.
  [[nodiscard]] bool quick_download(const can::Frame& request, can::Frame& answer, SdoServerData& data) noexcept {
    const std::uint8_t byte = request.data[0];
    if (byte != toggle()) return false;
    std::uint8_t* const place = data.quick_place();
    if (place == nullptr) return false;
    toggle_ = !toggle_;
    std::memcpy(place, request.data.data() + 1, sdo::segment_bytes);
    sdo::put(answer, static_cast<std::uint8_t>(0x20U | byte), {});
    return true;
  }
  [[nodiscard]] bool quick_upload(const can::Frame& request, can::Frame& answer, SdoServerData& data) noexcept {
    if ((request.data[0] & sdo::toggle_bit) != toggle()) return false;
    const std::uint8_t* const bytes = data.quick_read();
    if (bytes == nullptr) return false;
    sdo::put_segment(answer, toggle(), bytes);
    toggle_ = !toggle_;
    return true;
  }

 private:
  [[nodiscard]] std::uint8_t toggle() const noexcept { return toggle_ ? sdo::toggle_bit : std::uint8_t{0}; }
  [[nodiscard]] bool toggled(const can::Frame& request) noexcept;

  bool toggle_ = false;  // expected in the next segment
};

}  // namespace berth::co
