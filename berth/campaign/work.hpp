/// What a campaign does with one seed. The worlds are those of `./run faults`, `./run matrix` and `berth compare`, by
/// the same code (berth/harness, berth/study):
///
///   faults   `harness::run_world` of the world that `harness::plan_world` draws from the seed
///   trees    `harness::TreeWorld` of the tree of buses that `harness::plan_of_tree` draws
///   matrix   one cell of `harness::matrix`: seed 1 is the first, and when all cells had their turn they come again
///            with other serial numbers
///   compare  one trial of one cell of `study::compare`, in the same manner
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/campaign/line.hpp"
#include "berth/harness/folders.hpp"

namespace berth::campaign {

/// Which worlds of a kind a seed gives; not every kind has every one.
enum class Variant : std::uint8_t {
  usual,    ///< faults: a third with devices as shops sell them; trees: with replacements and sister buses
  plain,    ///< faults, trees: without those
  twins,    ///< faults: devices of one address on several buses
  waits,    ///< faults: devices that wait for a power cycle, cables cut for long, and a judge of what is told
  as_sold,  ///< faults: both; trees: devices as shops sell them beneath the gateways
};
inline constexpr std::size_t variants = 5;
[[nodiscard]] const char* name(Variant variant) noexcept;
[[nodiscard]] std::optional<Variant> variant_of(std::string_view name) noexcept;
/// Those that this kind has; `usual` is always one.
[[nodiscard]] std::vector<Variant> variants_of(Kind kind);

struct Work {
  Kind kind = Kind::faults;
  Variant variant = Variant::usual;
  bool twice = false;  ///< each seed is run two times, and the two are compared
};

/// As on the command line of `berth study`; empty for the usual work.
[[nodiscard]] std::string options_of(const Work& work);
/// `version`: of the program.
[[nodiscard]] Key key_of(const Work& work, std::string_view version, std::uint64_t seed);
/// What came of a seed.
struct Came {
  std::string group, cell;  ///< as in `Line`
  Figures figures;
  std::optional<std::uint64_t> hash;
  std::string reason;  ///< empty: good
  friend bool operator==(const Came&, const Came&) = default;
};
/// Its line.
[[nodiscard]] Line line_of(const Work& work, std::string_view version, std::uint64_t seed, const Came& came);
/// The line of a seed of which two runs were not equal; its figures are those of the first.
[[nodiscard]] Line line_that_differs(const Work& work, std::string_view version, std::uint64_t seed, const Came& first,
                                     const Came& second);
/// The line of a seed whose process ended without one; `reason`: how.
[[nodiscard]] Line line_without_result(const Work& work, std::string_view version, std::uint64_t seed, Verdict verdict,
                                       std::string_view reason);

/// The lowest seed of a kind: 0, and 1 where the seeds are numbers of cells.
[[nodiscard]] std::uint64_t lowest_seed(Kind kind) noexcept;
/// How many seeds go once round the cells of `matrix` or `compare`; 0 for the others.
[[nodiscard]] std::uint64_t round_of(Kind kind);

/// Takes a text of many lines that shows what happened in a world.
using Show = std::function<void(const std::string& log)>;
/// Runs one seed, from `lowest_seed` on; `folders` for its files. A world that cannot be made ends the process, as does
/// a mistake of Berth's that does so.
[[nodiscard]] Line run_seed(const Work& work, std::string_view version, std::uint64_t seed,
                            const harness::Folders& folders, const Show& show = {});

}  // namespace berth::campaign
