// The SDO server's block transfers (CiA 301 §7.2.4.3.9 to §7.2.4.3.14).
#include "berth/co/sdo_server.hpp"

#include <algorithm>

namespace berth::co {

namespace {
constexpr std::uint8_t download_ended = 0xA1;
}  // namespace

// ---- download

bool SdoServer::block_download(const can::Frame& request, can::Frame& answer) noexcept {
  const bool ends = (request.data[0] & 0x01U) != 0;
  return ends ? end_block_download(request, answer) : begin_block_download(request, answer);
}

bool SdoServer::begin_block_download(const can::Frame& request, can::Frame& answer) noexcept {
  reset();
  ref_ = sdo::multiplexer(request);
  const bool sized = (request.data[0] & 0x02U) != 0;
  crc_used_ = (request.data[0] & 0x04U) != 0;
  crc_ = 0;
  const auto size = sized ? std::optional<std::size_t>(load_le<std::uint32_t>(request.data.data() + 4)) : std::nullopt;
  auto code = data_.open_write(ref_, size);
  if (code != AbortCode::none && code != AbortCode::pending) return abort(answer, code);
  receiver_.begin();
  receiver_.sub_block(sdo::longest_block, nullptr);
  if (const auto placed = next_block(); placed != AbortCode::none) code = placed;
  sdo::put(answer, static_cast<std::uint8_t>(0xA0U | crc_bit()), ref_, receiver_.size());
  return confirm_or_defer(request, answer, code, State::block_download);
}

// The sub-block that is asked for next: as large as the buffer allows.
AbortCode SdoServer::next_block() noexcept {
  const auto size = data_.segments(receiver_.next_size());
  const auto place = data_.place(size * sdo::segment_bytes);
  if (!place) return place.error();
  receiver_.sub_block(size, *place);
  return AbortCode::none;
}

bool SdoServer::block_segment(const can::Frame& request, can::Frame& answer) noexcept {
  if (request.data[0] == 0x80) {
    reset();
    return false;
  }
  switch (receiver_.take(request)) {
    case sdo::BlockReceiver::Heard::more: return false;
    case sdo::BlockReceiver::Heard::ends: return acknowledge_block(request, answer);
    default: return abort(answer, AbortCode::sequence_number);
  }
}

// Of the last segment it is not known yet how much of it counts.
AbortCode SdoServer::commit_block() noexcept {
  const std::size_t count = (receiver_.good() - (receiver_.complete() ? 1U : 0U)) * sdo::segment_bytes;
  const auto code = data_.commit(count);
  if (crc_used_) crc_ = crc16({receiver_.place() - receiver_.good() * sdo::segment_bytes, count}, crc_);
  return code;
}

bool SdoServer::acknowledge_block(const can::Frame& segment, can::Frame& answer) noexcept {
  const auto good = receiver_.good();
  auto code = receiver_.alive() ? commit_block() : AbortCode::timeout;
  if (code == AbortCode::none && !receiver_.complete()) code = next_block();
  if (code == AbortCode::none) code = data_.ready();
  sdo::put(answer, sdo::sub_block_confirmed, {});
  answer.data[1] = static_cast<std::uint8_t>(good);
  answer.data[2] = static_cast<std::uint8_t>(receiver_.size());
  const State next = receiver_.complete() ? State::block_download_end : State::block_download;
  return confirm_or_defer(segment, answer, code, next);
}

bool SdoServer::end_block_download(const can::Frame& request, can::Frame& answer) noexcept {
  if (state_ != State::block_download_end) return refuse_unknown(request, answer);
  const std::size_t count = sdo::segment_bytes - ((request.data[0] >> 2U) & 0x07U);
  const std::uint8_t* const last = receiver_.place() - sdo::segment_bytes;
  if (crc_used_ && crc16({last, count}, crc_) != load_le<std::uint16_t>(request.data.data() + 1)) {
    return abort(answer, AbortCode::crc);
  }
  auto code = data_.commit(count);
  if (code == AbortCode::none) code = data_.close_write();
  sdo::put(answer, download_ended, {});
  return confirm_or_defer(request, answer, code, State::idle);
}

// ---- upload

bool SdoServer::block_upload(const can::Frame& request, can::Frame& answer) noexcept {
  const auto command = request.data[0] & 0x03U;
  if (command == 0) return begin_block_upload(request, answer);
  switch (state_) {
    case State::block_upload_start:
      if (command == 3) return send_block(answer);
      break;
    case State::block_upload:
      if (command == 2) return block_acknowledged(request, answer);
      if (command == 3) return false;  // once more
      break;
    case State::block_upload_end:
      if (command == 2) return false;
      if (command != 1) break;
      data_.close_read();
      state_ = State::idle;
      return false;
    default: break;
  }
  return refuse_unknown(request, answer);
}

bool SdoServer::begin_block_upload(const can::Frame& request, can::Frame& answer) noexcept {
  reset();
  ref_ = sdo::multiplexer(request);
  block_size_ = request.data[4];
  const std::size_t threshold = request.data[5];
  crc_used_ = (request.data[0] & 0x04U) != 0;
  if (!sdo::valid_block_size(block_size_)) return abort(answer, AbortCode::block_size);
  const auto code = data_.open_read(ref_);
  if (code == AbortCode::pending) return defer(request, Deferred::Way::ask_again, State::idle);
  if (code != AbortCode::none) return abort(answer, code);
  const auto size = data_.size();
  if (size && threshold > 0 && *size <= threshold) return answer_upload(answer);
  state_ = State::block_upload_start;
  sender_.begin(crc_used_);
  const unsigned sized = size ? 0x02U : 0x00U;
  sdo::put(answer, static_cast<std::uint8_t>(0xC0U | crc_bit() | sized), ref_,
           static_cast<std::uint32_t>(size.value_or(0)));
  return true;
}

// The segments follow by `sending`; `answer` is only for a refusal.
bool SdoServer::send_block(can::Frame& answer) noexcept {
  const auto window = data_.window(block_size_ * sdo::segment_bytes);
  if (!window && window.error() == AbortCode::pending) return defer(answer, Deferred::Way::sub_block, state_);
  if (!window) return abort(answer, window.error());
  state_ = State::block_upload;
  sender_.sub_block(block_size_, *window);
  return false;
}

bool SdoServer::block_acknowledged(const can::Frame& request, can::Frame& answer) noexcept {
  using Heard = sdo::BlockSender::Heard;
  switch (sender_.acknowledge(request.data[1], request.data[2])) {
    case Heard::stale: return false;
    case Heard::invalid: return abort(answer, sender_.code());
    case Heard::go_on:
      data_.consume(sender_.acknowledged());
      block_size_ = request.data[2];
      return send_block(answer);
    default: break;
  }
  state_ = State::block_upload_end;
  sdo::put(answer, static_cast<std::uint8_t>(0xC1U | (sender_.unused() << 2U)), {});
  store_le(answer.data.data() + 1, sender_.crc());
  return true;
}

}  // namespace berth::co
