// The SDO client's block transfers (CiA 301 §7.2.4.3.9 to §7.2.4.3.14).
#include <algorithm>

#include "berth/co/sdo_client_parts.hpp"

namespace berth::co {

using sdo::Scs;

void SdoTransfer::FreeExtra::operator()(Extra* extra) const noexcept { delete extra; }

void SdoTransfer::need_extra() {
  if (!extra_) extra_.reset(new Extra(*this, line_->dispatcher()));
}

bool SdoTransfer::size_wants_block() const noexcept {
  if (options_.mode == SdoMode::block || !download_) return true;
  const auto size = size_to_send();
  return !size || *size >= options_.block_from;
}

void SdoTransfer::prepare_block_initiate() noexcept {
  need_extra();
  const unsigned crc = options_.crc ? 0x04U : 0U;
  if (download_) {
    const auto size = size_to_send();
    return sdo::put(request_, static_cast<std::uint8_t>(0xC0U | crc | (size ? 0x02U : 0U)), ref_,
                    static_cast<std::uint32_t>(size.value_or(0)));
  }
  const auto below = std::min<std::size_t>(options_.block_from > 0 ? options_.block_from - 1 : 0, 0xFF);
  sdo::put(request_, static_cast<std::uint8_t>(0xA0U | crc), ref_);
  request_.data[4] = static_cast<std::uint8_t>(std::clamp<unsigned>(options_.block_size, 1, sdo::longest_block));
  request_.data[5] = options_.mode == SdoMode::automatic ? static_cast<std::uint8_t>(below) : options_.protocol_switch;
}

void SdoTransfer::take_block_initiate(const can::Frame& frame) noexcept {
  auto& extra = *extra_;
  extra.crc_used = options_.crc && (frame.data[0] & 0x04U) != 0;
  extra.crc = 0;
  if (download_) {
    if (!sdo::valid_block_size(frame.data[4])) {
      return refuse(AbortCode::block_size, "the server gave a block size of 0 or above 127");
    }
    extra.sender.begin(extra.crc_used);
    return send_block(frame.data[4]);
  }
  const bool sized = (frame.data[0] & 0x02U) != 0;
  if (!begin_value(sized, sized ? load_le<std::uint32_t>(frame.data.data() + 4) : 0)) return;
  extra.receiver.begin();
  const unsigned size = request_.data[4];
  sdo::put(request_, 0xA3, {});
  state_ = State::block;
  begin_sub_block(size);
  send(size);
}

// ---- download

void SdoTransfer::send_block(unsigned size) noexcept {
  auto& extra = *extra_;
  const auto bytes = window(size * sdo::segment_bytes);
  if (!bytes && bytes.error() == AbortCode::pending) return extra.wait_for(Extra::Wait::sub_block, size);
  if (!bytes) return refuse(bytes.error(), "the source gave no more bytes");
  state_ = State::block;
  window_ = false;
  deadline_ = rt::never;  // the pump has its own
  extra.sender.sub_block(size, *bytes);
  if (options_.pace == nullptr || options_.pace->take(extra)) extra.turn();
}

void SdoTransfer::pumped(rt::Time at) noexcept {
  if (options_.pace != nullptr) options_.pace->give(*extra_);
  expects_ = 1;
  sent(at);
}

void SdoTransfer::stuck(can::Queued why) noexcept {
  fail_with(Errc::bus, 0,
            why == can::Queued::full ? "the SDO segments never left: no device acknowledges them, or the bus is full"
                                     : "the SDO segments never left: bus-off, or the port is closed");
}

bool SdoTransfer::block_acknowledged(const can::Frame& frame) noexcept {
  using Heard = sdo::BlockSender::Heard;
  if (static_cast<Scs>(sdo::specifier(frame.data[0])) == Scs::abort) return take_abort(frame);
  auto& sender = extra_->sender;
  if (frame.data[0] != sdo::sub_block_confirmed) {
    if (!window_ || static_cast<Scs>(sdo::specifier(frame.data[0])) == Scs::block_download) return false;
    refuse(AbortCode::command_specifier, "the server answered with an unexpected command");
    return true;
  }
  switch (sender.acknowledge(frame.data[1], frame.data[2])) {
    case Heard::stale: return false;
    case Heard::invalid: refuse(sender.code(), "the server acknowledged what cannot be"); return true;
    case Heard::go_on:
      extra_->stop();
      consume(sender.acknowledged());
      if (!lingers()) send_block(sender.size());
      return true;
    default: break;
  }
  consume(sender.acknowledged());
  end_block_download();
  return true;
}

void SdoTransfer::end_block_download() noexcept {
  const auto& sender = extra_->sender;
  state_ = State::block_end;
  sdo::put(request_, static_cast<std::uint8_t>(0xC1U | (sender.unused() << 2U)), {});
  store_le(request_.data.data() + 1, sender.crc());
  send();
}

// ---- upload

void SdoTransfer::begin_sub_block(unsigned size) noexcept {
  auto& extra = *extra_;
  extra.place = streamed_ ? extra.stash.data() : value_.extend(size * sdo::segment_bytes);
  extra.receiver.sub_block(size, extra.place);
}

bool SdoTransfer::block_segment(const can::Frame& frame) noexcept {
  auto& extra = *extra_;
  extra.heard = line_->dispatcher().executor().now();
  if (lingers()) return true;
  switch (extra.receiver.take(frame)) {
    case sdo::BlockReceiver::Heard::more:
      if (expects_ > 0) --expects_;
      break;
    case sdo::BlockReceiver::Heard::ends: acknowledge_block(); break;
    default: refuse(AbortCode::sequence_number, "a segment whose number is not of this sub-block");
  }
  return true;
}

// A sub-block is over: `count` bytes of it are the object's, and so many behind them are not (yet).
AbortCode SdoTransfer::keep_block(std::size_t count, std::size_t unused) noexcept {
  auto& extra = *extra_;
  if (!streamed_) value_.drop_back(unused);
  const std::uint8_t* const bytes = streamed_ ? extra.place : value_.bytes().data() + value_.size() - count;
  if (extra.crc_used) extra.crc = crc16({bytes, count}, extra.crc);
  offset_ += count;
  if (size_indicated_ && offset_ > indicated_) return AbortCode::length_too_high;
  if (!streamed_) return offset_ > options_.longest ? AbortCode::out_of_memory : AbortCode::none;
  return count > 0 ? extra.sink->write({bytes, count}) : AbortCode::none;
}

void SdoTransfer::acknowledge_block() noexcept {
  auto& extra = *extra_;
  auto& receiver = extra.receiver;
  // What was not heard of the sub-block will not come any more.
  const unsigned silent = expects_ > 0 ? expects_ - 1U : 0U;
  line_->owed_ = static_cast<std::uint16_t>(line_->owed_ - std::min<unsigned>(line_->owed_, silent));
  const auto good = receiver.good();
  const bool last = receiver.complete();
  if (last) std::memcpy(extra.tail.data(), receiver.place() - sdo::segment_bytes, sdo::segment_bytes);
  const std::size_t count = (good - (last ? 1U : 0U)) * sdo::segment_bytes;
  auto code = keep_block(count, receiver.size() * sdo::segment_bytes - count);
  const bool waits = code == AbortCode::pending;
  if (waits) code = AbortCode::none;
  if (code == AbortCode::none && !receiver.alive()) code = AbortCode::timeout;
  if (code != AbortCode::none) return refuse(code, "the sub-blocks do not fit: too long, without progress, or refused");
  const auto size = receiver.next_size();
  sdo::put(request_, sdo::sub_block_confirmed, {});
  request_.data[1] = static_cast<std::uint8_t>(good);
  request_.data[2] = static_cast<std::uint8_t>(size);
  if (last) state_ = State::block_end;
  if (waits) return extra.wait_for(Extra::Wait::request, last ? 1 : size);
  if (last) return send();
  begin_sub_block(size);
  send(size);
}

// The end of the upload; also the answer to our own end of a download.
bool SdoTransfer::end_block_upload(const can::Frame& frame) noexcept {
  if (download_) {
    if (frame.data[0] != 0xA1) return false;
    complete();
    return true;
  }
  auto& extra = *extra_;
  if ((frame.data[0] & 0xE3U) != 0xC1U || extra.receiver.repeats_last(frame)) return false;
  const std::size_t count = sdo::segment_bytes - ((frame.data[0] >> 2U) & 0x07U);
  if (!streamed_) std::copy_n(extra.tail.begin(), sdo::segment_bytes, value_.extend(sdo::segment_bytes));
  if (streamed_) std::ranges::copy(extra.tail, extra.place = extra.stash.data());
  auto code = keep_block(count, sdo::segment_bytes - count);
  if (code == AbortCode::pending) code = AbortCode::none;  // there is no more
  if (code != AbortCode::none) {
    refuse(code, "more bytes than indicated, or than allowed");
  } else if (size_indicated_ && offset_ < indicated_) {
    refuse(AbortCode::length_too_low, "fewer bytes than indicated");
  } else if (extra.crc_used && extra.crc != load_le<std::uint16_t>(frame.data.data() + 1)) {
    refuse(AbortCode::crc, "the CRC of the block upload is wrong");
  } else {
    state_ = State::closing;
    sdo::put(request_, 0xA1, {});
    send();
  }
  return true;
}

// Nothing heard for a while: what there is of a sub-block is acknowledged; of one that never came, nothing.
void SdoTransfer::block_silence() noexcept {
  auto& extra = *extra_;
  auto& executor = line_->dispatcher().executor();
  const bool heard = extra.receiver.heard();
  const auto due = extra.heard + (heard ? options_.timeout / sdo::block_gap_part : options_.timeout);
  if (executor.now() < due) return wait_until(due);
  if (!heard) return timed_out();
  extra.receiver.give_up();
  acknowledge_block();
}

}  // namespace berth::co
