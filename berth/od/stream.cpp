#include "berth/od/stream.hpp"

#include <limits>

#include "berth/od/values.hpp"

namespace berth::od {

Stream& Stream::of(std::uint8_t) noexcept { return *this; }
std::size_t Stream::ready() const noexcept { return std::numeric_limits<std::size_t>::max(); }
std::size_t Stream::piece() const noexcept { return std::numeric_limits<std::size_t>::max(); }

std::size_t Stream::sub_block() const noexcept { return longest_piece; }
ObjectRef Stream::named(ObjectRef ref) const noexcept { return ref; }
Answer<std::optional<std::size_t>> Stream::open_read(ObjectRef) noexcept {
  return refuse(AbortCode::unsupported_access);
}
Answer<std::size_t> Stream::read(std::span<std::uint8_t>) noexcept { return std::size_t{0}; }
AbortCode Stream::open_write(ObjectRef, std::optional<std::size_t>) noexcept { return AbortCode::unsupported_access; }
AbortCode Stream::write(std::span<const std::uint8_t>) noexcept { return AbortCode::not_stored; }
AbortCode Stream::close(ObjectRef, bool) noexcept { return AbortCode::none; }

Stream::~Stream() {
  if (values_ != nullptr) values_->detach(*this);
  if (use_ != nullptr) use_->stream_ = nullptr;
}

bool StreamUse::take(Stream& stream, ObjectRef ref) noexcept {
  drop();
  if (stream.use_ != nullptr) return false;
  stream.use_ = this;
  stream_ = &stream;
  ref_ = ref;
  open_ = true;
  return true;
}

void StreamUse::release() noexcept {
  if (stream_ != nullptr) stream_->use_ = nullptr;
  stream_ = nullptr;
  open_ = false;
}

Answer<std::optional<std::size_t>> StreamUse::open_read(Stream& stream, ObjectRef ref) noexcept {
  if (!take(stream, ref)) return refuse(AbortCode::device_state);
  const auto size = stream.open_read(ref);
  if (!size) release();
  return size;
}

AbortCode StreamUse::open_write(Stream& stream, ObjectRef ref, std::optional<std::size_t> size) noexcept {
  if (!take(stream, ref)) return AbortCode::device_state;
  const auto code = stream.open_write(ref, size);
  if (code != AbortCode::none && code != AbortCode::pending) release();
  return code;
}

Answer<std::size_t> StreamUse::read(std::span<std::uint8_t> into) noexcept {
  if (stream_ == nullptr) return refuse(AbortCode::not_stored);
  return stream_->read(into);
}

std::size_t StreamUse::ready() const noexcept {
  return stream_ != nullptr ? stream_->ready() : std::numeric_limits<std::size_t>::max();
}

std::size_t StreamUse::sub_block() const noexcept {
  return stream_ != nullptr ? stream_->sub_block() : Stream::longest_piece;
}

std::size_t StreamUse::piece() const noexcept {
  return stream_ != nullptr ? stream_->piece() : std::numeric_limits<std::size_t>::max();
}

AbortCode StreamUse::write(std::span<const std::uint8_t> bytes) noexcept {
  return stream_ != nullptr ? stream_->write(bytes) : AbortCode::not_stored;
}

AbortCode StreamUse::close(bool complete) noexcept {
  Stream* const stream = stream_;
  const auto code = stream != nullptr ? stream->close(ref_, complete) : AbortCode::not_stored;
  release();
  return code;
}

}  // namespace berth::od
