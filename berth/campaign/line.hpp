/// One line of a campaign's file: what came of one seed. A line is one JSON object; which keys it has, and what they
/// mean: docs/campaigns.md. Nothing in it depends on the machine that it was run on, on the number of jobs or on the
/// time of day: the same work gives the same bytes, except where it is no result (`is_result`).
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "berth/base/result.hpp"

namespace berth::campaign {

/// What a seed gives.
enum class Kind : std::uint8_t { faults, trees, matrix, compare };
/// In the order of the values.
inline constexpr std::size_t kinds = 4;
[[nodiscard]] const char* name(Kind kind) noexcept;
[[nodiscard]] std::optional<Kind> kind_of(std::string_view name) noexcept;

/// What came of it.
enum class Verdict : std::uint8_t {
  good,
  failed,    ///< `Line::reason` says how
  differs,   ///< two runs of it were not equal
  crashed,   ///< its process died by a mistake in it: a signal such as SIGSEGV or SIGABRT, or an exit
  killed,    ///< its process was killed from outside (SIGKILL): by the system when memory ran out, or by somebody
  too_long,  ///< its process was ended by the limit of real time
};
inline constexpr std::size_t verdicts = 6;
[[nodiscard]] const char* name(Verdict verdict) noexcept;  ///< "too long"
/// False: `killed` and `too_long` say something about the computer, not about the seed, which is done again.
[[nodiscard]] bool is_result(Verdict verdict) noexcept;

/// What was done: two lines of one key must say the same.
struct Key {
  Kind kind = Kind::faults;
  std::string options;  ///< as on the command line, "--variant twins"; empty: none
  std::string version;  ///< of the program
  std::uint64_t seed = 0;
  friend auto operator<=>(const Key&, const Key&) = default;
  friend bool operator==(const Key&, const Key&) = default;
};

/// Absent: the kind has none, or it did not come so far.
struct Figures {
  std::optional<double> operational_s;  ///< bus time until all was operational for the first time; `compare`: bound
  std::optional<double> bus_time_s;     ///< of all of it
  std::optional<std::uint64_t> frames;  ///< on all buses, without error
  std::optional<std::uint64_t> lost;    ///< receptions that devices lost: overrun, or deaf
  friend bool operator==(const Figures&, const Figures&) = default;
};

struct Line {
  Key key;
  std::string group;  ///< what the summary counts by itself: a method, a kind of devices; empty: nothing
  std::string cell;   ///< of `matrix` and `compare`: which
  Verdict verdict = Verdict::good;
  Figures figures;
  std::optional<std::uint64_t> hash;  ///< of everything that happened on the buses
  std::string reason;                 ///< why it is not good
  std::string replay;                 ///< the command line that does it again and shows it; empty when good
  friend bool operator==(const Line&, const Line&) = default;
};

/// One line without its line feed. What is no UTF-8 in it is replaced.
[[nodiscard]] std::string to_json(const Line& line);

/// The longest line that is read, in bytes; a reason that would make one longer is cut when it is written.
inline constexpr std::size_t longest_line = 65'536;
/// Reads what `to_json` wrote; unknown keys are passed over. `Errc::invalid`: it is no line of a campaign.
[[nodiscard]] Result<Line> parse_line(std::string_view text);

}  // namespace berth::campaign
