// Any bytes as a compressed DCF: refused, or a text within its bound that comes back when it is packed again.
#include "berth/manager/stored_dcf.hpp"
#include "fuzz/require.hpp"

namespace stored_dcf_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  using namespace berth::manager;
  const std::span bytes(data, size);
  const auto text = unpack_stored(stored_format::zlib, bytes);
  if (!text) {
    fuzz::require(text.error().code == Errc::invalid);
    return 0;
  }
  fuzz::require(text->size() <= longest_stored_text);
  const auto again = unpack_stored(stored_format::zlib, pack_stored(*text));
  fuzz::require(again.has_value() && *again == *text);
  return 0;
}

}  // namespace stored_dcf_target
