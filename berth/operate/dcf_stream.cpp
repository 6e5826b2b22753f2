#include "berth/operate/dcf_stream.hpp"

#include <algorithm>
#include <utility>

#include "berth/od/cia302.hpp"

namespace berth::operate {

using od::AbortCode;

void DcfStream::attach_to(od::Values& values) {
  constexpr std::uint8_t most_nodes = 127;
  for (const std::uint16_t index : {od::cia302::store_dcf, od::cia302::concise_dcf}) {
    for (std::uint8_t node = 1; node <= most_nodes; ++node) values.attach(*this, {index, node});
  }
}

od::Answer<std::optional<std::size_t>> DcfStream::open_read(ObjectRef ref) noexcept {
  bytes_ = owner_->dcf(ref);
  given_ = 0;
  writes_ = false;
  if (bytes_.empty()) return od::refuse(AbortCode::no_data);
  return std::optional(bytes_.size());
}

od::Answer<std::size_t> DcfStream::read(std::span<std::uint8_t> into) noexcept {
  const std::size_t count = std::min(into.size(), bytes_.size() - given_);
  std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(given_), count, into.begin());
  given_ += count;
  return count;
}

AbortCode DcfStream::open_write(ObjectRef ref, std::optional<std::size_t> size) noexcept {
  const AbortCode may = owner_->may_store(ref);
  if (may != AbortCode::none) return may;
  if (size.value_or(0) > longest) return AbortCode::length_too_high;
  bytes_.clear();
  writes_ = true;
  return AbortCode::none;
}

AbortCode DcfStream::write(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() > longest - bytes_.size()) return AbortCode::length_too_high;
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  return AbortCode::none;
}

AbortCode DcfStream::close(ObjectRef ref, bool complete) noexcept {
  const auto all = std::exchange(bytes_, {});
  return writes_ && complete ? owner_->store(ref, all) : AbortCode::none;
}

}  // namespace berth::operate
