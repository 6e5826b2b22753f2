/// The segmented part of an SDO client's transfer, after its initiation: each request and the meaning of its answer
/// (CiA 301 §7.2.4.3.4, §7.2.4.3.6). No port and no clock.
#pragma once

#include "berth/co/sdo_client_data.hpp"

namespace berth::co {

class SdoSegments {
 public:
  /// The next thing to do.
  struct Step {
    enum class What : std::uint8_t {
      request,  ///< send the request, or make the next one
      wait,     ///< call `request` again when source or sink goes on
      done,     ///< all bytes are done
      refuse,   ///< abort with `code`; `text` says why
    };
    What what = What::request;
    AbortCode code = AbortCode::none;
    const char* text = nullptr;
  };

  void begin() noexcept { toggle_ = last_ = false; }
  /// Makes the next request; in a download, its segment then counts as done.
  [[nodiscard]] Step request(can::Frame& request, SdoClientData& data) noexcept;
  /// Takes the answer to it.
  [[nodiscard]] Step answered(const can::Frame& answer, SdoClientData& data) noexcept;
  /// Fast paths for segments of seven bytes that are not the last, as nearly all of a long value are. False: nothing
  /// happened, use `request` and `answered`.
  [[nodiscard]] bool quick_request(can::Frame& request, SdoClientData& data) noexcept;
  [[nodiscard]] bool quick_answered(const can::Frame& answer, SdoClientData& data) noexcept;

 private:
  [[nodiscard]] Step take(const can::Frame& answer, SdoClientData& data) const noexcept;
  [[nodiscard]] std::uint8_t toggle() const noexcept { return toggle_ ? sdo::toggle_bit : std::uint8_t{0}; }

  bool toggle_ = false;
  bool last_ = false;  // download: the current segment is the last
};

inline bool SdoSegments::quick_request(can::Frame& request, SdoClientData& data) noexcept {
  if (!data.is_download()) {
    sdo::put(request, static_cast<std::uint8_t>(0x60U | toggle()), {});
    return true;
  }
  const std::uint8_t* const bytes = data.quick_window();
  if (bytes == nullptr) return false;
  sdo::put_segment(request, toggle(), bytes);
  return true;
}

inline bool SdoSegments::quick_answered(const can::Frame& answer, SdoClientData& data) noexcept {
  const std::uint8_t command = answer.data[0];
  if (data.is_download()) {
    if ((command & 0xF0U) != (0x20U | toggle()) || last_) return false;
  } else if (command != toggle() || !data.quick_put(answer.data.data() + 1)) {
    return false;
  }
  toggle_ = !toggle_;
  return true;
}

}  // namespace berth::co
