/// The segmented part of an SDO client's transfer, once it is initiated: each request and what its answer means
/// (CiA 301 §7.2.4.3.4, §7.2.4.3.6). No port and no clock.
#pragma once

#include "berth/co/sdo_client_data.hpp"

namespace berth::co {

class SdoSegments {
 public:
  /// What is to be done next.
  struct Step {
    enum class What : std::uint8_t {
      request,  ///< the request is to be sent, or the next one made
      wait,     ///< `request` once more when source or sink goes on
      done,     ///< all bytes are over
      refuse,   ///< abort with `code`; `text` says why
    };
    What what = What::request;
    AbortCode code = AbortCode::none;
    const char* text = nullptr;
  };

  void begin() noexcept { toggle_ = last_ = false; }
  /// The next request: of a download with the next segment, which counts as done then.
  [[nodiscard]] Step request(can::Frame& request, SdoClientData& data) noexcept;
  /// The answer to it.
  [[nodiscard]] Step answered(const can::Frame& answer, SdoClientData& data) noexcept;

 private:
  [[nodiscard]] Step take(const can::Frame& answer, SdoClientData& data) const noexcept;

  bool toggle_ = false;
  bool last_ = false;  // download: the segment on its way is
};

}  // namespace berth::co
