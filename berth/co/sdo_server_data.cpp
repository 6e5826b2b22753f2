#include "berth/co/sdo_server_data.hpp"

#include <algorithm>
#include <limits>

#include "berth/co/sdo_block.hpp"

namespace berth::co {
namespace {

constexpr std::size_t no_limit = std::numeric_limits<std::size_t>::max();

// True: some object may have to be moved piece by piece.
bool has_long_values(const od::Description& description, std::size_t buffer) noexcept {
  return std::ranges::any_of(description.subs(), [buffer](const od::SubObject& sub) {
    return sub.type == od::DataType::domain || (sub.variable_length() && sub.capacity > buffer);
  });
}

}  // namespace

// The buffer has room for one segment more: the last segment is stored whole, however few of its bytes count.
SdoServerData::SdoServerData(od::Values& values, std::size_t buffer, std::uint8_t channel)
    : values_(&values),
      capacity_(buffer),
      reserve_((has_long_values(values.description(), buffer) ? std::max(buffer, sdo::block_window) : buffer) +
               sdo::segment_bytes),
      channel_(channel) {
  buffer_ = std::make_unique<std::uint8_t[]>(reserve_);
}

// ---- upload

AbortCode SdoServerData::open_read(ObjectRef ref) noexcept {
  drop();
  ref_ = ref;
  offset_ = 0;
  if (od::Stream* const stream = values().stream(ref)) return open_stream(*stream);
  return open_value(values_->view(ref));
}

AbortCode SdoServerData::open_read(ObjectRef ref, std::span<const std::uint8_t>& expedited) noexcept {
  drop();
  const auto value = values().view(ref);
  if (value && value->size() - 1 < 4) {
    expedited = *value;
    return AbortCode::none;
  }
  if (values_->stream(ref) != nullptr) return open_read(ref);
  ref_ = ref;
  offset_ = 0;
  return open_value(value);
}

AbortCode SdoServerData::open_stream(od::Stream& stream) noexcept {
  kind_ = Kind::stream;
  const auto code = values_->check_read(ref_);
  if (code != AbortCode::none) return code;
  const auto size = stream_.open_read(stream, ref_);
  if (!size) return size.error();
  sized_ = size->has_value();
  size_ = size->value_or(0);
  ahead_.begin(all());
  return AbortCode::none;
}

AbortCode SdoServerData::open_value(const od::Answer<std::span<const std::uint8_t>>& value) noexcept {
  if (!value) return value.error() == AbortCode::pending ? AbortCode::general : value.error();
  sized_ = true;
  size_ = value->size();
  kind_ = size_ <= capacity_ ? Kind::buffer : Kind::view;
  if (kind_ == Kind::buffer && size_ > 0) std::memcpy(buffer_.get(), value->data(), size_);
  return AbortCode::none;
}

od::Answer<std::span<const std::uint8_t>> SdoServerData::far_window(std::size_t count) noexcept {
  const std::size_t wanted = std::min(count + 1, sized_ ? size_ - offset_ : no_limit);
  if (wanted > reserve_) return od::refuse(AbortCode::out_of_memory);
  if (kind_ == Kind::view) {
    const auto value = values_->view(ref_);
    if (!value) return od::refuse(value.error());
    if (value->size() != size_) return od::refuse(AbortCode::device_state);
    std::memcpy(buffer_.get(), value->data() + offset_, wanted);
    return std::span<const std::uint8_t>(buffer_.get(), wanted);
  }
  auto bytes =
      ahead_.want(wanted, stream_.ready(), [this](std::span<std::uint8_t> into) { return stream_.read(into); });
  if (!bytes || !sized_) return bytes;
  // A stream that announced a size must give that many bytes.
  if (bytes->size() < wanted) return od::refuse(AbortCode::device_state);
  return bytes->first(std::min(bytes->size(), size_ - offset_));
}

void SdoServerData::close_read() noexcept {
  if (stream_.open()) static_cast<void>(stream_.close(true));
}

// ---- download

AbortCode SdoServerData::open_write(ObjectRef ref, std::optional<std::size_t> size) noexcept {
  drop();
  ref_ = ref;
  offset_ = filled_ = 0;
  waits_ = false;
  sized_ = size.has_value();
  size_ = size.value_or(0);
  kind_ = Kind::buffer;
  const auto code = sized_ ? values().check_write(ref, size_) : values().check_write(ref);
  if (code != AbortCode::none) return code;
  if (od::Stream* const stream = values_->stream(ref)) {
    kind_ = Kind::stream;
    limit_ = sized_ ? size_ : no_limit;
    const auto opened = stream_.open_write(*stream, ref, size);
    piece_ = stream_.piece();
    return opened;
  }
  limit_ = sized_ ? size_ : capacity_;
  return size_ > capacity_ ? AbortCode::out_of_memory : AbortCode::none;
}

unsigned SdoServerData::segments(unsigned wanted) const noexcept {
  const std::size_t longest = std::min(od::Stream::longest_piece, stream_.sub_block());
  const std::size_t room = kind_ == Kind::buffer ? reserve_ - offset_ : std::min(reserve_, longest);
  return static_cast<unsigned>(std::clamp<std::size_t>(room / sdo::segment_bytes, 1, wanted));
}

od::Answer<std::uint8_t*> SdoServerData::far_place(std::size_t count) noexcept {
  if (kind_ == Kind::buffer) return od::refuse(too_long(offset_ + count));
  if (filled_ + count > std::min(reserve_, od::Stream::longest_piece) || filled_ >= piece_) {
    const auto code = flush();
    if (code != AbortCode::none) return od::refuse(code);
  }
  return buffer_.get() + filled_;
}

AbortCode SdoServerData::flush() noexcept {
  if (filled_ == 0) return AbortCode::none;
  const auto code = stream_.write({buffer_.get(), filled_});
  offset_ += std::exchange(filled_, 0);
  if (code != AbortCode::pending) return code;
  waits_ = true;
  return AbortCode::none;
}

AbortCode SdoServerData::too_long(std::size_t total) const noexcept {
  if (sized_) return AbortCode::length_too_high;
  const auto code = values_->check_write(ref_, total);
  return code == AbortCode::none ? AbortCode::out_of_memory : code;
}

AbortCode SdoServerData::close_write() noexcept {
  if (sized_ && offset_ + filled_ < size_) return AbortCode::length_too_low;
  if (kind_ != Kind::stream) return values().write(ref_, {buffer_.get(), offset_});
  const auto code = flush();
  return code == AbortCode::none ? stream_.close(true) : code;
}

}  // namespace berth::co
