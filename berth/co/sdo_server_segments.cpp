#include "berth/co/sdo_server_segments.hpp"

namespace berth::co {

bool SdoServerSegments::toggled(const can::Frame& request) noexcept {
  if (((request.data[0] & sdo::toggle_bit) != 0) != toggle_) return false;
  toggle_ = !toggle_;
  return true;
}

AbortCode SdoServerSegments::download(const can::Frame& request, can::Frame& answer, SdoServerData& data) noexcept {
  if (!toggled(request)) return AbortCode::toggle_bit;
  const auto byte = request.data[0];
  sdo::put(answer, static_cast<std::uint8_t>(0x20U | (byte & sdo::toggle_bit)), {});
  const auto place = data.place(sdo::segment_bytes);
  if (!place) return place.error();
  std::memcpy(*place, request.data.data() + 1, sdo::segment_bytes);
  const auto code = data.commit(sdo::segment_bytes - ((byte >> 1U) & 0x07U));
  if (code != AbortCode::none) return code;
  return (byte & 0x01U) != 0 ? data.close_write() : data.ready();
}

AbortCode SdoServerSegments::upload(const can::Frame& request, can::Frame& answer, SdoServerData& data) noexcept {
  if (!toggled(request)) return AbortCode::toggle_bit;
  const auto window = data.window(sdo::segment_bytes);
  if (!window) {
    if (window.error() == AbortCode::pending) toggle_ = !toggle_;
    return window.error();
  }
  const bool last = window->size() <= sdo::segment_bytes;
  const auto count = last ? window->size() : sdo::segment_bytes;
  const auto command = static_cast<std::uint8_t>((request.data[0] & sdo::toggle_bit) |
                                                 ((sdo::segment_bytes - count) << 1U) | (last ? 1U : 0U));
  if (last) {
    sdo::put(answer, command, {});
    if (count > 0) std::memcpy(answer.data.data() + 1, window->data(), count);
    data.close_read();
  } else {
    sdo::put_segment(answer, command, window->data());
    data.consume(sdo::segment_bytes);
  }
  return AbortCode::none;
}

}  // namespace berth::co
