// A line of a campaign: what is read is written again, and is read as the same.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "berth/campaign/line.hpp"
#include "berth/campaign/seeds.hpp"
#include "fuzz/require.hpp"

namespace campaign_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  using namespace berth::campaign;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  static_cast<void>(parse_seeds(text));
  const auto line = parse_line(text);
  if (!line) return 0;
  // Not the same where what is no UTF-8 is replaced, or a reason is cut: then from the second time on.
  const auto again = parse_line(to_json(*line));
  fuzz::require(again.has_value());
  fuzz::require(again->key.seed == line->key.seed && again->verdict == line->verdict && again->hash == line->hash);
  fuzz::require(again->figures == line->figures);
  const auto third = parse_line(to_json(*again));
  fuzz::require(third.has_value() && *third == *again);
  return 0;
}

}  // namespace campaign_target
