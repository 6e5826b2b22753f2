/// What many lines say together.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/campaign/results.hpp"
#include "berth/campaign/seeds.hpp"

namespace berth::campaign {

/// Of those lines that have the figure; by the nearest rank, so that each is a value that came.
struct Spread {
  std::uint64_t count = 0;
  double median = 0, p95 = 0, most = 0;
  friend bool operator==(const Spread&, const Spread&) = default;
};
/// In any order; all 0 when there is none.
[[nodiscard]] Spread spread_of(std::vector<double> values);

/// The lines of one kind, of the same options, version and group.
struct Group {
  Kind kind = Kind::faults;
  std::string options, version, group;
  std::array<std::uint64_t, verdicts> count{};  ///< by `Verdict`
  std::uint64_t first = 0, last = 0;            ///< seeds
  Spread operational_s{}, bus_time_s{}, frames{}, lost{};

  [[nodiscard]] std::uint64_t seeds() const noexcept;
  [[nodiscard]] std::uint64_t of(Verdict verdict) const noexcept { return count[static_cast<std::size_t>(verdict)]; }
};

/// The seeds of one kind, of the same options and version.
struct Range {
  Kind kind = Kind::faults;
  std::string options, version;
  Seeds seeds;                 ///< from the lowest to the highest that has a line
  std::uint64_t count = 0;     ///< lines
  std::vector<Seeds> missing;  ///< between them, without a line
};

struct Summary {
  std::vector<Line> failures;  ///< those that are not good, in the order of `Results::lines`
  std::vector<Group> groups;
  std::vector<Range> ranges;
};
[[nodiscard]] Summary summarize(const Results& results);

}  // namespace berth::campaign
