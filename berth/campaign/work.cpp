#include "berth/campaign/work.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>

#include "berth/harness/as_sold.hpp"
#include "berth/harness/matrix.hpp"
#include "berth/harness/run_world.hpp"
#include "berth/harness/tree_as_sold.hpp"
#include "berth/harness/tree_world.hpp"
#include "berth/study/contest.hpp"

namespace berth::campaign {
namespace {

constexpr std::array<const char*, variants> variant_names{"usual", "plain", "twins", "waits", "as-sold"};

double seconds(rt::Duration time) { return std::chrono::duration<double>(time).count(); }
std::optional<double> seconds(std::optional<rt::Duration> time) {
  return time ? std::optional(seconds(*time)) : std::nullopt;
}

/// As the options of `./run faults` (tests/tools/faults.cpp).
harness::Draws draws_of(Variant variant) {
  return {.twins = variant == Variant::twins,
          .waits = variant == Variant::waits || variant == Variant::as_sold,
          .as_sold = variant != Variant::plain && variant != Variant::waits};
}

Came run_faults(Variant variant, std::uint64_t seed, const harness::Folders& folders, const Show& show) {
  const auto plan = harness::plan_world(seed, draws_of(variant), folders);
  const auto outcome = harness::run_world(plan, static_cast<bool>(show));
  if (show) show(outcome.log);
  return {.group = {},
          .cell = {},
          .figures = {seconds(outcome.operational), seconds(outcome.bus_time), outcome.frames, outcome.lost},
          .hash = outcome.hash,
          .reason = outcome.failure};
}

Came run_tree(Variant variant, std::uint64_t seed, const harness::Folders& folders, const Show& show) {
  const harness::TreeDraws draws{.mixed = variant != Variant::plain, .as_sold = variant == Variant::as_sold};
  const auto plan = harness::plan_of_tree(seed, draws, folders.own);
  harness::TreeWorld world(plan);
  Came result;
  result.reason = world.go(harness::troubles_of_a_tree);
  while (result.reason.ends_with('\n')) result.reason.pop_back();
  if (show) show(world.log());
  if (!world.made()) return result;
  std::uint64_t frames = 0, lost = 0;
  for (const auto* const bus : plan.machine.all_buses()) frames += world.world().bus(bus->name)->statistics().frames;
  for (const auto& d : world.world().devices()) lost += d->controller().statistics().overruns;
  result.figures = {seconds(world.first_operational()), seconds(world.world().sim().now() - rt::Time{}), frames, lost};
  result.hash = world.world().sim().trace_hash();
  return result;
}

/// Which cell a seed is, and how often all of them have had their turn before.
struct Turn {
  std::size_t place;
  std::uint64_t round;
};
Turn turn_of(std::uint64_t seed, std::size_t cells) { return {(seed - 1) % cells, (seed - 1) / cells}; }

Came run_cell(std::uint64_t seed, const Show& show) {
  namespace matrix = harness::matrix;
  const auto cells = matrix::cells_of({});
  const auto turn = turn_of(seed, cells.size());
  matrix::Cell cell = cells[turn.place];
  cell.round = turn.round;
  std::string log;
  const auto line = [&log](const std::string& text) { log += text + "\n"; };
  const auto outcome = matrix::run(cell, matrix::budget(cell), show ? matrix::Show(line) : matrix::Show(), true);
  if (show) show(log);
  Came result{.group = matrix::name(cell.kind),
              .cell = matrix::describe(cell),
              .figures = {},
              .hash = outcome.hash,
              .reason = {}};
  const bool operational = outcome.end == matrix::End::operational;
  const double time = seconds(outcome.bus_time);
  result.figures = {operational ? std::optional(time) : std::nullopt, time, outcome.frames, outcome.lost};
  if (!operational && !matrix::limit_of(cell))
    result.reason = fmt::format("{}: {}", matrix::name(outcome.end), outcome.why.data());
  return result;
}

std::string describe(const study::Cell& cell) {
  return fmt::format("{}, {} devices, {} kbit/s, {}", study::name(cell.method), cell.devices, cell.bit_rate / 1000,
                     study::name(cell.serials));
}

Came run_trial(std::uint64_t seed, const Show& show) {
  const study::Contest contest;
  const auto cells = study::cells_of(contest);
  const auto turn = turn_of(seed, cells.size());
  const auto& cell = cells[turn.place];
  const auto trial = study::trial(cell, contest.response, turn.round + 1);
  if (show) show(fmt::format("{}: {} found, {} bound {}\n", describe(cell), trial.found, trial.bound, trial.trouble));
  Came result{.group = std::string(study::name(cell.method)),
              .cell = describe(cell),
              .figures = {},
              .hash = {},
              .reason = trial.wrong.empty() ? std::string() : trial.wrong.front()};
  const double time = seconds(trial.bus_time);
  const bool all = trial.bound == cell.devices;
  result.figures = {all ? std::optional(time) : std::nullopt, time, trial.frames, std::nullopt};
  return result;
}

Came run_once(const Work& work, std::uint64_t seed, const harness::Folders& folders, const Show& show) {
  switch (work.kind) {
    case Kind::faults: return run_faults(work.variant, seed, folders, show);
    case Kind::trees: return run_tree(work.variant, seed, folders, show);
    case Kind::matrix: return run_cell(seed, show);
    case Kind::compare: break;
  }
  return run_trial(seed, show);
}

std::string replay_of(const Work& work, std::uint64_t seed) {
  const std::string options = options_of(work);
  return fmt::format("berth study {}{}{} --seeds {} --show", name(work.kind), options.empty() ? "" : " ", options,
                     seed);
}

}  // namespace

const char* name(Variant variant) noexcept { return variant_names[static_cast<std::size_t>(variant)]; }

std::optional<Variant> variant_of(std::string_view wanted) noexcept {
  for (std::size_t i = 0; i < variants; ++i) {
    if (wanted == variant_names[i]) return static_cast<Variant>(i);
  }
  return std::nullopt;
}

std::vector<Variant> variants_of(Kind kind) {
  using enum Variant;
  if (kind == Kind::faults) return {usual, plain, twins, waits, as_sold};
  if (kind == Kind::trees) return {usual, plain, as_sold};
  return {usual};
}

std::string options_of(const Work& work) {
  std::string text;
  if (work.variant != Variant::usual) text = fmt::format("--variant {}", name(work.variant));
  if (work.twice) text += text.empty() ? "--twice" : " --twice";
  return text;
}

Key key_of(const Work& work, std::string_view version, std::uint64_t seed) {
  return {.kind = work.kind, .options = options_of(work), .version = std::string(version), .seed = seed};
}

Line line_without_result(const Work& work, std::string_view version, std::uint64_t seed, Verdict verdict,
                         std::string_view reason) {
  Line line;
  line.key = key_of(work, version, seed);
  line.verdict = verdict;
  line.reason = std::string(reason);
  line.replay = replay_of(work, seed);
  return line;
}

std::uint64_t lowest_seed(Kind kind) noexcept { return kind == Kind::matrix || kind == Kind::compare ? 1 : 0; }

std::uint64_t round_of(Kind kind) {
  if (kind == Kind::matrix) return harness::matrix::cells_of({}).size();
  return kind == Kind::compare ? study::cells_of({}).size() : 0;
}

Line line_of(const Work& work, std::string_view version, std::uint64_t seed, const Came& came) {
  const bool good = came.reason.empty();
  return {.key = key_of(work, version, seed),
          .group = came.group,
          .cell = came.cell,
          .verdict = good ? Verdict::good : Verdict::failed,
          .figures = came.figures,
          .hash = came.hash,
          .reason = came.reason,
          .replay = good ? std::string() : replay_of(work, seed)};
}

Line line_that_differs(const Work& work, std::string_view version, std::uint64_t seed, const Came& first,
                       const Came& second) {
  const auto told = [](const Came& came) { return came.reason.empty() ? std::string("good") : came.reason; };
  Line line = line_of(work, version, seed, first);
  line.verdict = Verdict::differs;
  line.reason = "two runs of it differ";
  if (first.reason != second.reason) line.reason += fmt::format(": {}; {}", told(first), told(second));
  line.replay = replay_of(work, seed);
  return line;
}

Line run_seed(const Work& work, std::string_view version, std::uint64_t seed, const harness::Folders& folders,
              const Show& show) {
  const Came came = run_once(work, seed, folders, show);
  Line line = line_of(work, version, seed, came);
  if (!work.twice) return line;
  const Came second = run_once(work, seed, folders, {});
  return second == came ? line : line_that_differs(work, version, seed, came, second);
}

}  // namespace berth::campaign
