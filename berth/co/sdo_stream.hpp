/// Where an SDO client's transfer of any length takes its bytes from and puts them, so that a DOMAIN of 100 MB needs no
/// 100 MB: `client.download(node, index, sub, source)`, `client.upload(node, index, sub, sink)`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "berth/od/abort_code.hpp"

namespace berth::co {

/// Gives the bytes of a download. Called from the transfer, never after it has ended.
class SdoSource {
 public:
  /// In bytes when it is known: then exactly so many are read.
  [[nodiscard]] virtual std::optional<std::size_t> size() const noexcept { return std::nullopt; }
  /// Fills `into` from the beginning and says how many bytes that are; fewer than asked for = the end. A refusal
  /// aborts the transfer with that code.
  virtual od::Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept = 0;
  /// The transfer begins anew (`SdoOptions::retries`) after bytes were read. False: this source cannot.
  virtual bool rewind() noexcept { return false; }

 protected:
  ~SdoSource() = default;
};

/// Takes the bytes of an upload.
class SdoSink {
 public:
  /// The upload begins, or begins anew; `size` as the server indicated it. A refusal aborts the transfer.
  virtual od::AbortCode begin(std::optional<std::size_t> size) noexcept {
    static_cast<void>(size);
    return od::AbortCode::none;
  }
  /// The next bytes, never empty. They are right only when the whole transfer ends well (CRC, length).
  virtual od::AbortCode write(std::span<const std::uint8_t> bytes) noexcept = 0;

 protected:
  ~SdoSink() = default;
};

}  // namespace berth::co
