/// The block transfers of an SDO server (CiA 301 §7.2.4.3.9 to §7.2.4.3.14): sub-blocks, CRC and block size. Which
/// frame may come when is the server's affair.
#pragma once

#include "berth/co/sdo_block.hpp"
#include "berth/co/sdo_server_data.hpp"

namespace berth::co {

class SdoServerBlock {
 public:
  /// A sub-block that goes out.
  [[nodiscard]] sdo::BlockSender& sender() noexcept { return sender_; }
  [[nodiscard]] const sdo::BlockSender& sender() const noexcept { return sender_; }
  /// A sub-block that comes in.
  [[nodiscard]] sdo::BlockReceiver& receiver() noexcept { return receiver_; }
  [[nodiscard]] const sdo::BlockReceiver& receiver() const noexcept { return receiver_; }

  // Download. `pending`: a yes whose answer waits for the stream, or at the end for the dictionary.
  [[nodiscard]] AbortCode begin_download(const can::Frame& request, can::Frame& answer, SdoServerData& data) noexcept;
  /// The sub-block is over, and the next one begins unless it was the last (`receiver().complete()`).
  [[nodiscard]] AbortCode acknowledge(can::Frame& answer, SdoServerData& data) noexcept;
  [[nodiscard]] AbortCode end_download(const can::Frame& request, can::Frame& answer, SdoServerData& data) noexcept;

  // Upload
  /// What the client asks for; false: no valid block size.
  [[nodiscard]] bool begin_upload(const can::Frame& request) noexcept;
  /// The object is open, with this size if that is known.
  void put_initiated(can::Frame& answer, ObjectRef ref, std::optional<std::size_t> size) noexcept;
  /// The next sub-block is `sender()`'s. `pending`: the stream has too little yet.
  [[nodiscard]] AbortCode next_sub_block(SdoServerData& data) noexcept;
  [[nodiscard]] sdo::BlockSender::Heard acknowledged(const can::Frame& request, SdoServerData& data) noexcept;
  void put_end(can::Frame& answer) const noexcept;

 private:
  [[nodiscard]] unsigned crc_bit() const noexcept { return crc_used_ ? 0x04U : 0x00U; }
  [[nodiscard]] AbortCode commit(SdoServerData& data) noexcept;
  [[nodiscard]] AbortCode ask_for_next(SdoServerData& data) noexcept;

  sdo::BlockSender sender_;
  sdo::BlockReceiver receiver_;
  bool crc_used_ = false;
  std::uint8_t block_size_ = 0;  // upload: what the client asked for last
  std::uint16_t crc_ = 0;        // download: of what is committed
};

}  // namespace berth::co
