#include "berth/co/sdo_server.hpp"

#include <algorithm>

namespace berth::co {

using sdo::Ccs;

SdoServer::SdoServer(od::Values& values, std::size_t buffer, std::uint8_t channel) : data_(values, buffer, channel) {}

std::optional<can::Frame> SdoServer::handle(const can::Frame& request) noexcept {
  can::Frame answer;
  return handle(request, answer) ? std::optional(answer) : std::nullopt;
}

inline bool SdoServer::put_expedited(can::Frame& answer, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  std::uint32_t number = 0;
  if (value.size() == sizeof number) [[likely]] {
    sdo::put(answer, 0x43, ref, load_le<std::uint32_t>(value.data()));
    return true;
  }
  for (std::size_t i = value.size(); i-- > 0;) number = number << 8U | value[i];
  sdo::put(answer, static_cast<std::uint8_t>(0x43U | ((4U - value.size()) << 2U)), ref, number);
  return true;
}

inline bool SdoServer::begin_upload(const can::Frame& request, can::Frame& answer) noexcept {
  // By value: what is written meanwhile might be `ref_`, for all that the compiler knows.
  const ObjectRef ref = sdo::multiplexer(request);
  ref_ = ref;
  state_ = State::idle;
  if (!data_.streaming()) [[likely]] {
    const auto plain = data_.values().view_plain(ref);
    if (plain.size() - 1 < 4) [[likely]]
      return put_expedited(answer, ref, plain);
  }
  return open_upload(request, answer);
}

// What frames mean otherwise than by their command. False: look no further.
bool SdoServer::respond_in_block(const can::Frame& request, can::Frame& answer, bool& has_answer) noexcept {
  // In a sub-block every first byte but the abort's is a segment number.
  if (state_ == State::block_download) {
    has_answer = block_segment(request, answer);
    return false;
  }
  if (state_ == State::block_download_end && receiver_.repeats_last(request)) return false;
  if (state_ != State::pending) return true;
  if (!deferred_.ended_by(request)) return false;
  reset();
  return true;
}

inline bool SdoServer::respond(const can::Frame& request, can::Frame& answer) noexcept {
  if (state_ >= State::block_download) {
    bool has_answer = false;
    if (!respond_in_block(request, answer, has_answer)) return has_answer;
  }
  const auto command = static_cast<Ccs>(sdo::specifier(request.data[0]));
  if (command == Ccs::upload) [[likely]]
    return begin_upload(request, answer);
  switch (command) {
    case Ccs::abort: reset(); return false;
    case Ccs::download: return begin_download(request, answer);
    case Ccs::download_segment: return download_segment(request, answer);
    case Ccs::upload_segment: return upload_segment(request, answer);
    case Ccs::block_download: return block_download(request, answer);
    case Ccs::block_upload: return block_upload(request, answer);
    default: return refuse_unknown(request, answer);
  }
}

bool SdoServer::handle(const can::Frame& request, can::Frame& answer) noexcept {
  if (!sdo::well_formed(request)) return false;
  answer.set_head(response_key_, 8);
  return respond(request, answer);
}

// ---- ends

bool SdoServer::Deferred::ended_by(const can::Frame& frame) const noexcept {
  if (std::ranges::equal(request, frame.bytes())) return false;
  const auto byte = frame.data[0];
  // Between two sub-blocks a frame is a segment that comes late, whatever it looks like.
  if (way == Way::confirm && answer[0] == sdo::sub_block_confirmed) return byte == 0x80;
  switch (static_cast<Ccs>(sdo::specifier(byte))) {
    case Ccs::abort:
    case Ccs::download:
    case Ccs::upload: return true;
    case Ccs::block_download: return (byte & 0x01U) == 0;
    case Ccs::block_upload: return (byte & 0x03U) == 0;
    default: return false;
  }
}

// The outcome of something that may be pending: the answer is what confirms it.
bool SdoServer::confirm_or_defer(const can::Frame& request, can::Frame& answer, AbortCode code, State then) noexcept {
  if (code == AbortCode::none) {
    state_ = then;
    return true;
  }
  if (code != AbortCode::pending) return abort(answer, code);
  std::ranges::copy(answer.bytes(), deferred_.answer.begin());
  return defer(request, Deferred::Way::confirm, then);
}

bool SdoServer::defer(const can::Frame& request, Deferred::Way way, State then) noexcept {
  state_ = State::pending;
  deferred_.way = way;
  deferred_.then = then;
  std::ranges::copy(request.bytes(), deferred_.request.begin());
  return false;
}

std::optional<can::Frame> SdoServer::complete(AbortCode code) noexcept {
  if (state_ != State::pending || code == AbortCode::pending) return std::nullopt;
  can::Frame answer = can::Frame::base(0, deferred_.answer);
  answer.set_head(response_key_, 8);
  state_ = deferred_.then;
  bool has_answer = true;
  if (code != AbortCode::none) {
    abort(answer, code);
  } else if (deferred_.way == Deferred::Way::sub_block) {
    has_answer = send_block(answer);
  } else if (deferred_.way == Deferred::Way::ask_again) {
    has_answer = respond(can::Frame::base(0, deferred_.request), answer);
  }
  return has_answer ? std::optional(answer) : std::nullopt;
}

std::optional<can::Frame> SdoServer::expire() noexcept {
  if (!busy() || state_ == State::pending) return std::nullopt;
  can::Frame answer;
  answer.set_head(response_key_, 8);
  if (collecting()) {
    receiver_.give_up();
    const can::Frame none = can::Frame::base(0, std::array<std::uint8_t, 8>{});
    if (!acknowledge_block(none, answer)) return std::nullopt;
  } else {
    abort(answer, AbortCode::timeout);
  }
  return answer;
}

bool SdoServer::abort(can::Frame& answer, AbortCode code) noexcept {
  reset();
  sdo::put_abort(answer, ref_, code);
  return true;
}

bool SdoServer::refuse_unknown(const can::Frame& request, can::Frame& answer) noexcept {
  if (!busy()) ref_ = {};
  // An initiate that is unknown only by its low bits names its object.
  if (static_cast<Ccs>(sdo::specifier(request.data[0])) == Ccs::block_download && (request.data[0] & 0x01U) == 0) {
    ref_ = sdo::multiplexer(request);
  }
  return abort(answer, AbortCode::command_specifier);
}

// ---- download

bool SdoServer::begin_download(const can::Frame& request, can::Frame& answer) noexcept {
  reset();
  ref_ = sdo::multiplexer(request);
  sdo::put(answer, 0x60, ref_);
  const bool expedited = (request.data[0] & 0x02U) != 0;
  const auto code = expedited ? expedited_download(request) : begin_segmented_download(request);
  return confirm_or_defer(request, answer, code, expedited ? State::idle : State::download);
}

AbortCode SdoServer::expedited_download(const can::Frame& request) noexcept {
  const bool sized = (request.data[0] & 0x01U) != 0;
  std::size_t length = 4U - ((request.data[0] >> 2U) & 0x03U);
  if (!sized) {
    const auto counted = data_.values().length_of_unsized(ref_, 4);
    if (!counted) return counted.error();
    length = *counted;
  }
  return data_.values().write(ref_, std::span(request.data).subspan(4, length));
}

AbortCode SdoServer::begin_segmented_download(const can::Frame& request) noexcept {
  const bool sized = (request.data[0] & 0x01U) != 0;
  toggle_ = false;
  return data_.open_write(
      ref_, sized ? std::optional<std::size_t>(load_le<std::uint32_t>(request.data.data() + 4)) : std::nullopt);
}

bool SdoServer::toggled(const can::Frame& request) noexcept {
  if (((request.data[0] & sdo::toggle_bit) != 0) != toggle_) return false;
  toggle_ = !toggle_;
  return true;
}

bool SdoServer::download_segment(const can::Frame& request, can::Frame& answer) noexcept {
  if (state_ != State::download) return refuse_unknown(request, answer);
  if (!toggled(request)) return abort(answer, AbortCode::toggle_bit);
  const auto byte = request.data[0];
  if ((byte & 0x0FU) == 0) {
    if (std::uint8_t* const place = data_.quick_place()) {
      std::memcpy(place, request.data.data() + 1, sdo::segment_bytes);
      sdo::put(answer, 0x20U | byte, {});
      return true;
    }
  }
  const bool last = (byte & 0x01U) != 0;
  const std::size_t count = sdo::segment_bytes - ((byte >> 1U) & 0x07U);
  sdo::put(answer, static_cast<std::uint8_t>(0x20U | (byte & sdo::toggle_bit)), {});
  const auto code = take(request.data.data() + 1, count, last);
  if (!last && code == AbortCode::none) return true;
  return confirm_or_defer(request, answer, code, last ? State::idle : State::download);
}

AbortCode SdoServer::take(const std::uint8_t* bytes, std::size_t count, bool last) noexcept {
  const auto place = data_.place(sdo::segment_bytes);
  if (!place) return place.error();
  std::memcpy(*place, bytes, sdo::segment_bytes);
  const auto code = data_.commit(count);
  if (code != AbortCode::none) return code;
  return last ? data_.close_write() : data_.ready();
}

// ---- upload

bool SdoServer::open_upload(const can::Frame& request, can::Frame& answer) noexcept {
  std::span<const std::uint8_t> value;
  const auto code = data_.open_read(ref_, value);
  if (code == AbortCode::pending) return defer(request, Deferred::Way::ask_again, State::idle);
  if (code != AbortCode::none) {
    abort(answer, code);
  } else if (value.empty()) {
    answer_upload(answer);
  } else {
    return put_expedited(answer, ref_, value);
  }
  if (const od::Stream* const stream = data_.values().stream(ref_)) sdo::rename(answer, stream->named(ref_));
  return true;
}

// The object is open: expedited when it fits, else the first of a segmented transfer.
bool SdoServer::answer_upload(can::Frame& answer) noexcept {
  const auto size = data_.size();
  if (size && *size >= 1 && *size <= 4) {
    const auto value = data_.window(*size);
    if (!value) return abort(answer, value.error());
    put_expedited(answer, ref_, value->first(*size));
    data_.close_read();
    return true;
  }
  state_ = State::upload;
  toggle_ = false;
  sdo::put(answer, size ? 0x41 : 0x40, ref_, static_cast<std::uint32_t>(size.value_or(0)));
  return true;
}

bool SdoServer::upload_segment(const can::Frame& request, can::Frame& answer) noexcept {
  if (state_ != State::upload) return refuse_unknown(request, answer);
  if (!toggled(request)) return abort(answer, AbortCode::toggle_bit);
  if (const std::uint8_t* const bytes = data_.quick_read()) {
    sdo::put_segment(answer, request.data[0] & sdo::toggle_bit, bytes);
    return true;
  }
  const auto window = data_.window(sdo::segment_bytes);
  if (!window) {
    if (window.error() != AbortCode::pending) return abort(answer, window.error());
    toggle_ = !toggle_;
    return defer(request, Deferred::Way::ask_again, State::upload);
  }
  const bool last = window->size() <= sdo::segment_bytes;
  const auto count = last ? window->size() : sdo::segment_bytes;
  const auto command = static_cast<std::uint8_t>((request.data[0] & sdo::toggle_bit) |
                                                 ((sdo::segment_bytes - count) << 1U) | (last ? 1U : 0U));
  if (last) {
    sdo::put(answer, command, {});
    if (count > 0) std::memcpy(answer.data.data() + 1, window->data(), count);
    data_.close_read();
    state_ = State::idle;
  } else {
    sdo::put_segment(answer, command, window->data());
    data_.consume(sdo::segment_bytes);
  }
  return true;
}

}  // namespace berth::co
