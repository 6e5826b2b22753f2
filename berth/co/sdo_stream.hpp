/// Sources and sinks for transfers of any length of an SDO client, so that a DOMAIN of 100 MB needs no 100 MB:
/// `client.download(node, index, sub, source)`, `client.upload(node, index, sub, sink)`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "berth/od/abort_code.hpp"

namespace berth::co {

/// A transfer that waits for its source or sink.
class SdoWaiter {
 public:
  virtual void go_on() noexcept = 0;

 protected:
  ~SdoWaiter() = default;
};

/// Lets a source or sink that is not always ready continue its transfer.
class SdoPace {
 public:
  /// Call after `pending`, or after `SdoSource::ready` gave too few bytes: the transfer goes on, from within this call.
  /// Harmless when none waits.
  void go_on() noexcept {
    if (waiter_ != nullptr) std::exchange(waiter_, nullptr)->go_on();
  }
  /// For the transfer only: what waits; null = nothing.
  void wait(SdoWaiter* waiter) noexcept { waiter_ = waiter; }

 protected:
  ~SdoPace() = default;

 private:
  SdoWaiter* waiter_ = nullptr;
};

/// Gives the bytes of a download. The transfer calls it, never after it has ended.
class SdoSource : public SdoPace {
 public:
  /// The size in bytes, if known: then exactly so many are read.
  [[nodiscard]] virtual std::optional<std::size_t> size() const noexcept { return std::nullopt; }
  /// Fills `into` from the beginning and returns the number of bytes; fewer than asked for = the end. A refusal aborts
  /// the transfer with that code.
  virtual od::Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept = 0;
  /// How many bytes `read` can give at once; the transfer asks for no more. SIZE_MAX: all that are asked for, or the
  /// end. If they are too few, the transfer waits for `go_on`, without a time-out of its own.
  [[nodiscard]] virtual std::size_t ready() const noexcept { return std::numeric_limits<std::size_t>::max(); }
  /// The transfer begins anew (`SdoOptions::retries`) after bytes were read. False: this source cannot rewind.
  virtual bool rewind() noexcept { return false; }

 protected:
  ~SdoSource() = default;
};

/// Takes the bytes of an upload.
class SdoSink : public SdoPace {
 public:
  /// The upload begins, or begins anew; `size` as the server indicated it. A refusal aborts the transfer.
  virtual od::AbortCode begin(std::optional<std::size_t> size) noexcept {
    static_cast<void>(size);
    return od::AbortCode::none;
  }
  /// The next bytes, never empty. They are valid only when the whole transfer ends well (CRC, length). `pending`:
  /// taken, but no more until `go_on`; the transfer waits without a time-out of its own.
  virtual od::AbortCode write(std::span<const std::uint8_t> bytes) noexcept = 0;

 protected:
  ~SdoSink() = default;
};

}  // namespace berth::co
