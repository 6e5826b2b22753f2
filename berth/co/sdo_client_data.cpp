#include "berth/co/sdo_client_data.hpp"

#include "berth/co/sdo_client_stream.hpp"

namespace berth::co {

void SdoClientData::use(SdoClientStream& stream) noexcept {
  stream_ = &stream;
  download_ = stream.source != nullptr;
}

bool SdoClientData::rewind() noexcept {
  if (stream_ == nullptr || !download_) return true;
  if (stream_->touched && !stream_->source->rewind()) return false;
  stream_->touched = false;
  stream_->ahead.begin(stream_->stash);
  return true;
}

// ---- download

std::optional<std::size_t> SdoClientData::size() const noexcept {
  return stream_ != nullptr ? stream_->source->size() : std::optional(bytes_.size());
}

od::Answer<std::span<const std::uint8_t>> SdoClientData::stream_window(std::size_t count) noexcept {
  auto& stream = *stream_;
  stream.touched = true;
  const auto size = stream.source->size();
  const auto left = size ? *size - offset_ : count + 1;
  const auto wanted = std::min(count + 1, left);
  const auto bytes = stream.ahead.want(wanted, stream.source->ready(),
                                       [&stream](std::span<std::uint8_t> into) { return stream.source->read(into); });
  if (!bytes || !size) return bytes;
  if (bytes->size() < wanted) return od::refuse(AbortCode::no_data);
  return bytes->first(std::min(bytes->size(), left));
}

void SdoClientData::consume(std::size_t count) noexcept {
  offset_ += count;
  if (stream_ != nullptr) stream_->ahead.consume(count);
}

// ---- upload

AbortCode SdoClientData::open(bool sized, std::size_t size) noexcept {
  sized_ = sized;
  indicated_ = size;
  if (stream_ != nullptr) return stream_->sink->begin(sized ? std::optional(size) : std::nullopt);
  if (size > longest_) return AbortCode::out_of_memory;
  value_.reserve(size);
  return AbortCode::none;
}

AbortCode SdoClientData::expedited(const std::uint8_t* from, std::size_t count, bool sized) noexcept {
  unsized_ = !sized;
  if (stream_ == nullptr) {
    value_.set_expedited(from, count);
    return AbortCode::none;
  }
  const auto code = open(sized, count);
  if (code != AbortCode::none) return code == AbortCode::pending ? AbortCode::general : code;
  return stream_->sink->write({from, count});
}

AbortCode SdoClientData::put(std::span<const std::uint8_t> bytes) noexcept {
  if (stream_ == nullptr) {
    if (offset_ + bytes.size() > longest_) return AbortCode::out_of_memory;
    value_.append(bytes);
  }
  offset_ += bytes.size();
  return stream_ != nullptr && !bytes.empty() ? stream_->sink->write(bytes) : AbortCode::none;
}

std::uint8_t* SdoClientData::extend(std::size_t count) {
  return stream_ != nullptr ? stream_->stash.data() : value_.extend(count);
}

std::span<const std::uint8_t> SdoClientData::filled(std::size_t count, std::size_t unused) noexcept {
  if (stream_ != nullptr) return {stream_->stash.data(), count};
  value_.drop_back(unused);
  return value_.bytes().last(count);
}

AbortCode SdoClientData::keep(std::span<const std::uint8_t> filled) noexcept {
  offset_ += filled.size();
  if (sized_ && offset_ > indicated_) return AbortCode::length_too_high;
  if (stream_ == nullptr) return offset_ > longest_ ? AbortCode::out_of_memory : AbortCode::none;
  return filled.empty() ? AbortCode::none : stream_->sink->write(filled);
}

}  // namespace berth::co
