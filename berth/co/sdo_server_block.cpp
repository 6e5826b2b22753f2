#include "berth/co/sdo_server_block.hpp"

namespace berth::co {

namespace {
constexpr std::uint8_t download_ended = 0xA1;
}  // namespace

// ---- download

AbortCode SdoServerBlock::begin_download(const can::Frame& request, can::Frame& answer, SdoServerData& data) noexcept {
  const bool sized = (request.data[0] & 0x02U) != 0;
  crc_used_ = (request.data[0] & 0x04U) != 0;
  crc_ = 0;
  const auto ref = sdo::multiplexer(request);
  const auto size = sized ? std::optional<std::size_t>(load_le<std::uint32_t>(request.data.data() + 4)) : std::nullopt;
  const auto code = data.open_write(ref, size);
  if (code != AbortCode::none && code != AbortCode::pending) return code;
  receiver_.begin();
  receiver_.sub_block(sdo::longest_block, nullptr);
  const auto placed = ask_for_next(data);
  sdo::put(answer, static_cast<std::uint8_t>(0xA0U | crc_bit()), ref, receiver_.size());
  return placed != AbortCode::none ? placed : code;
}

// Asks for the next sub-block, as large as the buffer allows.
AbortCode SdoServerBlock::ask_for_next(SdoServerData& data) noexcept {
  const auto size = data.segments(receiver_.next_size());
  const auto place = data.place(size * sdo::segment_bytes);
  if (!place) return place.error();
  receiver_.sub_block(size, *place);
  return AbortCode::none;
}

// How many bytes of the last segment count is not known yet.
AbortCode SdoServerBlock::commit(SdoServerData& data) noexcept {
  const std::size_t count = (receiver_.good() - (receiver_.complete() ? 1U : 0U)) * sdo::segment_bytes;
  const auto code = data.commit(count);
  if (crc_used_) crc_ = crc16({receiver_.place() - receiver_.good() * sdo::segment_bytes, count}, crc_);
  return code;
}

AbortCode SdoServerBlock::acknowledge(can::Frame& answer, SdoServerData& data) noexcept {
  const auto good = receiver_.good();
  auto code = receiver_.alive() ? commit(data) : AbortCode::timeout;
  if (code == AbortCode::none && !receiver_.complete()) code = ask_for_next(data);
  if (code == AbortCode::none) code = data.ready();
  sdo::put(answer, sdo::sub_block_confirmed, {});
  answer.data[1] = static_cast<std::uint8_t>(good);
  answer.data[2] = static_cast<std::uint8_t>(receiver_.size());
  return code;
}

AbortCode SdoServerBlock::end_download(const can::Frame& request, can::Frame& answer, SdoServerData& data) noexcept {
  const std::size_t count = sdo::segment_bytes - ((request.data[0] >> 2U) & 0x07U);
  const std::uint8_t* const last = receiver_.place() - sdo::segment_bytes;
  if (crc_used_ && crc16({last, count}, crc_) != load_le<std::uint16_t>(request.data.data() + 1)) {
    return AbortCode::crc;
  }
  const auto code = data.commit(count);
  sdo::put(answer, download_ended, {});
  return code == AbortCode::none ? data.close_write() : code;
}

// ---- upload

bool SdoServerBlock::begin_upload(const can::Frame& request) noexcept {
  block_size_ = request.data[4];
  crc_used_ = (request.data[0] & 0x04U) != 0;
  return sdo::valid_block_size(block_size_);
}

void SdoServerBlock::put_initiated(can::Frame& answer, ObjectRef ref, std::optional<std::size_t> size) noexcept {
  sender_.begin(crc_used_);
  const unsigned sized = size ? 0x02U : 0x00U;
  sdo::put(answer, static_cast<std::uint8_t>(0xC0U | crc_bit() | sized), ref,
           static_cast<std::uint32_t>(size.value_or(0)));
}

AbortCode SdoServerBlock::next_sub_block(SdoServerData& data) noexcept {
  const auto window = data.window(block_size_ * sdo::segment_bytes);
  if (!window) return window.error();
  sender_.sub_block(block_size_, *window);
  return AbortCode::none;
}

sdo::BlockSender::Heard SdoServerBlock::acknowledged(const can::Frame& request, SdoServerData& data) noexcept {
  const auto heard = sender_.acknowledge(request.data[1], request.data[2]);
  if (heard == sdo::BlockSender::Heard::go_on) {
    data.consume(sender_.acknowledged());
    block_size_ = request.data[2];
  }
  return heard;
}

void SdoServerBlock::put_end(can::Frame& answer) const noexcept {
  sdo::put(answer, static_cast<std::uint8_t>(0xC1U | (sender_.unused() << 2U)), {});
  store_le(answer.data.data() + 1, sender_.crc());
}

}  // namespace berth::co
