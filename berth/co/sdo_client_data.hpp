/// The bytes of one transfer of an SDO client: source of a download or destination of an upload, how many are done, and
/// the size that the server indicated. It knows no frames.
#pragma once

#include <optional>
#include <span>

#include "berth/co/sdo.hpp"
#include "berth/co/sdo_stream.hpp"

namespace berth::co {

struct SdoClientStream;

class SdoClientData {
 public:
  /// An upload into a value of at most `longest` bytes.
  explicit SdoClientData(std::size_t longest) noexcept : longest_(longest) {}
  /// A download of these bytes, which must stay.
  void download(std::span<const std::uint8_t> bytes) noexcept {
    bytes_ = bytes;
    download_ = true;
  }
  /// Uses the stream's source or sink, whichever it has; the stream must stay.
  void use(SdoClientStream& stream) noexcept;
  void expect_at_most(std::size_t bytes) noexcept { longest_ = std::min(longest_, bytes); }

  [[nodiscard]] bool is_download() const noexcept { return download_; }
  [[nodiscard]] bool streamed() const noexcept { return stream_ != nullptr; }
  /// The uploaded value, unless streamed.
  [[nodiscard]] SdoValue& value() noexcept { return value_; }
  /// The server did not say how many of the four expedited bytes count.
  [[nodiscard]] bool unsized() const noexcept { return unsized_; }
  /// Bytes that are done.
  [[nodiscard]] std::size_t done() const noexcept { return offset_; }

  /// An attempt begins.
  void begin() noexcept {
    value_.clear();
    offset_ = indicated_ = 0;
    unsized_ = sized_ = false;
  }
  /// For streams, in addition to `begin`: false when the source cannot give its bytes again.
  [[nodiscard]] bool rewind() noexcept;

  // Download
  /// Size of all bytes; empty when the source does not know.
  [[nodiscard]] std::optional<std::size_t> size() const noexcept;
  /// The next bytes: more than `count`, or all that are left. `pending`: the transfer must wait for the source.
  [[nodiscard]] od::Answer<std::span<const std::uint8_t>> window(std::size_t count) noexcept {
    if (stream_ == nullptr) return bytes_.subspan(offset_);
    return stream_window(count);
  }
  void consume(std::size_t count) noexcept;
  /// The next seven bytes, and consumes them, if they are available and more follow. Else null: use `window`.
  [[nodiscard]] const std::uint8_t* quick_window() noexcept {
    if (stream_ != nullptr || bytes_.size() - offset_ <= sdo::segment_bytes) return nullptr;
    return bytes_.data() + std::exchange(offset_, offset_ + sdo::segment_bytes);
  }

  // Upload. A refusal is sent to the server; `pending`: taken, but the transfer must wait for the sink.
  /// Begins an upload longer than four bytes, or of unknown size.
  [[nodiscard]] AbortCode open(bool sized, std::size_t size) noexcept;
  /// Why `open` or `put` refused, in words.
  [[nodiscard]] const char* refusal() const noexcept {
    return streamed() ? "the sink refused the upload" : "the object is longer than allowed";
  }
  /// The complete value: `count` of the four bytes at `from`.
  [[nodiscard]] AbortCode expedited(const std::uint8_t* from, std::size_t count, bool sized) noexcept;
  [[nodiscard]] AbortCode put(std::span<const std::uint8_t> bytes) noexcept;
  /// Takes seven bytes in the common case. False: use `too_many` and `put`.
  [[nodiscard]] bool quick_put(const std::uint8_t* from) noexcept {
    const std::size_t end = offset_ + sdo::segment_bytes;
    if (stream_ != nullptr || end > longest_ || too_many(sdo::segment_bytes)) return false;
    value_.append_segment(from);
    offset_ = end;
    return true;
  }
  /// True if so many more bytes would exceed the indicated size.
  [[nodiscard]] bool too_many(std::size_t more) const noexcept { return sized_ && offset_ + more > indicated_; }
  [[nodiscard]] bool too_few() const noexcept { return sized_ && offset_ < indicated_; }
  /// Room for the next `count` bytes, to be filled in; `keep` must follow.
  [[nodiscard]] std::uint8_t* extend(std::size_t count);
  /// The first `count` bytes of the room that `extend` gave; the `unused` bytes after them do not belong to the object.
  [[nodiscard]] std::span<const std::uint8_t> filled(std::size_t count, std::size_t unused) noexcept;
  /// These bytes seem to belong to the object.
  [[nodiscard]] AbortCode keep(std::span<const std::uint8_t> filled) noexcept;

 private:
  [[nodiscard]] od::Answer<std::span<const std::uint8_t>> stream_window(std::size_t count) noexcept;

  std::span<const std::uint8_t> bytes_;
  SdoValue value_;
  SdoClientStream* stream_ = nullptr;
  std::size_t longest_;
  std::size_t offset_ = 0;
  std::size_t indicated_ = 0;
  bool sized_ = false;  // indicated_ means something
  bool unsized_ = false;
  bool download_ = false;
};

}  // namespace berth::co
