/// Parts of `SdoTransfer` that only streams and block transfers of an SDO client need.
#pragma once

#include "berth/co/sdo_block.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/co/sdo_client_stream.hpp"

namespace berth::co {

/// A transfer that waits for its source or sink; meanwhile only an abort from the server counts.
class SdoTransfer::Waiter final : public SdoWaiter {
 public:
  enum class What : std::uint8_t {
    nothing,
    segment,    // next: the request of a segmented transfer
    sub_block,  // next: a block download's sub-block, of `size` segments
    request,    // next: the request, which is ready; `size` segments may come
  };
  explicit Waiter(SdoTransfer& transfer) noexcept : transfer_(&transfer) {}

  void wait(What what, unsigned size = 0) noexcept;
  [[nodiscard]] bool waits() const noexcept { return what_ != What::nothing; }
  /// The transfer has ended.
  void end() noexcept;

 private:
  void go_on() noexcept override;

  SdoTransfer* transfer_;
  unsigned size_ = 0;
  What what_ = What::nothing;
};

/// A block transfer, once it is initiated (CiA 301 §7.2.4.3.9 to §7.2.4.3.14).
class SdoTransfer::Block final : public sdo::BlockPump::Owner, public BlockPace::Member {
 public:
  Block(SdoTransfer& transfer, can::Dispatcher& dispatcher) noexcept : transfer_(&transfer), pump_(dispatcher, *this) {}
  ~Block() { stop(); }
  /// Sends no more segments.
  void stop() noexcept;

  void prepare_initiate() noexcept;
  void initiated(const can::Frame& frame) noexcept;
  /// See `SdoTransfer::answer`.
  bool answer(const can::Frame& frame) noexcept;
  /// The request is on the wire.
  void request_sent(rt::Time at) noexcept { heard_ = at; }
  /// Download: sends the next sub-block, of `size` segments.
  void send_sub_block(unsigned size) noexcept;
  /// Upload: expects the next sub-block.
  void begin_sub_block(unsigned size);
  /// Silence for a while: acknowledges the part of a sub-block that came; if none came, acknowledges nothing.
  void silence() noexcept;

  /// True while segments come in.
  [[nodiscard]] bool collecting() const noexcept {
    return phase_ == Phase::sub_blocks && !transfer_->data_.is_download();
  }
  /// True while the confirmation of an upload's end is being sent; nothing comes after it.
  [[nodiscard]] bool closing() const noexcept { return phase_ == Phase::closing; }
  /// Bytes of the sub-block that is not acknowledged yet.
  [[nodiscard]] std::size_t collected() const noexcept {
    return collecting() ? receiver_.good() * sdo::segment_bytes : 0U;
  }

 private:
  enum class Phase : std::uint8_t {
    sub_blocks,  // sub-blocks are sent or received
    end,         // all segments are done; the end is to be confirmed, or to come
    closing,
  };
  void turn() noexcept override;
  void pumped(rt::Time at) noexcept override;
  void stuck(can::Queued why) noexcept override;
  bool acknowledged(const can::Frame& frame) noexcept;
  void end_download() noexcept;
  bool segment(const can::Frame& frame) noexcept;
  void acknowledge() noexcept;
  [[nodiscard]] AbortCode keep(std::size_t count, std::size_t unused) noexcept;
  bool end_upload(const can::Frame& frame) noexcept;
  bool ended(const can::Frame& frame) noexcept;

  SdoTransfer* transfer_;
  sdo::BlockSender sender_;
  sdo::BlockReceiver receiver_;
  sdo::BlockPump pump_;
  std::array<std::uint8_t, sdo::segment_bytes> tail_{};  // the last segment, until its number of valid bytes is known
  rt::Time heard_{};                                     // when the newest segment came
  std::uint16_t crc_ = 0;
  bool crc_used_ = false;
  Phase phase_ = Phase::sub_blocks;
};

struct SdoTransfer::Extra {
  Extra(SdoTransfer& transfer, can::Dispatcher& dispatcher) noexcept : waiter(transfer), block(transfer, dispatcher) {}

  SdoClientStream stream;
  Waiter waiter;
  Block block;
};

}  // namespace berth::co
