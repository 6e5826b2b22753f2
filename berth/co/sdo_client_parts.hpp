/// What only streams and block transfers of an SDO client need: a part of `SdoTransfer`.
#pragma once

#include "berth/co/sdo_block.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/co/sdo_read_ahead.hpp"

namespace berth::co {

class SdoTransfer::Extra final : public sdo::BlockPump::Owner, public BlockPace::Member {
 public:
  Extra(SdoTransfer& transfer, can::Dispatcher& dispatcher) noexcept : transfer_(&transfer), pump(dispatcher, *this) {}
  ~Extra() { stop(); }
  /// No more segments are sent.
  void stop() noexcept {
    pump.stop();
    if (transfer_->options_.pace != nullptr) transfer_->options_.pace->leave(*this);
  }
  /// The sub-block goes out.
  void turn() noexcept override { pump.start(sender, transfer_->line_->request_, transfer_->options_.send_timeout); }

 private:
  void pumped(rt::Time at) noexcept override { transfer_->pumped(at); }
  void stuck(can::Queued why) noexcept override { transfer_->stuck(why); }
  SdoTransfer* transfer_;

 public:
  SdoSource* source = nullptr;
  SdoSink* sink = nullptr;
  ReadAhead ahead;
  std::array<std::uint8_t, sdo::block_window> stash;    // of a source: read ahead; of a sink: the sub-block
  std::array<std::uint8_t, sdo::segment_bytes> tail{};  // the last segment, until it is known what of it counts
  std::uint8_t* place = nullptr;                        // where the sub-block coming in begins
  sdo::BlockSender sender;
  sdo::BlockReceiver receiver;
  sdo::BlockPump pump;
  rt::Time heard{};  // the newest segment
  std::uint16_t crc = 0;
  bool crc_used = false;
  bool touched = false;  // bytes were read from the source
};

}  // namespace berth::co
