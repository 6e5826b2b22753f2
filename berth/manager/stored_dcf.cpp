#include "berth/manager/stored_dcf.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>

namespace berth::manager {
namespace {

/// Inflates piece by piece, so that the bound holds before the memory is taken.
class Unpacker {
 public:
  Unpacker() noexcept { ready_ = inflateInit(&stream_) == Z_OK; }
  ~Unpacker() {
    if (ready_) inflateEnd(&stream_);
  }
  Unpacker(const Unpacker&) = delete;
  Unpacker& operator=(const Unpacker&) = delete;

  Result<std::string> run(std::span<const std::uint8_t> bytes) {
    if (!ready_) return fail(Errc::invalid, "zlib could not be started");
    stream_.next_in = const_cast<Bytef*>(bytes.data());  // zlib reads it only
    stream_.avail_in = static_cast<uInt>(bytes.size());
    std::string text;
    int state = Z_OK;
    while (state == Z_OK) {
      stream_.next_out = piece_.data();
      stream_.avail_out = static_cast<uInt>(piece_.size());
      state = inflate(&stream_, Z_NO_FLUSH);
      const std::size_t got = piece_.size() - stream_.avail_out;
      if (got > longest_stored_text - text.size()) return fail(Errc::invalid, "it unpacks to more than 4 MiB");
      text.append(piece_.begin(), piece_.begin() + static_cast<std::ptrdiff_t>(got));
    }
    if (state != Z_STREAM_END) return fail(Errc::invalid, "it is not a zlib stream, or it is damaged");
    if (stream_.avail_in != 0) return fail(Errc::invalid, "bytes follow its zlib stream");
    return text;
  }

 private:
  z_stream stream_{};
  std::array<Bytef, 4096> piece_{};
  bool ready_ = false;
};

}  // namespace

std::vector<std::uint8_t> pack_stored(std::string_view text) {
  auto size = compressBound(static_cast<uLong>(text.size()));
  std::vector<std::uint8_t> packed(size);
  // Fails only without memory, or with too little room: neither is so.
  compress2(packed.data(), &size, reinterpret_cast<const Bytef*>(text.data()), static_cast<uLong>(text.size()),
            Z_BEST_COMPRESSION);
  packed.resize(size);
  return packed;
}

Result<std::string> unpack_stored(std::uint8_t format, std::span<const std::uint8_t> bytes) {
  if (format == stored_format::ascii) return std::string(bytes.begin(), bytes.end());
  if (format != stored_format::zlib) return fail(Errc::unsupported, "the stored data has an unknown format");
  return Unpacker().run(bytes);
}

}  // namespace berth::manager
