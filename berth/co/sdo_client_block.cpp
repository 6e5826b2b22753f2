// The SDO client's block transfers (CiA 301 §7.2.4.3.9 to §7.2.4.3.14), and how it waits for streams.
#include <algorithm>

#include "berth/co/sdo_client_parts.hpp"

namespace berth::co {

using sdo::Scs;

void SdoTransfer::FreeExtra::operator()(Extra* extra) const noexcept { delete extra; }

// ---- waiting for source or sink

void SdoTransfer::Waiter::wait(What what, unsigned size) noexcept {
  what_ = what;
  size_ = size;
  transfer_->request_.deadline = rt::never;
  transfer_->request_.on_wire = true;
  transfer_->extra_->stream.pace().wait(this);
}

void SdoTransfer::Waiter::end() noexcept {
  if (std::exchange(what_, What::nothing) != What::nothing) transfer_->extra_->stream.pace().wait(nullptr);
}

void SdoTransfer::Waiter::go_on() noexcept {
  auto& block = transfer_->extra_->block;
  switch (std::exchange(what_, What::nothing)) {
    case What::segment: return transfer_->next_segment();
    case What::sub_block: return block.send_sub_block(size_);
    case What::request:
      if (block.collecting()) block.begin_sub_block(size_);
      return transfer_->send(size_);
    default: return;
  }
}

// ---- a block transfer

void SdoTransfer::Block::stop() noexcept {
  pump_.stop();
  if (transfer_->options_.pace != nullptr) transfer_->options_.pace->leave(*this);
}

void SdoTransfer::Block::prepare_initiate() noexcept {
  phase_ = Phase::sub_blocks;
  const auto& options = transfer_->options_;
  auto& request = transfer_->request_.frame;
  const unsigned crc = options.crc ? 0x04U : 0U;
  if (transfer_->data_.is_download()) {
    const auto size = transfer_->data_.size();
    return sdo::put(request, static_cast<std::uint8_t>(0xC0U | crc | (size ? 0x02U : 0U)), transfer_->ref_,
                    static_cast<std::uint32_t>(size.value_or(0)));
  }
  const auto below = std::min<std::size_t>(options.block_from > 0 ? options.block_from - 1 : 0, 0xFF);
  sdo::put(request, static_cast<std::uint8_t>(0xA0U | crc), transfer_->ref_);
  request.data[4] = static_cast<std::uint8_t>(std::clamp<unsigned>(options.block_size, 1, sdo::longest_block));
  request.data[5] = options.mode == SdoMode::automatic ? static_cast<std::uint8_t>(below) : options.protocol_switch;
}

void SdoTransfer::Block::initiated(const can::Frame& frame) noexcept {
  auto& data = transfer_->data_;
  auto& request = transfer_->request_.frame;
  crc_used_ = transfer_->options_.crc && (frame.data[0] & 0x04U) != 0;
  crc_ = 0;
  if (data.is_download()) {
    if (!sdo::valid_block_size(frame.data[4])) {
      return transfer_->refuse(AbortCode::block_size, "the server gave a block size of 0 or above 127");
    }
    sender_.begin(crc_used_);
    return send_sub_block(frame.data[4]);
  }
  const bool sized = (frame.data[0] & 0x02U) != 0;
  const auto code = data.open(sized, sized ? load_le<std::uint32_t>(frame.data.data() + 4) : 0);
  if (code != AbortCode::none) return transfer_->refuse(code, data.refusal());
  transfer_->state_ = State::block;
  receiver_.begin();
  const unsigned size = request.data[4];
  sdo::put(request, 0xA3, {});
  begin_sub_block(size);
  transfer_->send(size);
}

bool SdoTransfer::Block::answer(const can::Frame& frame) noexcept {
  // In sub-blocks, received frames are segments, and a sub-block may be acknowledged before all of it was sent.
  if (phase_ == Phase::sub_blocks) {
    if (!collecting()) return acknowledged(frame);
    if (transfer_->request_.on_wire && frame.data[0] != 0x80) return segment(frame);
  }
  if (!transfer_->request_.on_wire) return false;
  if (static_cast<Scs>(sdo::specifier(frame.data[0])) == Scs::abort) return transfer_->take_abort(frame);
  return phase_ == Phase::end && ended(frame);
}

// ---- download

void SdoTransfer::Block::send_sub_block(unsigned size) noexcept {
  const auto bytes = transfer_->data_.window(size * sdo::segment_bytes);
  if (!bytes && bytes.error() == AbortCode::pending) {
    return transfer_->extra_->waiter.wait(Waiter::What::sub_block, size);
  }
  if (!bytes) return transfer_->refuse(bytes.error(), "the source gave no more bytes");
  transfer_->state_ = State::block;
  transfer_->request_.on_wire = false;
  transfer_->request_.deadline = rt::never;  // the pump has its own time-out
  sender_.sub_block(size, *bytes);
  auto* const pace = transfer_->options_.pace;
  if (pace == nullptr || pace->take(*this)) turn();
}

void SdoTransfer::Block::turn() noexcept {
  pump_.start(sender_, transfer_->line_->request_, transfer_->options_.send_timeout);
}

void SdoTransfer::Block::pumped(rt::Time at) noexcept {
  if (transfer_->options_.pace != nullptr) transfer_->options_.pace->give(*this);
  transfer_->request_.answers = 1;
  transfer_->sent(at);
}

void SdoTransfer::Block::stuck(can::Queued why) noexcept {
  transfer_->fail_with(Errc::bus, 0,
                       why == can::Queued::full
                           ? "the SDO segments never left: no device acknowledges them, or the bus is full"
                           : "the SDO segments never left: bus-off, or the port is closed");
}

bool SdoTransfer::Block::acknowledged(const can::Frame& frame) noexcept {
  using Heard = sdo::BlockSender::Heard;
  const auto specifier = static_cast<Scs>(sdo::specifier(frame.data[0]));
  if (specifier == Scs::abort) return transfer_->take_abort(frame);
  if (frame.data[0] != sdo::sub_block_confirmed) {
    if (!transfer_->request_.on_wire || specifier == Scs::block_download) return false;
    transfer_->refuse(AbortCode::command_specifier, "the server answered with an unexpected command");
    return true;
  }
  switch (sender_.acknowledge(frame.data[1], frame.data[2])) {
    case Heard::stale: return false;
    case Heard::invalid: transfer_->refuse(sender_.code(), "the server acknowledged what cannot be"); return true;
    case Heard::go_on:
      stop();
      transfer_->data_.consume(sender_.acknowledged());
      if (!transfer_->lingers()) send_sub_block(sender_.size());
      return true;
    default: break;
  }
  transfer_->data_.consume(sender_.acknowledged());
  end_download();
  return true;
}

void SdoTransfer::Block::end_download() noexcept {
  phase_ = Phase::end;
  auto& request = transfer_->request_.frame;
  sdo::put(request, static_cast<std::uint8_t>(0xC1U | (sender_.unused() << 2U)), {});
  store_le(request.data.data() + 1, sender_.crc());
  transfer_->send();
}

// ---- upload

void SdoTransfer::Block::begin_sub_block(unsigned size) {
  receiver_.sub_block(size, transfer_->data_.extend(size * sdo::segment_bytes));
}

bool SdoTransfer::Block::segment(const can::Frame& frame) noexcept {
  auto& answers = transfer_->request_.answers;
  heard_ = transfer_->line_->executor().now();
  // The first check of `lingers`, done here without a call.
  if (heard_ > transfer_->began_ + most_lingering && transfer_->lingers()) return true;
  switch (receiver_.take(frame)) {
    case sdo::BlockReceiver::Heard::more:
      if (answers > 0) --answers;
      break;
    case sdo::BlockReceiver::Heard::ends: acknowledge(); break;
    default: transfer_->refuse(AbortCode::sequence_number, "a segment whose number is not of this sub-block");
  }
  return true;
}

// A sub-block is over. `count` of its bytes belong to the object; the next `unused` bytes do not (yet).
AbortCode SdoTransfer::Block::keep(std::size_t count, std::size_t unused) noexcept {
  const auto bytes = transfer_->data_.filled(count, unused);
  if (crc_used_) crc_ = crc16(bytes, crc_);
  return transfer_->data_.keep(bytes);
}

void SdoTransfer::Block::acknowledge() noexcept {
  // Segments of the sub-block that were not heard will not come any more.
  const unsigned answers = transfer_->request_.answers;
  auto& owed = transfer_->line_->owed_;
  owed -= std::min<unsigned>(owed, answers > 0 ? answers - 1U : 0U);
  const auto good = receiver_.good();
  const bool last = receiver_.complete();
  if (last) std::memcpy(tail_.data(), receiver_.place() - sdo::segment_bytes, sdo::segment_bytes);
  const std::size_t count = (good - (last ? 1U : 0U)) * sdo::segment_bytes;
  auto code = keep(count, receiver_.size() * sdo::segment_bytes - count);
  const bool waits = code == AbortCode::pending;
  if (waits) code = AbortCode::none;
  if (code == AbortCode::none && !receiver_.alive()) code = AbortCode::timeout;
  if (code != AbortCode::none) {
    return transfer_->refuse(code, "the sub-blocks do not fit: too long, without progress, or refused");
  }
  const auto size = receiver_.next_size();
  auto& request = transfer_->request_.frame;
  sdo::put(request, sdo::sub_block_confirmed, {});
  request.data[1] = static_cast<std::uint8_t>(good);
  request.data[2] = static_cast<std::uint8_t>(size);
  if (last) phase_ = Phase::end;
  if (waits) return transfer_->extra_->waiter.wait(Waiter::What::request, last ? 1 : size);
  if (last) return transfer_->send();
  begin_sub_block(size);
  transfer_->send(size);
}

bool SdoTransfer::Block::ended(const can::Frame& frame) noexcept {
  if (!transfer_->data_.is_download()) return end_upload(frame);
  if (frame.data[0] != 0xA1) return false;
  transfer_->complete();
  return true;
}

bool SdoTransfer::Block::end_upload(const can::Frame& frame) noexcept {
  if ((frame.data[0] & 0xE3U) != 0xC1U || receiver_.repeats_last(frame)) return false;
  const std::size_t count = sdo::segment_bytes - ((frame.data[0] >> 2U) & 0x07U);
  std::ranges::copy(tail_, transfer_->data_.extend(sdo::segment_bytes));
  auto code = keep(count, sdo::segment_bytes - count);
  if (code == AbortCode::pending) code = AbortCode::none;  // nothing follows that would have to wait
  if (code != AbortCode::none) {
    transfer_->refuse(code, "more bytes than indicated, or than allowed");
  } else if (transfer_->data_.too_few()) {
    transfer_->refuse(AbortCode::length_too_low, "fewer bytes than indicated");
  } else if (crc_used_ && crc_ != load_le<std::uint16_t>(frame.data.data() + 1)) {
    transfer_->refuse(AbortCode::crc, "the CRC of the block upload is wrong");
  } else {
    phase_ = Phase::closing;
    sdo::put(transfer_->request_.frame, 0xA1, {});
    transfer_->send();
  }
  return true;
}

void SdoTransfer::Block::silence() noexcept {
  const auto timeout = transfer_->options_.timeout;
  const bool heard = receiver_.heard();
  const auto due = heard_ + (heard ? timeout / sdo::block_gap_part : timeout);
  if (transfer_->line_->executor().now() < due) return transfer_->wait_until(due);
  if (!heard) return transfer_->timed_out();
  receiver_.give_up();
  acknowledge();
}

}  // namespace berth::co
