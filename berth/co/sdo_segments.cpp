#include "berth/co/sdo_segments.hpp"

namespace berth::co {

using What = SdoSegments::Step::What;

SdoSegments::Step SdoSegments::request(can::Frame& request, SdoClientData& data) noexcept {
  if (quick_request(request, data)) return {};
  const auto rest = data.window(sdo::segment_bytes);
  if (!rest && rest.error() == AbortCode::pending) return {What::wait};
  if (!rest) return {What::refuse, rest.error(), "the source gave no more bytes"};
  last_ = rest->size() <= sdo::segment_bytes;
  const auto count = last_ ? rest->size() : sdo::segment_bytes;
  const auto command = static_cast<std::uint8_t>(toggle() | ((sdo::segment_bytes - count) << 1U) | (last_ ? 1U : 0U));
  if (!last_) {
    sdo::put_segment(request, command, rest->data());
  } else {
    sdo::put(request, command, {});
    if (count > 0) std::memcpy(request.data.data() + 1, rest->data(), count);
  }
  data.consume(count);
  return {};
}

SdoSegments::Step SdoSegments::answered(const can::Frame& answer, SdoClientData& data) noexcept {
  const auto expected = data.is_download() ? sdo::Scs::download_segment : sdo::Scs::upload_segment;
  if (static_cast<sdo::Scs>(sdo::specifier(answer.data[0])) != expected) {
    return {What::refuse, AbortCode::command_specifier, "the server answered with an unexpected command"};
  }
  if (((answer.data[0] & sdo::toggle_bit) != 0) != toggle_) {
    return {What::refuse, AbortCode::toggle_bit, "the server did not alternate the toggle bit"};
  }
  toggle_ = !toggle_;
  if (data.is_download()) return {last_ ? What::done : What::request};
  return take(answer, data);
}

SdoSegments::Step SdoSegments::take(const can::Frame& answer, SdoClientData& data) const noexcept {
  const std::size_t count = sdo::segment_bytes - ((answer.data[0] >> 1U) & 0x07U);
  const bool last = (answer.data[0] & 0x01U) != 0;
  if (data.too_many(count)) return {What::refuse, AbortCode::length_too_high, "more bytes than indicated"};
  if (count == 0 && !last) return {What::refuse, AbortCode::general, "an empty segment that is not the last"};
  const auto code = data.put(std::span(answer.data).subspan(1, count));
  if (code != AbortCode::none && code != AbortCode::pending) return {What::refuse, code, data.refusal()};
  if (!last) return {code == AbortCode::pending ? What::wait : What::request};
  if (data.too_few()) return {What::refuse, AbortCode::length_too_low, "fewer bytes than indicated"};
  return {What::done};
}

}  // namespace berth::co
