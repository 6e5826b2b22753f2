#include "berth/co/sdo_access.hpp"

#include <array>
#include <vector>

namespace berth::co {

rt::Task<Result<std::uint32_t>> SdoAccess::read_u32(std::uint16_t index, std::uint8_t sub) {
  auto value = co_await read(index, sub);
  if (!value) co_return fail(value.error());
  const auto number = value->as<std::uint32_t>();
  if (!number) {
    co_return fail(Error{.code = Errc::mismatch, .sub = sub, .index = index, .text = "the object is not 32 bits long"});
  }
  co_return *number;
}

rt::Task<Result<SdoValue>> SdoAccess::read_up_to(std::uint16_t index, std::uint8_t sub, std::size_t) {
  co_return co_await read(index, sub);
}

rt::Task<Result<void>> SdoAccess::download(std::uint16_t index, std::uint8_t sub, SdoSource& source,
                                           const SdoOptions&) {
  std::vector<std::uint8_t> all;
  std::array<std::uint8_t, 512> piece{};
  for (std::size_t got = piece.size(); got == piece.size();) {
    const auto read = source.read(piece);
    if (!read) {
      co_return fail(Error{.code = Errc::mismatch,
                           .sub = sub,
                           .index = index,
                           .detail = static_cast<std::uint32_t>(read.error()),
                           .text = "the source gave no more bytes"});
    }
    got = *read;
    all.insert(all.end(), piece.begin(), piece.begin() + static_cast<std::ptrdiff_t>(got));
  }
  const std::span<const std::uint8_t> bytes(all);
  co_return co_await write(index, sub, bytes);
}

rt::Task<Result<void>> SdoAccess::write_u32(std::uint16_t index, std::uint8_t sub, std::uint32_t value) {
  std::array<std::uint8_t, 4> bytes{};
  store_le(bytes.data(), value);
  const std::span<const std::uint8_t> data(bytes);
  co_return co_await write(index, sub, data);
}

rt::Task<Result<SdoValue>> NodeAccess::read(std::uint16_t index, std::uint8_t sub) {
  const SdoOptions options = options_.value_or(client_->options());
  co_return co_await client_->upload(node_, index, sub, options);
}

rt::Task<Result<SdoValue>> NodeAccess::read_up_to(std::uint16_t index, std::uint8_t sub, std::size_t most) {
  SdoOptions options = options_.value_or(client_->options());
  options.longest = most;
  co_return co_await client_->upload(node_, index, sub, options);
}

rt::Task<Result<void>> NodeAccess::write(std::uint16_t index, std::uint8_t sub, std::span<const std::uint8_t> data) {
  const SdoOptions options = options_.value_or(client_->options());
  co_return co_await client_->download(node_, index, sub, data, options);
}

rt::Task<Result<void>> NodeAccess::download(std::uint16_t index, std::uint8_t sub, SdoSource& source,
                                            const SdoOptions& how) {
  const SdoOptions options = how;
  co_return co_await client_->download(node_, index, sub, source, options);
}

}  // namespace berth::co
