#include "berth/co/sdo_block.hpp"

#include <algorithm>

#include "berth/co/retry_parts.hpp"

namespace berth::co::sdo {

// ---- sender

void BlockSender::begin(bool with_crc) noexcept {
  *this = BlockSender();
  with_crc_ = with_crc;
}

void BlockSender::sub_block(unsigned size, std::span<const std::uint8_t> window) noexcept {
  window_ = window.data();
  available_ = window.size();
  size_ = static_cast<std::uint8_t>(size);
  // No data at all is one empty segment.
  const auto segments = window.empty() ? 1 : (window.size() + segment_bytes - 1) / segment_bytes;
  count_ = static_cast<std::uint8_t>(std::min<std::size_t>(size, segments));
  ends_ = segments <= size;
  sent_ = confirmed_ = 0;
}

void BlockSender::segment(can::Frame& frame) const noexcept {
  const std::size_t at = sent_ * segment_bytes;
  const unsigned number = sent_ + 1U;
  const auto command = static_cast<std::uint8_t>(number | (ends_ && number == count_ ? 0x80U : 0U));
  if (at + segment_bytes <= available_) return put_segment(frame, command, window_ + at);
  frame.data[0] = command;
  std::memset(frame.data.data() + 1, 0, segment_bytes);
  if (at < available_) std::memcpy(frame.data.data() + 1, window_ + at, available_ - at);
}

BlockSender::Heard BlockSender::acknowledge(unsigned number, unsigned next_size) noexcept {
  // A receiver may end a sub-block by its own time-out while the rest still waits to be sent. Any other acknowledgement
  // that comes before the whole sub-block was sent belongs to the previous sub-block.
  if (!all_out() && number > confirmed_) return Heard::stale;
  if (number > count_) {
    code_ = AbortCode::sequence_number;
    return Heard::invalid;
  }
  acknowledged_ = std::min(number * segment_bytes, available_);
  if (with_crc_) crc_ = crc16({window_, acknowledged_}, crc_);
  const bool finished = ends_ && number == count_;
  if (finished) {
    unused_ = static_cast<std::uint8_t>(number * segment_bytes - acknowledged_);
    return Heard::finished;
  }
  standstill_ = number > 0 ? std::uint8_t{0} : static_cast<std::uint8_t>(standstill_ + 1);
  if (!valid_block_size(next_size)) {
    code_ = AbortCode::block_size;
    return Heard::invalid;
  }
  if (standstill_ >= longest_standstill) {
    code_ = AbortCode::timeout;
    return Heard::invalid;
  }
  size_ = static_cast<std::uint8_t>(next_size);
  return Heard::go_on;
}

// ---- receiver

void BlockReceiver::begin() noexcept { *this = BlockReceiver(); }

void BlockReceiver::sub_block(unsigned size, std::uint8_t* place) noexcept {
  size_ = static_cast<std::uint8_t>(size);
  place_ = place;
  good_ = 0;
  heard_ = lossy_ = false;
}

BlockReceiver::Heard BlockReceiver::end(const can::Frame& frame) noexcept {
  std::memcpy(last_.data(), frame.data.data(), last_.size());
  const unsigned number = frame.data[0] & 0x7FU;
  const bool in_order = number == good_;
  complete_ = in_order && (frame.data[0] & 0x80U) != 0;
  lossy_ = !in_order;
  standstill_ = good_ > 0 ? std::uint8_t{0} : static_cast<std::uint8_t>(standstill_ + 1);
  return Heard::ends;
}

BlockReceiver::Heard BlockReceiver::take_other(const can::Frame& frame) noexcept {
  const unsigned number = frame.data[0] & 0x7FU;
  if (number == 0) return Heard::invalid;
  if (!heard_ && repeats_last(frame)) return Heard::more;
  if (number > size_) return Heard::invalid;
  heard_ = true;
  if (number <= good_) return Heard::more;  // repeated
  if (number == size_ || (frame.data[0] & 0x80U) != 0) return end(frame);
  return Heard::more;
}

bool BlockReceiver::repeats_last(const can::Frame& frame) const noexcept {
  return std::memcmp(last_.data(), frame.data.data(), last_.size()) == 0;
}

void BlockReceiver::give_up() noexcept {
  lossy_ = true;
  standstill_ = good_ > 0 ? std::uint8_t{0} : static_cast<std::uint8_t>(standstill_ + 1);
}

unsigned BlockReceiver::next_size() const noexcept {
  return lossy_ ? std::max<unsigned>(size_ / 2U, std::min<unsigned>(size_, smallest_block)) : size_;
}

// ---- pump

void BlockPump::start(BlockSender& sender, CobId id, rt::Duration patience) noexcept {
  stop();
  sender_ = &sender;
  id_ = id;
  patience_ = patience;
  progress_ = dispatcher_->executor().now();
  push();
}

void BlockPump::stop() noexcept {
  if (pending()) dispatcher_->withdraw(*this);
  cancel();
  sender_ = nullptr;
}

// The first frame of a burst has the confirmation, so that the other frames keep the queue busy until it comes. The
// last frame of all is sent by itself, because it needs a confirmation, too.
void BlockPump::push() noexcept {
  can::Frame frame;
  address(frame, id_);
  const auto before = sender_->sent();
  auto queued = can::Queued::yes;
  const unsigned count = std::clamp(sender_->left() - 1U, 1U, burst);
  for (unsigned i = 0; i < count; ++i) {
    sender_->segment(frame);
    queued = i == 0 ? dispatcher_->send(frame, *this) : dispatcher_->send(frame);
    if (queued != can::Queued::yes) break;
    sender_->advance();
    if (i == 0) confirms_ = static_cast<std::uint8_t>(sender_->sent());
  }
  if (sender_->sent() != before) progress_ = dispatcher_->executor().now();
  if (queued != can::Queued::yes && queued != can::Queued::full) {
    stop();
    return owner_->stuck(queued);
  }
  wait(pending() ? patience_ : std::min(full_retry, patience_ > rt::Duration::zero() ? patience_ : full_retry));
}

void BlockPump::wait(rt::Duration time) noexcept {
  if (time > rt::Duration::zero()) {
    dispatcher_->executor().after(time, *this);
  } else {
    cancel_timer();
  }
}

void BlockPump::sent(rt::Time at) noexcept {
  progress_ = at;
  sender_->confirm(confirms_);
  if (sender_->sending()) return push();
  sender_ = nullptr;
  cancel();
  owner_->pumped(at);
}

void BlockPump::run() noexcept {
  const auto& executor = dispatcher_->executor();
  if (patience_ > rt::Duration::zero() && executor.now() >= progress_ + patience_) {
    stop();
    return owner_->stuck(can::Queued::full);
  }
  if (!pending()) return push();
  dispatcher_->executor().at(progress_ + patience_, *this);
}

}  // namespace berth::co::sdo
