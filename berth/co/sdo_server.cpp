#include "berth/co/sdo_server.hpp"

#include <algorithm>

namespace berth::co {

using sdo::Ccs;

SdoServer::SdoServer(od::Values& values, std::size_t buffer, std::uint8_t channel) : data_(values, buffer, channel) {}

namespace {

inline bool put_expedited(can::Frame& answer, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  std::uint32_t number = 0;
  if (value.size() == sizeof number) [[likely]] {
    sdo::put(answer, 0x43, ref, load_le<std::uint32_t>(value.data()));
    return true;
  }
  for (std::size_t i = value.size(); i-- > 0;) number = number << 8U | value[i];
  sdo::put(answer, static_cast<std::uint8_t>(0x43U | ((4U - value.size()) << 2U)), ref, number);
  return true;
}

AbortCode expedited_download(const can::Frame& request, od::Values& values) noexcept {
  const auto ref = sdo::multiplexer(request);
  const bool sized = (request.data[0] & 0x01U) != 0;
  std::size_t length = 4U - ((request.data[0] >> 2U) & 0x03U);
  if (!sized) {
    const auto counted = values.length_of_unsized(ref, 4);
    if (!counted) return counted.error();
    length = *counted;
  }
  return values.write(ref, std::span(request.data).subspan(4, length));
}

}  // namespace

// Handles frames whose meaning is not given by their command. False: the frame is done with.
bool SdoServer::respond_in_block(const can::Frame& request, can::Frame& answer, bool& has_answer) noexcept {
  // In a sub-block, the first byte of each frame but an abort is a segment number.
  if (state_ == State::block_download) {
    using Heard = sdo::BlockReceiver::Heard;
    if (request.data[0] == 0x80) {
      reset();
    } else if (const auto heard = block_.receiver().take(request); heard == Heard::ends) {
      has_answer = acknowledge_block(request, answer);
    } else if (heard == Heard::invalid) {
      has_answer = abort(answer, AbortCode::sequence_number);
    }
    return false;
  }
  if (state_ == State::block_download_end && block_.receiver().repeats_last(request)) return false;
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
  if (command == Ccs::upload) [[likely]] {
    // A copy: the compiler must assume that a write in between changes `ref_`.
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
  switch (command) {
    case Ccs::abort: reset(); return false;
    case Ccs::download: return begin_download(request, answer);
    case Ccs::download_segment: return segment(request, answer, true);
    case Ccs::upload_segment: return segment(request, answer, false);
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
  // Between two sub-blocks, a frame is a late segment, whatever it looks like.
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

// Takes the outcome of an access. If it is pending, the server waits; when the access is answered, `complete` goes on
// as `way` says. Otherwise `answer` is sent: the confirmation, or an abort.
bool SdoServer::settle(const can::Frame& request, can::Frame& answer, AbortCode code, State then,
                       Deferred::Way way) noexcept {
  if (code == AbortCode::none) {
    state_ = then;
    return true;
  }
  if (code != AbortCode::pending) return abort(answer, code);
  state_ = State::pending;
  deferred_.way = way;
  deferred_.then = then;
  std::ranges::copy(answer.bytes(), deferred_.answer.begin());
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
    block_.receiver().give_up();
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
  // An initiate that is unknown only because of its low bits still names its object.
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
  if ((request.data[0] & 0x02U) != 0) {
    return settle(request, answer, expedited_download(request, data_.values()), State::idle);
  }
  const bool sized = (request.data[0] & 0x01U) != 0;
  const auto size = sized ? std::optional<std::size_t>(load_le<std::uint32_t>(request.data.data() + 4)) : std::nullopt;
  segments_.begin();
  return settle(request, answer, data_.open_write(ref_, size), State::download);
}

bool SdoServer::segment(const can::Frame& request, can::Frame& answer, bool download) noexcept {
  const State under_way = download ? State::download : State::upload;
  if (state_ != under_way) return refuse_unknown(request, answer);
  const bool quick =
      download ? segments_.quick_download(request, answer, data_) : segments_.quick_upload(request, answer, data_);
  if (quick) [[likely]]
    return true;
  const auto code = download ? segments_.download(request, answer, data_) : segments_.upload(request, answer, data_);
  const bool last = ((download ? request : answer).data[0] & 0x01U) != 0;
  if (code == AbortCode::none && !last) return true;
  if (download) return settle(request, answer, code, last ? State::idle : State::download);
  return settle(request, answer, code, code == AbortCode::none ? State::idle : State::upload, Deferred::Way::ask_again);
}

bool SdoServer::block_download(const can::Frame& request, can::Frame& answer) noexcept {
  if ((request.data[0] & 0x01U) != 0) {
    if (state_ != State::block_download_end) return refuse_unknown(request, answer);
    return settle(request, answer, block_.end_download(request, answer, data_), State::idle);
  }
  reset();
  ref_ = sdo::multiplexer(request);
  return settle(request, answer, block_.begin_download(request, answer, data_), State::block_download);
}

bool SdoServer::acknowledge_block(const can::Frame& segment, can::Frame& answer) noexcept {
  const auto code = block_.acknowledge(answer, data_);
  const bool last = block_.receiver().complete();
  return settle(segment, answer, code, last ? State::block_download_end : State::block_download);
}

// ---- upload

bool SdoServer::open_upload(const can::Frame& request, can::Frame& answer) noexcept {
  std::span<const std::uint8_t> value;
  const auto code = data_.open_read(ref_, value);
  if (code == AbortCode::pending) return settle(request, answer, code, State::idle, Deferred::Way::ask_again);
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

// The object is open: the answer is expedited if the value fits, else it begins a segmented transfer.
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
  segments_.begin();
  sdo::put(answer, size ? 0x41 : 0x40, ref_, static_cast<std::uint32_t>(size.value_or(0)));
  return true;
}

bool SdoServer::block_upload(const can::Frame& request, can::Frame& answer) noexcept {
  using Heard = sdo::BlockSender::Heard;
  const auto command = request.data[0] & 0x03U;
  if (command == 0) return begin_block_upload(request, answer);
  if (command == 3 && state_ == State::block_upload_start) return send_block(answer);
  if (command == 3 && state_ == State::block_upload) return false;      // repeated
  if (command == 2 && state_ == State::block_upload_end) return false;  // repeated
  if (command == 1 && state_ == State::block_upload_end) {
    data_.close_read();
    state_ = State::idle;
    return false;
  }
  if (command != 2 || state_ != State::block_upload) return refuse_unknown(request, answer);
  switch (block_.acknowledged(request, data_)) {
    case Heard::stale: return false;
    case Heard::invalid: return abort(answer, block_.sender().code());
    case Heard::go_on: return send_block(answer);
    default: break;
  }
  state_ = State::block_upload_end;
  block_.put_end(answer);
  return true;
}

bool SdoServer::begin_block_upload(const can::Frame& request, can::Frame& answer) noexcept {
  reset();
  ref_ = sdo::multiplexer(request);
  if (!block_.begin_upload(request)) return abort(answer, AbortCode::block_size);
  const auto code = data_.open_read(ref_);
  if (code != AbortCode::none) return settle(request, answer, code, State::idle, Deferred::Way::ask_again);
  const auto size = data_.size();
  const std::size_t threshold = request.data[5];
  if (size && threshold > 0 && *size <= threshold) return answer_upload(answer);
  state_ = State::block_upload_start;
  block_.put_initiated(answer, ref_, size);
  return true;
}

// The segments follow by `sending`; `answer` is used only for a refusal.
bool SdoServer::send_block(can::Frame& answer) noexcept {
  const auto code = block_.next_sub_block(data_);
  if (code != AbortCode::none) return settle(answer, answer, code, state_, Deferred::Way::sub_block);
  state_ = State::block_upload;
  return false;
}

}  // namespace berth::co
