/// What only streams and block transfers of an SDO client need: a part of `SdoTransfer`.
#pragma once

#include "berth/co/sdo_block.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/co/sdo_read_ahead.hpp"

namespace berth::co {

class SdoTransfer::Extra final : public sdo::BlockPump::Owner, public BlockPace::Member, public SdoWaiter {
 public:
  /// What source or sink is waited for with; only an abort of the server's counts meanwhile.
  enum class Wait : std::uint8_t {
    nothing,
    segment,    // the next request of a segmented transfer
    sub_block,  // a block download's next sub-block, of `wait_size` segments
    request,    // `request_`, which is made
  };
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
  void go_on() noexcept override {
    switch (std::exchange(wait, Wait::nothing)) {
      case Wait::segment: return transfer_->next_segment();
      case Wait::sub_block: return transfer_->send_block(wait_size);
      case Wait::request:
        if (transfer_->state_ == State::block) transfer_->begin_sub_block(wait_size);
        return transfer_->send(wait_size);
      default: return;
    }
  }
  SdoTransfer* transfer_;

 public:
  void wait_for(Wait what, unsigned size = 0) noexcept {
    wait = what;
    wait_size = size;
    transfer_->deadline_ = rt::never;
    transfer_->window_ = true;
    pace().wait(this);
  }
  /// The transfer has ended.
  void end() noexcept {
    stop();
    if (std::exchange(wait, Wait::nothing) != Wait::nothing) pace().wait(nullptr);
  }
  [[nodiscard]] SdoPace& pace() noexcept { return source != nullptr ? static_cast<SdoPace&>(*source) : *sink; }

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
  unsigned wait_size = 0;
  Wait wait = Wait::nothing;
  std::uint16_t crc = 0;
  bool crc_used = false;
  bool touched = false;  // bytes were read from the source
};

}  // namespace berth::co
