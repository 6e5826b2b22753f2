// Any bytes from a serial adapter, in pieces: the reader keeps no more than it may, its lines have their places, and a
// frame that it takes for one is written and read back equal.
//
// Input: the first byte is the length of the pieces, the rest is the stream.
#include <algorithm>

#include "berth/io/slcan_codec.hpp"
#include "fuzz/require.hpp"

namespace slcan_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  using fuzz::require;
  if (size == 0) return 0;
  const std::size_t piece = std::max<std::size_t>(1, data[0]);
  const std::string_view all(reinterpret_cast<const char*>(data) + 1, size - 1);
  io::SlcanReader reader;
  for (std::size_t at = 0; at < all.size(); at += piece) {
    reader.add(all.substr(at, piece));
    while (const auto line = reader.next()) {
      require(line->at < all.size() && line->text.size() <= all.size());
      const auto parsed = io::parse_slcan(line->text);
      if (parsed.kind != io::SlcanLine::Kind::frame) continue;
      auto text = io::write_slcan(parsed.frame);
      require(text.back() == '\r');
      text.pop_back();
      const auto again = io::parse_slcan(text);
      require(again.kind == parsed.kind && again.frame == parsed.frame);
    }
    require(reader.kept() <= io::SlcanReader::longest + piece);
  }
  return 0;
}

}  // namespace slcan_target
