#include "berth/process/network_variables.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/device/mandatory.hpp"
#include "berth/od/notation.hpp"

namespace berth::process {

const eds::DynamicSegment* segment_of(std::span<const eds::DynamicSegment> segments, ObjectRef object) {
  const auto within = [&](const eds::DynamicSegment& s) { return s.address(object).has_value(); };
  const auto found = std::ranges::find_if(segments, within);
  return found == segments.end() ? nullptr : &*found;
}

std::shared_ptr<const od::Description> with_variables(const od::Description& base,
                                                      std::span<const eds::DynamicSegment> segments,
                                                      std::span<const NetworkVariable> variables,
                                                      std::vector<VariableProblem>& problems) {
  constexpr auto where = "`berth link --links` says where the linker puts it";
  od::DescriptionBuilder b;
  device::add_all(b, base);
  const auto before = problems.size();
  for (const auto& each : variables) {
    const auto object = od::write_object(each.object);
    const auto* const segment = segment_of(segments, each.object);
    if (segment == nullptr) {
      problems.push_back(
          {each.name, fmt::format("{} lies in no segment of its description's [DynamicChannels]", object), where});
    } else if (segment->type != each.type) {
      problems.push_back(
          {each.name,
           fmt::format("{} is in a segment of {}, not of {}", object, od::name(segment->type), od::name(each.type)),
           where});
    } else if (b.has(each.object)) {
      problems.push_back({each.name, fmt::format("{} is there already", object), "give each a place of its own"});
    } else {
      if (!b.has(each.object.index)) {
        b.object(each.object.index, od::ObjectCode::array, fmt::format("Network variables {:04X}h", each.object.index),
                 each.type);
      }
      b.sub(
          each.object.index,
          {.sub = each.object.sub, .name = each.name, .type = each.type, .access = segment->access, .mappable = true});
    }
  }
  return problems.size() == before ? b.build() : nullptr;
}

}  // namespace berth::process
