// A gzip file's bytes: pieces of any size give the same, and nothing more comes behind an error.
#include <string>

#include "berth/trace/gunzip.hpp"
#include "fuzz/require.hpp"

namespace gunzip_target {

struct Unpacked {
  std::string text;
  bool wrong = false;
  bool whole = false;
  friend bool operator==(const Unpacked&, const Unpacked&) = default;
};

inline Unpacked unpack(std::string_view packed, std::size_t piece) {
  Unpacked unpacked;
  berth::trace::Gunzip gunzip;
  for (std::size_t at = 0; at < packed.size() && !unpacked.wrong; at += piece) {
    unpacked.wrong =
        !gunzip.feed(packed.substr(at, piece), [&](std::string_view bytes) { unpacked.text += bytes; }).empty();
  }
  unpacked.whole = gunzip.whole() && !unpacked.wrong;
  return unpacked;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view packed(reinterpret_cast<const char*>(data), size);
  const auto whole = unpack(packed, size + 1);
  const auto pieces = unpack(packed, 1 + size % 13);
  berth::fuzz::require(whole.wrong == pieces.wrong && whole.whole == pieces.whole);
  berth::fuzz::require(whole.wrong || whole.text == pieces.text);
  return 0;
}

}  // namespace gunzip_target
