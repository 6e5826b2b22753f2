// Any bytes as text for a terminal: what comes out does nothing to it, and what was harmless stays as it is.
#include "berth/text/printable.hpp"
#include "fuzz/require.hpp"

namespace printable_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const auto text = text::printable(bytes);
  fuzz::require(text::is_printable(text));
  for (const char c : text) fuzz::require(c == '\n' || c == '\t' || static_cast<unsigned char>(c) >= 0x20);
  if (text::is_printable(bytes)) fuzz::require(text == bytes);
  fuzz::require(text::printable(text) == text);
  const auto line = text::one_line(bytes);
  fuzz::require(text::is_printable(line) && line.find('\n') == std::string::npos);
  return 0;
}

}  // namespace printable_target
