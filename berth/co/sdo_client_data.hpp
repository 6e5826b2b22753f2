/// The bytes of one transfer of an SDO client: where those of a download come from and those of an upload go, how many
/// are done, and how many the server said there are. It knows no frames.
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
  /// By the stream's source or sink, whichever it has; the stream must stay.
  void use(SdoClientStream& stream) noexcept;
  void expect_at_most(std::size_t bytes) noexcept { longest_ = std::min(longest_, bytes); }

  [[nodiscard]] bool is_download() const noexcept { return download_; }
  [[nodiscard]] bool streamed() const noexcept { return stream_ != nullptr; }
  /// What was uploaded, unless streamed.
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
  /// Streams, beside `begin`: false when the source cannot give its bytes once more.
  [[nodiscard]] bool rewind() noexcept;

  // Download
  /// Of all bytes; empty when the source does not know.
  [[nodiscard]] std::optional<std::size_t> size() const noexcept;
  /// What follows: more than `count` bytes, or all that are left. `pending`: the source has to be waited for.
  [[nodiscard]] od::Answer<std::span<const std::uint8_t>> window(std::size_t count) noexcept {
    if (stream_ == nullptr) return bytes_.subspan(offset_);
    return stream_window(count);
  }
  void consume(std::size_t count) noexcept;
  /// The next seven bytes when they are at hand and more follow: then they are consumed. Else null, and `window` says.
  [[nodiscard]] const std::uint8_t* quick_window() noexcept {
    if (stream_ != nullptr || bytes_.size() - offset_ <= sdo::segment_bytes) return nullptr;
    return bytes_.data() + std::exchange(offset_, offset_ + sdo::segment_bytes);
  }

  // Upload. A refusal is for the server; `pending`: taken, and the sink has to be waited for.
  /// Longer than four bytes, or of unknown size.
  [[nodiscard]] AbortCode open(bool sized, std::size_t size) noexcept;
  /// Why `open`, or `put`, refused, in words.
  [[nodiscard]] const char* refusal() const noexcept {
    return streamed() ? "the sink refused the upload" : "the object is longer than allowed";
  }
  /// All of it: `count` of the four bytes at `from`.
  [[nodiscard]] AbortCode expedited(const std::uint8_t* from, std::size_t count, bool sized) noexcept;
  [[nodiscard]] AbortCode put(std::span<const std::uint8_t> bytes) noexcept;
  /// Seven bytes, when nothing speaks against them: then they are taken. False: go by `too_many` and `put`.
  [[nodiscard]] bool quick_put(const std::uint8_t* from) noexcept {
    const std::size_t end = offset_ + sdo::segment_bytes;
    if (stream_ != nullptr || end > longest_ || too_many(sdo::segment_bytes)) return false;
    value_.append_segment(from);
    offset_ = end;
    return true;
  }
  /// So many bytes more would be more than the server said; all that came are fewer.
  [[nodiscard]] bool too_many(std::size_t more) const noexcept { return sized_ && offset_ + more > indicated_; }
  [[nodiscard]] bool too_few() const noexcept { return sized_ && offset_ < indicated_; }
  /// Room for the next `count` bytes, to be filled in; `keep` must follow.
  [[nodiscard]] std::uint8_t* extend(std::size_t count);
  /// Of the room that `extend` gave, the first `count` bytes; the `unused` after them are not the object's.
  [[nodiscard]] std::span<const std::uint8_t> filled(std::size_t count, std::size_t unused) noexcept;
  /// They are the object's, as it seems.
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
