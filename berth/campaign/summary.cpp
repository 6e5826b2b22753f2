#include "berth/campaign/summary.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <optional>
#include <tuple>

namespace berth::campaign {
namespace {

struct Values {
  Group group;
  std::vector<double> operational_s, bus_time_s, frames, lost;
};

template <class T>
void put(std::vector<double>& values, const std::optional<T>& value) {
  if (value) values.push_back(static_cast<double>(*value));
}

void add(Values& to, const Line& line) {
  Group& group = to.group;
  if (group.seeds() == 0) {
    group = {.kind = line.key.kind,
             .options = line.key.options,
             .version = line.key.version,
             .group = line.group,
             .first = line.key.seed,
             .last = line.key.seed};
  }
  group.first = std::min(group.first, line.key.seed);
  group.last = std::max(group.last, line.key.seed);
  ++group.count[static_cast<std::size_t>(line.verdict)];
  put(to.operational_s, line.figures.operational_s);
  put(to.bus_time_s, line.figures.bus_time_s);
  put(to.frames, line.figures.frames);
  put(to.lost, line.figures.lost);
}

/// The keys come in their order: by kind, options, version and seed.
void add(std::vector<Range>& ranges, const Key& key) {
  const bool goes_on = !ranges.empty() && ranges.back().kind == key.kind && ranges.back().options == key.options &&
                       ranges.back().version == key.version;
  if (!goes_on) {
    ranges.push_back({.kind = key.kind,
                      .options = key.options,
                      .version = key.version,
                      .seeds = {key.seed, key.seed},
                      .count = 1,
                      .missing = {}});
    return;
  }
  Range& range = ranges.back();
  if (key.seed - range.seeds.last > 1) range.missing.push_back({range.seeds.last + 1, key.seed - 1});
  range.seeds.last = key.seed;
  ++range.count;
}

Group finished(Values values) {
  Group group = std::move(values.group);
  group.operational_s = spread_of(std::move(values.operational_s));
  group.bus_time_s = spread_of(std::move(values.bus_time_s));
  group.frames = spread_of(std::move(values.frames));
  group.lost = spread_of(std::move(values.lost));
  return group;
}

}  // namespace

Spread spread_of(std::vector<double> values) {
  if (values.empty()) return {};
  std::ranges::sort(values);
  // The lowest value that so many of a hundred do not exceed.
  const auto rank = [&](std::size_t percent) { return values[(values.size() * percent + 99) / 100 - 1]; };
  return {.count = values.size(), .median = rank(50), .p95 = rank(95), .most = values.back()};
}

std::uint64_t Group::seeds() const noexcept { return std::accumulate(count.begin(), count.end(), std::uint64_t{0}); }

Summary summarize(const Results& results) {
  Summary summary;
  std::map<std::tuple<Kind, std::string, std::string, std::string>, Values> groups;
  for (const auto& [key, line] : results.lines()) {
    if (line.verdict != Verdict::good) summary.failures.push_back(line);
    add(summary.ranges, key);
    add(groups[{key.kind, key.options, key.version, line.group}], line);
  }
  for (auto& [name, values] : groups) summary.groups.push_back(finished(std::move(values)));
  return summary;
}

}  // namespace berth::campaign
