// Any bytes as a concise DCF: refused with a place inside of the stream, or the same bytes come out again.
#include <algorithm>
#include <cstdint>
#include <cstdlib>

#include "berth/eds/concise_dcf.hpp"
#include "berth/od/description.hpp"
#include "fuzz/require.hpp"

namespace concise_dcf_target {

namespace {

using namespace berth;

using fuzz::require;

const od::Description& device() {
  static const auto made = [] {
    od::DescriptionBuilder builder;
    builder.variable(0x1017, {.name = "h", .type = od::DataType::unsigned16});
    builder.object(0x1800, od::ObjectCode::record, "t")
        .sub(0x1800, {.sub = 1, .name = "c", .initial = od::Literal::node_id_plus(0x180)});
    builder.variable(0x2000, {.name = "s", .type = od::DataType::visible_string});
    return builder.build();
  }();
  return *made;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::span stream(data, size);
  const auto dcf = eds::decode_concise_dcf(stream);
  if (!dcf) {
    require(dcf.error().code == Errc::invalid && dcf.error().detail <= size);
    return 0;
  }
  const auto again = eds::encode(*dcf);
  require(size == 0 || std::ranges::equal(again, stream));
  const auto ordered = eds::in_working_order(*dcf);
  for (const auto& each : ordered.entries) {
    const auto said = [&each](const eds::ConciseEntry& other) { return other.object == each.object; };
    require(std::ranges::any_of(dcf->entries, said));
  }
  const auto values = eds::parameters(*dcf, device(), NodeId(5));
  if (!values) return 0;
  const auto back = eds::concise_dcf(device(), *values, NodeId(5), eds::Order::as_given);
  require(back.has_value());
  for (const auto& each : back->entries) {
    const auto last = std::find_if(dcf->entries.rbegin(), dcf->entries.rend(),
                                   [&each](const eds::ConciseEntry& other) { return other.object == each.object; });
    require(last != dcf->entries.rend() && last->data == each.data);
  }
  return 0;
}

}  // namespace concise_dcf_target
