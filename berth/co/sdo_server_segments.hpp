/// The segmented part of an SDO server's transfer (CiA 301 §7.2.4.3.4, §7.2.4.3.6): each segment and its answer.
#pragma once

#include "berth/co/sdo_server_data.hpp"

namespace berth::co {

class SdoServerSegments {
 public:
  void begin() noexcept { toggle_ = false; }
  /// A segment of a download, to be confirmed by `answer`. `pending`: the stream, or with the last segment the
  /// dictionary, says later whether.
  [[nodiscard]] AbortCode download(const can::Frame& request, can::Frame& answer, SdoServerData& data) noexcept;
  /// The segment that is asked for. `pending`: the stream does not have it yet, and the request is to be repeated then.
  [[nodiscard]] AbortCode upload(const can::Frame& request, can::Frame& answer, SdoServerData& data) noexcept;

 private:
  [[nodiscard]] bool toggled(const can::Frame& request) noexcept;

  bool toggle_ = false;  // expected in the next segment
};

}  // namespace berth::co
