/// The block transfers of an SDO server (CiA 301 §7.2.4.3.9 to §7.2.4.3.14): sub-blocks, CRC and block size. The
/// server decides which frame may come when.
#pragma once

#include "berth/co/sdo_block.hpp"
#include "berth/co/sdo_server_data.hpp"

namespace berth::co {

class SdoServerBlock {
 public:
  /// An outgoing sub-block.
  [[nodiscard]] sdo::BlockSender& sender() noexcept { return sender_; }
  [[nodiscard]] const sdo::BlockSender& sender() const noexcept { return sender_; }
  /// An incoming sub-block.
  [[nodiscard]] sdo::BlockReceiver& receiver() noexcept { return receiver_; }
  [[nodiscard]] const sdo::BlockReceiver& receiver() const noexcept { return receiver_; }

  // Download. `pending`: accepted, but the answer waits for the stream, or at the end for the dictionary.
  [[nodiscard]] AbortCode begin_download(const can::Frame& request, can::Frame& answer, SdoServerData& data) noexcept;
  /// Ends the sub-block, and begins the next unless it was the last (`receiver().complete()`).
  [[nodiscard]] AbortCode acknowledge(can::Frame& answer, SdoServerData& data) noexcept;
  [[nodiscard]] AbortCode end_download(const can::Frame& request, can::Frame& answer, SdoServerData& data) noexcept;

  // Upload
  /// Takes the client's request; false: invalid block size.
  [[nodiscard]] bool begin_upload(const can::Frame& request) noexcept;
  /// The object is open, with this size if known.
  void put_initiated(can::Frame& answer, ObjectRef ref, std::optional<std::size_t> size) noexcept;
  /// Gives the next sub-block to `sender()`. `pending`: the stream has too few bytes yet.
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
  std::uint8_t block_size_ = 0;  // upload: the client's newest request
  std::uint16_t crc_ = 0;        // download: of the committed bytes
};

}  // namespace berth::co
